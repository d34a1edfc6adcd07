"""What the renderer gives for one moment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rendered:
    """One picture with its truth, pixel by pixel.

    Parameters
    ----------
    bgr : array (H, W, 3), uint8
        As the camera gives it: with lens, blur, noise, rain.
    gray : array (H, W), uint8
        The same without colour.
    depth_m : array (H, W), float32, or None
        Along the optical axis (Z), at the middle of the exposure; infinite in the sky. None if not asked for.
    ids : array (H, W), int32, or None
        Which actor is seen; 0: none.
    """

    bgr: npt.NDArray[np.uint8]
    gray: npt.NDArray[np.uint8]
    depth_m: npt.NDArray[np.float32] | None
    ids: npt.NDArray[np.int32] | None
