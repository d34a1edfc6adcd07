"""Who agrees on a motion, and how sure that makes it.

Not all corners that are off the motion of the scene speak against it. Traffic along the robot's own course, and posts
that were taken for the next ones, lie on their epipolar lines (`RelativePose.neutral`): they deny the length of the
translation, and which way it points, but neither the rotation nor the direction.
"""

from __future__ import annotations

import math

import numpy as np

from belie.geometry import CameraModel, FloatArray
from belie.odometry.relative_pose import RelativePose

KNOWN_RAD = 0.1  # of a direction: depths by it are right to a tenth
MAJORITY = 0.6  # a little above the breakdown point: with fewer, the motion may be that of a passing lorry


def agreement(pose: RelativePose) -> float:
    """Share of the points that move with the scene, of all that say anything of rotation and direction."""
    return float(pose.inliers.sum()) / max(len(pose.chi2) - int(pose.neutral.sum()), 1)


def tells_which_way(pose: RelativePose) -> bool:
    """Whether enough points agree on a direction, and most of those with parallax on which way along it."""
    ahead = int((pose.inliers & (pose.inverse_depth > 3.0 * np.sqrt(pose.inverse_depth_variance))).sum())
    most = MAJORITY * (ahead + int(pose.neutral.sum()))
    return agreement(pose) >= MAJORITY and ahead >= most


def stretched(covariance: FloatArray, pose: RelativePose, sureness: float) -> FloatArray:
    """The covariance, with the length of the translation surer by no more than those who agree on it."""
    t = pose.T_cur_prev.t
    along = np.concatenate([t / max(float(np.linalg.norm(t)), 1e-12), np.zeros(3)])
    more = (sureness / sureness_of(float(pose.inliers.mean()))) ** 2 - 1.0
    return covariance + more * float(along @ covariance @ along) * np.outer(along, along)


def sureness_of(agreeing: float) -> float:
    """The bias of a robust estimate grows with the share ε of outliers as 1 / (1 - 2ε) (Huber 1981, ch. 4)."""
    return max(2.0 * agreeing - 1.0, 0.05)


def direction_error(pose: RelativePose, covariance: FloatArray) -> float:
    """Standard deviation of the direction of the translation, both ways across together, rad; covariance (6, 6)."""
    t, C = pose.T_cur_prev.t, covariance[:3, :3]
    length2 = max(float(t @ t), 1e-30)
    return math.sqrt(max(float(np.trace(C)) - float(t @ C @ t) / length2, 0.0) / length2)


def extent(px: FloatArray, camera: CameraModel) -> float:
    """Share of the image's width or height, whichever is more, that the middle half of some corners spans, (N, 2).

    >>> camera = CameraModel(width=100, height=100, fx=100, fy=100, cx=49.5, cy=49.5)
    >>> extent(np.column_stack([np.arange(41.0), np.zeros(41)]), camera)
    0.2
    """
    ordered = np.sort(px, axis=0)
    low, high = ordered[(len(px) - 1) // 4], ordered[3 * (len(px) - 1) // 4]
    return float(np.max((high - low) / (camera.width, camera.height)))
