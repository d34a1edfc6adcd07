"""Θ of equation (6), default profile: the camera's motion from tracked corners, without any claim.

Minimises over the motion ``T_cur_prev = (R, t)``

    sum_i  φ( e_i' S_i⁻¹ e_i ),   e_i = z_i - π(R a_i + ρ_i t),   S_i = σ² I + σ_ρi² s_i s_i'

with ``a_i = (x, y, 1)`` the corner in the previous frame, ``z_i`` its tracked position in the current one, (ρ, σ_ρ)
what earlier frames told of its inverse depth, and ``s = dπ/dρ`` the direction of its epipolar line. The depth is
thereby marginalised: a point of unknown depth contributes its epipolar constraint, a point of known depth its full
reprojection error, and everything between its due. φ is the Geman-McClure kernel: points that move on their own
lose their say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, FloatArray
from belie.odometry.motion_fit import KERNEL_CHI2, across_lines, fit_length, fit_motion, update_depths

_HEARD = 0.5  # of what two images say against the map: as many errors are theirs as the map's
_TRAFFIC_CHI2 = 4.0  # -2 log of the chance that a corner is one of traffic along the road: one in seven


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RelativePose:
    """Motion between two frames, with the inverse depths that it implies.

    Parameters
    ----------
    T_cur_prev : SE3
        Maps previous to current camera coordinates; translation in map units.
    covariance : array (6, 6)
        Of the left-hand perturbation ``exp(xi) T_cur_prev``, translation first.
    inverse_depth, inverse_depth_variance : array (N,)
        Posterior, in the previous frame.
    chi2 : array (N,)
        Whitened squared error of each point.
    across2 : array (N,)
        The part of it across the epipolar line, whatever the depth.
    """

    T_cur_prev: SE3
    covariance: FloatArray
    inverse_depth: FloatArray
    inverse_depth_variance: FloatArray
    chi2: FloatArray
    across2: FloatArray

    @property
    def inliers(self) -> npt.NDArray[np.bool_]:
        """Points within three sigma of the motion."""
        return np.asarray(self.chi2 < KERNEL_CHI2)

    @property
    def neutral(self) -> npt.NDArray[np.bool_]:
        """Points off the motion but on their epipolar lines, shape (N,).

        Traffic along the robot's own course, and posts mistaken for the next ones: they neither move with the scene nor
        speak against the rotation and the direction.
        """
        return np.asarray(~self.inliers & (self.across2 < KERNEL_CHI2))

    @property
    def weight(self) -> FloatArray:
        """What the robust kernel left of each point's say, 0 to 1, shape (N,)."""
        return np.asarray((KERNEL_CHI2 / (KERNEL_CHI2 + self.chi2)) ** 2)


def estimate_relative_pose(
    previous: FloatArray,
    current: FloatArray,
    inverse_depth: FloatArray,
    inverse_depth_variance: FloatArray,
    T_cur_prev: SE3,
    *,
    sigma: float,
    calibration_error: float = 0.0,
    fix_length: bool = False,
) -> RelativePose:
    """Refine the motion between two frames from tracked points.

    Parameters
    ----------
    previous, current : arrays (N, 2)
        Undistorted coordinates (X/Z, Y/Z) of the same corners in both frames.
    inverse_depth, inverse_depth_variance : arrays (N,)
        What is known of each point's 1/Z in the previous frame; a wide variance for "nothing".
    T_cur_prev : SE3
        Where to begin.
    sigma : float
        Standard deviation of a tracked position, in the same units as `current` (pixels over focal length).
    calibration_error : float
        Error of a displacement, relative to it, that a depth from earlier frames does not share with this one.
    fix_length : bool
        Keep the length of the translation: while no depth is known the scale is free.

    Returns
    -------
    RelativePose

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> points = np.column_stack([rng.uniform(-4, 4, (60, 2)), rng.uniform(5, 20, 60)])
    >>> truth = SE3.exp([0.1, 0.0, -0.8, 0.0, 0.02, 0.0])
    >>> moved = truth.apply(points)
    >>> pose = estimate_relative_pose(points[:, :2] / points[:, 2:], moved[:, :2] / moved[:, 2:],
    ...     1 / points[:, 2], np.full(60, 1e-8), SE3.identity(), sigma=1e-3)
    >>> pose.T_cur_prev.is_close(truth, 1e-6)
    True
    """
    R, t = np.array(T_cur_prev.R), np.array(T_cur_prev.t)
    previous, current = np.ascontiguousarray(previous), np.ascontiguousarray(current)
    H, rho, rho_var, chi2 = fit_motion(
        previous,
        current,
        inverse_depth,
        inverse_depth_variance,
        calibration_error**2,
        R,
        t,
        sigma**2,
        fix_length,
    )
    if fix_length:  # one length of the translation is as good as another
        H = H + np.outer(np.r_[t, 0, 0, 0], np.r_[t, 0, 0, 0]) / float(t @ t) ** 2
    return RelativePose(
        T_cur_prev=SE3(R, t),
        covariance=covariance_of(H),
        inverse_depth=rho,
        inverse_depth_variance=rho_var,
        chi2=chi2,
        across2=across_lines(previous, current, R, t, sigma**2),
    )


