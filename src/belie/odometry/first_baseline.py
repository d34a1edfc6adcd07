"""The first baseline: from the motion since an anchor image to a map, where the two images tell enough to make one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from belie.geometry import SE3, FloatArray
from belie.odometry.agreement import KNOWN_RAD, agreement, direction_error, sureness_of, tells_which_way
from belie.odometry.plane_ambiguity import is_another, is_refuted, motions_of_plane
from belie.odometry.pose_covariance import PoseCovariance
from belie.odometry.relative_pose import RelativePose, direction_cost, estimate_relative_pose
from belie.odometry.two_view import relative_pose_from_scratch

UNKNOWN_DEPTH = 10.0  # standard deviation of an inverse depth of which nothing is known, in typical ones
_LEAST_CORNERS = 18  # six unknowns of motion and scale, robustly: three corners for each
_NEAREST = 0.02  # of its depth then: a corner that came nearer has passed


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FirstBaseline:
    """What two images tell that nothing is known of yet.

    Parameters
    ----------
    pose : RelativePose
        The motion that fits best.
    other : RelativePose or None
        The other one that a plane allows, where these two images do not refute it.
    makes_a_map : bool
        Whether enough corners agree, on which way along the direction too, and know it well: its error would be in
        every depth.
    """

    pose: RelativePose
    other: RelativePose | None
    makes_a_map: bool


def first_baseline(
    anchor: FloatArray, current: FloatArray, sigma: float, parallax: float, length: float
) -> FirstBaseline | None:
    """The motion between two images; None where no motion explains them.

    Parameters
    ----------
    anchor, current : arrays (N, 2)
        Undistorted coordinates (X/Z, Y/Z) of the same corners in both.
    sigma : float
        Of a tracked position, in the same units.
    parallax : float
        Typical, rotation removed, in the same units.
    length : float
        What the translation is to be long, map units.
    """
    scratch = relative_pose_from_scratch(anchor, current, sigma)
    if scratch is None:
        return None
    typical = np.full(len(current), max(parallax / length, 1e-9))

    def polished(start: SE3) -> RelativePose:
        return estimate_relative_pose(
            anchor, current, typical, (UNKNOWN_DEPTH * typical) ** 2, start, sigma=sigma, fix_length=True
        )

    pose = polished(SE3(scratch.R, scratch.t * length))
    found = [pose, *(polished(start) for start in motions_of_plane(anchor, pose))]
    found.sort(key=direction_cost)
    pose = found[0]
    others = (other for other in found[1:] if is_another(pose, other) and not is_refuted(pose, other))
    return FirstBaseline(
        pose=pose, other=next(others, None), makes_a_map=_makes_a_map(anchor, current, pose, sigma)
    )


def _makes_a_map(anchor: FloatArray, current: FloatArray, pose: RelativePose, sigma: float) -> bool:
    if int(pose.inliers.sum()) < _LEAST_CORNERS or not tells_which_way(pose):
        return False
    covariance = PoseCovariance(1).update(anchor, current, pose, sigma) / sureness_of(agreement(pose)) ** 2
    return direction_error(pose, covariance) < KNOWN_RAD


def depths_after(
    since_anchor: RelativePose, anchor: FloatArray, rays: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Inverse depths and variances now, as `advance` will expect them in the previous frame under (R, 0)."""
    T = since_anchor.T_cur_prev
    z_ratio = anchor @ T.R[2, :2] + T.R[2, 2] + since_anchor.inverse_depth * T.t[2]
    z_ratio = np.where(z_ratio > _NEAREST, z_ratio, np.nan)
    turned = rays @ R[2]
    return (
        np.nan_to_num(since_anchor.inverse_depth / z_ratio * turned, nan=-1.0),
        since_anchor.inverse_depth_variance * np.nan_to_num(turned / z_ratio, nan=1.0) ** 2,
    )
