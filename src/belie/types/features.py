"""Corners of one image, keyframes and map points: the values of equations (2) and (3)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, FloatArray
from belie.types.arrays import frozen, frozen_as


def _no_thresholds() -> npt.NDArray[np.float32]:
    return np.empty(0, dtype=np.float32)


def _same_length(**arrays: npt.NDArray[np.generic]) -> None:
    if len({len(array) for array in arrays.values()}) > 1:
        lengths = ", ".join(f"{name} {len(array)}" for name, array in arrays.items())
        raise ValueError(f"arrays must have one length, got {lengths}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Features:
    """The corners of one image, ``k_t`` of equation (2).

    Parameters
    ----------
    px : array (N, 2), float32
        Positions in pixels of the full-resolution image, pixel centres at integers.
    level : array (N,), int8
        Pyramid level on which the corner was found; 0 is full resolution.
    score : array (N,), float32
        Smaller eigenvalue of the structure tensor, gray²; larger is better.
    thresholds : array (T,), float32
        FAST threshold that each tile of the pyramid should be given next, gray; where the next
        image's search begins.

    Examples
    --------
    >>> len(Features(px=np.zeros((2, 2)), level=[0, 1], score=[9.0, 4.0]))
    2
    """

    px: npt.NDArray[np.float32]
    level: npt.NDArray[np.int8]
    score: npt.NDArray[np.float32]
    thresholds: npt.NDArray[np.float32] = field(default_factory=_no_thresholds)

    def __post_init__(self) -> None:
        object.__setattr__(self, "px", frozen_as(self.px, (-1, 2), "px", np.float32))
        object.__setattr__(self, "level", frozen_as(self.level, (-1,), "level", np.int8))
        object.__setattr__(self, "score", frozen_as(self.score, (-1,), "score", np.float32))
        object.__setattr__(self, "thresholds", frozen_as(self.thresholds, (-1,), "thresholds", np.float32))
        _same_length(px=self.px, level=self.level, score=self.score)

    def __len__(self) -> int:
        return len(self.px)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Keyframe:
    """One frame kept for triangulation: its pose ``x_i`` and its corners ``k_i`` (equation 3).

    Parameters
    ----------
    stamp_ns : int
        Stamp of the frame.
    T_odom_cam : SE3
        Pose of the camera, as the odometry claims it.
    px : array (N, 2), float32
        Corners, full-resolution pixels.
    level : array (N,), int8
        Their pyramid levels.
    track : array (N,), int64
        Identity of the scene point: equal in every keyframe that saw it.

    Examples
    --------
    >>> keyframe = Keyframe(stamp_ns=0, T_odom_cam=SE3.identity(), px=np.zeros((1, 2)), level=[0], track=[7])
    >>> keyframe.track.tolist()
    [7]
    """

    stamp_ns: int
    T_odom_cam: SE3
    px: npt.NDArray[np.float32]
    level: npt.NDArray[np.int8]
    track: npt.NDArray[np.int64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "px", frozen_as(self.px, (-1, 2), "px", np.float32))
        object.__setattr__(self, "level", frozen_as(self.level, (-1,), "level", np.int8))
        object.__setattr__(self, "track", frozen_as(self.track, (-1,), "track", np.int64))
        _same_length(px=self.px, level=self.level, track=self.track)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapPoints:
    """Triangulated scene points, ``M_t`` of equation (3).

    Parameters
    ----------
    position_m : array (N, 3)
        In odom coordinates.
    level : array (N,), int8
        Pyramid level on which the point was last seen by a keyframe.
    distance_m : array (N,)
        Its distance from that keyframe: with `level`, tells the level at which to expect it now.

    Examples
    --------
    >>> len(MapPoints(position_m=[[0.0, 0.0, 9.0]], level=[0], distance_m=[9.0]))
    1
    """

    position_m: FloatArray
    level: npt.NDArray[np.int8]
    distance_m: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_m", frozen(self.position_m, (-1, 3), "position_m"))
        object.__setattr__(self, "level", frozen_as(self.level, (-1,), "level", np.int8))
        object.__setattr__(self, "distance_m", frozen(self.distance_m, (-1,), "distance_m"))
        _same_length(position_m=self.position_m, level=self.level, distance_m=self.distance_m)

    def __len__(self) -> int:
        return len(self.position_m)
