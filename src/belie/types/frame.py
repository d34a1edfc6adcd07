"""What the camera says: one image, and the camera it came from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel
from belie.types.arrays import read_only

GrayImage = npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """One camera image.

    Parameters
    ----------
    camera : str
        Name of the camera (its image topic), a key of the detector's cameras.
    stamp_ns : int
        What the sender says (forgeable): the header stamp, nanoseconds.
    received_ns : int
        When we got it, nanoseconds.
    image : array (height, width), uint8
        Gray values; made read-only.

    Examples
    --------
    >>> Frame(camera="/image", stamp_ns=0, received_ns=0, image=np.zeros((4, 6), np.uint8)).image.shape
    (4, 6)
    """

    camera: str
    stamp_ns: int
    received_ns: int
    image: GrayImage

    def __post_init__(self) -> None:
        if self.image.ndim != 2 or self.image.dtype != np.uint8 or self.image.size == 0:
            raise ValueError(
                f"image must be (height, width) uint8, got {self.image.shape} {self.image.dtype}"
            )
        object.__setattr__(self, "image", read_only(self.image))


@dataclass(frozen=True, slots=True, kw_only=True)
class MountedCamera:
    """A camera and where it sits: ``T_body_cam`` maps camera to body coordinates.

    Camera axes are x right, y down, z forward. There is no default mount: a recording without the
    transform is an error, never an identity.
    """

    model: CameraModel
    T_body_cam: SE3