def straightened(
    pose: RelativePose,
    previous: FloatArray,
    current: FloatArray,
    inverse_depth: FloatArray,
    inverse_depth_variance: FloatArray,
    *,
    sigma: float,
    calibration_error: float = 0.0,
) -> RelativePose:
    """A motion that does not follow a bent map: half-way to what the two images tell by themselves.

    All depths of a map carry the errors of the motions that made them: a motion that is off bends the map, and a bent
    map calls for the same motion again. In fog, where no corner is far away, the yaw stayed off by 0.1 to 0.25 degrees
    a frame for seventy frames, although the epipolar constraints of every pair of images had it right to 0.02. The bend
    is known no better than the motions that it comes from, so map and images have an equal say in rotation and
    direction, and a bend halves where it lasted. The length is then read off the map anew.

    Parameters
    ----------
    pose : RelativePose
        As `estimate_relative_pose` found it with the same arguments.
    """
    T, typical = pose.T_cur_prev, float(np.median(pose.inverse_depth))
    length = float(np.linalg.norm(T.t))
    if length == 0.0 or typical == 0.0:
        return pose
    wide = np.maximum(pose.inverse_depth, typical) ** 2
    previous, current = np.ascontiguousarray(previous), np.ascontiguousarray(current)
    R, t = np.array(T.R), np.array(T.t)
    fit_motion(previous, current, pose.inverse_depth, wide, 0.0, R, t, sigma**2, True)
    heard = SE3.exp(_HEARD * (SE3(R, t) @ T.inverse()).log()) @ T
    R, t = np.array(heard.R), np.array(heard.t)
    if not fit_length(
        previous,
        current,
        inverse_depth,
        inverse_depth_variance,
        pose.weight,
        calibration_error**2,
        R,
        t,
        sigma**2,
    ):
        return pose
    n = len(previous)
    rho, rho_var, slope, _chi2 = np.empty(n), np.empty(n), np.empty((n, 2)), np.empty(n)
    update_depths(
        previous, current, inverse_depth, inverse_depth_variance, R, t, sigma**2, rho, rho_var, slope, _chi2
    )
    # Which corners move as one is told by the motion that fits them all best, bent or not.
    return RelativePose(
        T_cur_prev=SE3(R, t),
        covariance=pose.covariance,
        inverse_depth=rho,
        inverse_depth_variance=rho_var,
        chi2=pose.chi2,
        across2=across_lines(previous, current, R, t, sigma**2),
    )


def robust_cost(pose: RelativePose) -> float:
    """What the corners say against a motion: their chi2, each no more than that of an outlier."""
    return float(np.minimum(pose.chi2, KERNEL_CHI2).sum())


def direction_cost(pose: RelativePose) -> float:
    """What they say against its rotation and direction: a neutral one no more than that it must be traffic.

    For a motion that nothing is known of. Along a road, where a third of the corners is traffic, another motion can be
    found that has more corners before the camera and fewer on their lines; past a wall, one that has them all on their
    lines and half of them behind infinity.
    """
    excused = pose.across2 + _TRAFFIC_CHI2
    return float(np.minimum(np.where(pose.neutral, excused, pose.chi2), KERNEL_CHI2).sum())


def covariance_of(H: FloatArray) -> FloatArray:
    """Inverse of an information matrix, symmetric and positive definite whatever its condition.

    A direction that no point sees gets a huge, finite variance. Rows are brought to one scale first: rad and map
    units may lie twelve powers of ten apart, and an inverse taken across them can come out indefinite.

    >>> float(covariance_of(np.diag([4.0, 0, 0, 1, 1, 1]))[0, 0].round(3))
    0.25
    >>> bool(np.linalg.eigvalsh(covariance_of(np.ones((6, 6))))[0] > 0.0)
    True
    """
    information = 0.5 * (H + H.T) + 1e-6 * np.eye(6)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-6))
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    half = scale[:, None] * vectors / np.sqrt(np.maximum(values, 1e-12))
    return np.asarray(half @ half.T)
