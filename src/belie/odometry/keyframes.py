"""Which frames are kept for triangulation (the keyframes of section III-B).

A frame is kept when the view has changed enough for its rays to meet the older ones at a useful angle,
or when the last keyframe is going out of sight. A robot that stands keeps none: the map that it has
stays good, and a window full of equal views would lose it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydantic import Field

from belie.types import Settings


class KeyframeSettings(Settings):
    """When a frame becomes a keyframe.

    >>> KeyframeSettings().window
    5
    """

    window: int = Field(
        5, ge=2, le=50, description="Keyframes that the map is built from [count]: the short temporal window."
    )
    min_motion_rad: float = Field(
        0.015,
        gt=0.0,
        description="Median motion of the corners since the last keyframe that makes a new one [rad]:"
        " three times the least parallax of a map point.",
    )
    min_tracked_share: float = Field(
        0.3,
        ge=0.0,
        le=1.0,
        description="Share of the last keyframe's corners found again below which a new one is made [share].",
    )
    still_rad: float = Field(
        0.002,
        ge=0.0,
        description="Median motion below which the camera stands, and no keyframe is made [rad].",
    )


def keyframe_reason(
    displacement_px: npt.NDArray[np.floating],
    corners_before: int,
    focal_px: float,
    settings: KeyframeSettings,
) -> str | None:
    """Why this frame should be a keyframe; None if it should not.

    Parameters
    ----------
    displacement_px : array (N,)
        How far the corners of the last keyframe that were found again have moved since.
    corners_before : int
        Corners of the last keyframe; 0 if there is none.
    focal_px : float
        Focal length, to turn pixels into radians.
    settings : KeyframeSettings

    Examples
    --------
    >>> keyframe_reason(np.full(90, 30.0), 100, 700.0, KeyframeSettings())
    'the view has moved by 2.5 deg'
    >>> keyframe_reason(np.full(90, 0.5), 100, 700.0, KeyframeSettings()) is None
    True
    """
    if corners_before == 0:
        return "first keyframe"
    share = len(displacement_px) / corners_before
    if share < 0.1 * settings.min_tracked_share:
        return "the last keyframe is out of sight"
    motion_rad = float(np.median(displacement_px)) / focal_px
    if motion_rad < settings.still_rad:
        return None
    if motion_rad >= settings.min_motion_rad:
        return f"the view has moved by {np.degrees(motion_rad):.1f} deg"
    if share < settings.min_tracked_share:
        return f"only {100.0 * share:.0f} % of the last keyframe's corners are seen"
    return None
