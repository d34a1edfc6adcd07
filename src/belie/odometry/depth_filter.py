"""Γ of equation (3), default profile: the inverse depth of every tracked corner, sharpened frame by frame.

Each corner carries a Gaussian over its inverse depth (Civera, Davison and Montiel, "Inverse Depth
Parametrization for Monocular SLAM", 2008), in the camera frame of the latest image and in the map's unit.
The claims never enter: the map is the images' own.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, FloatArray
from belie.odometry.relative_pose import RelativePose

_UNKNOWN = 10.0  # standard deviation of an unknown inverse depth, in typical inverse depths of the scene
_NEAREST = 0.02  # a point nearer than this share of the scene's median depth is behind or inside the camera


@dataclass(slots=True)
class TrackedCorners:
    """The local map of the default profile: corners that are being followed, with their inverse depths.

    px : (N, 2) in the latest image (working resolution); inverse_depth, variance : (N,) in map units;
    age : (N,) frames seen.
    """

    px: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    inverse_depth: FloatArray = field(default_factory=lambda: np.empty(0))
    variance: FloatArray = field(default_factory=lambda: np.empty(0))
    age: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    def __len__(self) -> int:
        return len(self.px)

    def keep(self, chosen: npt.NDArray[np.bool_]) -> None:
        """Forget all corners but the chosen ones."""
        self.px = self.px[chosen]
        self.inverse_depth = self.inverse_depth[chosen]
        self.variance = self.variance[chosen]
        self.age = self.age[chosen]

    def add(self, px: npt.NDArray[np.floating], typical: float) -> None:
        """Follow new corners, whose depth is unknown; `typical` is the scene's usual inverse depth."""
        n = len(px)
        self.px = np.concatenate([self.px, px])
        self.inverse_depth = np.concatenate([self.inverse_depth, np.full(n, typical)])
        self.variance = np.concatenate([self.variance, np.full(n, (_UNKNOWN * typical) ** 2)])
        self.age = np.concatenate([self.age, np.zeros(n, dtype=np.int64)])

    def typical_inverse_depth(self) -> float:
        """Median over the corners whose depth is known to a third, or over all where none is."""
        known = self.variance < (0.3 * self.inverse_depth) ** 2
        chosen = self.inverse_depth[known] if known.sum() >= 8 else self.inverse_depth
        return float(np.median(chosen)) if len(chosen) else 1.0

    def predict(self, rays: FloatArray, T_cur_prev: SE3) -> FloatArray:
        """Rays (x, y, 1), shape (N, 3), of the corners after the motion, up to length (equations 4 and 5)."""
        return np.asarray(rays @ T_cur_prev.R.T + self.inverse_depth[:, None] * T_cur_prev.t)

    def advance(
        self, rays: FloatArray, pose: RelativePose, found_px: FloatArray, drift: float
    ) -> npt.NDArray[np.bool_]:
        """Take over the new positions and depths; returns which corners still make sense.

        `drift` is the relative standard deviation that a depth gains a frame: what the errors that neighbouring
        corners share (calibration, rolling shutter) add, which no averaging removes.
        """
        rotated_z = rays @ pose.T_cur_prev.R[2]
        depth_ratio = rotated_z + pose.inverse_depth * pose.T_cur_prev.t[2]  # Z_cur / Z_prev
        sane = depth_ratio > _NEAREST
        depth_ratio = np.where(sane, depth_ratio, 1.0)
        self.inverse_depth = pose.inverse_depth / depth_ratio
        self.variance = (
            pose.inverse_depth_variance * (rotated_z / depth_ratio**2) ** 2
            + (drift * self.inverse_depth) ** 2
        )
        self.px = found_px
        self.age = self.age + 1
        return np.asarray(sane)
