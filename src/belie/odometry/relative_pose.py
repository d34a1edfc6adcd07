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
from typing import Any

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, FloatArray, compiled

_OUTER_ITERATIONS = 8
_WIDE = 512.0  # times the kernel: 68 sigma, 7 px for corners tracked to 0.1 px
_INNER_ITERATIONS = 5
_SETTLED = 1e-4  # squared length of a step in its own standard errors: a hundredth of one
_LENGTH_ITERATIONS = 3
_HEARD = 0.5  # of what two images say against the map: as many errors are theirs as the map's
_NEAR = 1e-3  # smallest Z_cur / Z_prev that is still in front of the camera
_TRAFFIC_CHI2 = 4.0  # -2 log of the chance that a corner is one of traffic along the road: one in seven
KERNEL_CHI2 = 9.0  # the kernel's half-way point: a 3-sigma error


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


@compiled()
def _cholesky_solve(A: npt.NDArray[np.float64], b: npt.NDArray[np.float64], n: int) -> bool:
    """Solve A x = b in place (A lower factor, b solution); False if A is not positive definite."""
    for i in range(n):
        for j in range(i + 1):
            s = A[i, j]
            for k in range(j):
                s -= A[i, k] * A[j, k]
            if i == j:
                if s <= 1e-300:
                    return False
                A[i, i] = np.sqrt(s)
            else:
                A[i, j] = s / A[j, j]
    for i in range(n):
        s = b[i]
        for k in range(i):
            s -= A[i, k] * b[k]
        b[i] = s / A[i, i]
    for i in range(n - 1, -1, -1):
        s = b[i]
        for k in range(i + 1, n):
            s -= A[k, i] * b[k]
        b[i] = s / A[i, i]
    return True


@compiled()
def _exp_so3(w: Any, R: Any) -> None:
    theta2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    if theta2 < 1e-16:
        a, b = 1.0, 0.5
    else:
        theta = np.sqrt(theta2)
        a = np.sin(theta) / theta
        b = (1.0 - np.cos(theta)) / theta2
    x, y, z = w[0], w[1], w[2]
    R[0, 0] = 1.0 - b * (y * y + z * z)
    R[0, 1] = -a * z + b * x * y
    R[0, 2] = a * y + b * x * z
    R[1, 0] = a * z + b * x * y
    R[1, 1] = 1.0 - b * (x * x + z * z)
    R[1, 2] = -a * x + b * y * z
    R[2, 0] = -a * y + b * x * z
    R[2, 1] = a * x + b * y * z
    R[2, 2] = 1.0 - b * (x * x + y * y)


@compiled()
def _accumulate(
    prev: Any, cur: Any, rho0: Any, var0: Any, shared: Any, rho: Any, slope: Any, R: Any, t: Any,
    variance: float, kernel: float, H: Any, g: Any,
) -> Any:  # fmt: skip
    """One pass over the points: normal equations H, g of the pose; returns the robust cost.

    The error of a point, seen from its linearisation point `rho`, is ``z - π(rho) - slope (rho0 - rho)`` with the
    covariance ``variance I + (var0 + shared / |slope|²) slope slope'``, whose inverse is
    ``(I - gain slope slope') / variance``.
    """
    H[:] = 0.0
    g[:] = 0.0
    cost = 0.0
    J = np.empty((2, 6))
    for i in range(prev.shape[0]):
        x, y = prev[i, 0], prev[i, 1]
        q = rho[i]
        d = max(R[2, 0] * x + R[2, 1] * y + R[2, 2] + q * t[2], _NEAR)
        u = (R[0, 0] * x + R[0, 1] * y + R[0, 2] + q * t[0]) / d
        v = (R[1, 0] * x + R[1, 1] * y + R[1, 2] + q * t[1]) / d
        su, sv = slope[i, 0], slope[i, 1]
        length2 = su * su + sv * sv + 1e-30
        along_var = var0[i] * length2 + shared[i]
        gain = along_var / (length2 * (variance + along_var))
        eu = cur[i, 0] - u - su * (rho0[i] - q)
        ev = cur[i, 1] - v - sv * (rho0[i] - q)
        along = (su * eu + sv * ev) * gain
        wu = (eu - su * along) / variance  # whitened twice: W e
        wv = (ev - sv * along) / variance
        e2 = eu * wu + ev * wv
        k = kernel / (kernel + e2)
        cost += e2 * k
        w = k * k
        # d(u, v) / d(translation, rotation) under exp(xi) T, for the point scaled by its inverse depth
        inv = q / d
        J[0, 0] = inv
        J[0, 1] = 0.0
        J[0, 2] = -u * inv
        J[0, 3] = -u * v
        J[0, 4] = 1.0 + u * u
        J[0, 5] = -v
        J[1, 0] = 0.0
        J[1, 1] = inv
        J[1, 2] = -v * inv
        J[1, 3] = -(1.0 + v * v)
        J[1, 4] = u * v
        J[1, 5] = u
        w_variance = w / variance
        for a in range(6):
            g[a] += w * (J[0, a] * wu + J[1, a] * wv)
            h_a = (J[0, a] * su + J[1, a] * sv) * gain
            ja0 = (J[0, a] - h_a * su) * w_variance
            ja1 = (J[1, a] - h_a * sv) * w_variance
            for b in range(a + 1):
                H[a, b] += ja0 * J[0, b] + ja1 * J[1, b]
    return cost


@compiled()
def _update_depths(
    prev: Any, cur: Any, rho0: Any, var0: Any, R: Any, t: Any, variance: float,
    rho: Any, rho_var: Any, slope: Any, chi2: Any,
) -> None:  # fmt: skip
    """Posterior inverse depth of every point given the motion; its slope and whitened error there."""
    for i in range(prev.shape[0]):
        x, y = prev[i, 0], prev[i, 1]
        r0 = R[0, 0] * x + R[0, 1] * y + R[0, 2]
        r1 = R[1, 0] * x + R[1, 1] * y + R[1, 2]
        r2 = R[2, 0] * x + R[2, 1] * y + R[2, 2]
        q = rho0[i]
        information0 = 1.0 / var0[i]
        information = information0
        e2 = 0.0
        su = 0.0
        sv = 0.0
        for iteration in range(4):  # Gauss-Newton in one unknown; the last pass only evaluates
            d = max(r2 + q * t[2], _NEAR)
            u = (r0 + q * t[0]) / d
            v = (r1 + q * t[1]) / d
            su = (t[0] - u * t[2]) / d
            sv = (t[1] - v * t[2]) / d
            eu = cur[i, 0] - u
            ev = cur[i, 1] - v
            information = information0 + (su * su + sv * sv) / variance
            e2 = (eu * eu + ev * ev) / variance + (rho0[i] - q) ** 2 * information0
            if iteration < 3:
                q += ((su * eu + sv * ev) / variance + (rho0[i] - q) * information0) / information
                q = max(q, 0.0)  # nothing is behind infinity
        rho[i] = q
        rho_var[i] = 1.0 / information
        slope[i, 0] = su
        slope[i, 1] = sv
        chi2[i] = e2


def _across2(
    previous: FloatArray, current: FloatArray, R: FloatArray, t: FloatArray, sigma: float
) -> FloatArray:
    """Squared distances (N,) from the epipolar lines, in units of sigma²."""
    if not t.any():
        return np.full(len(previous), np.inf)
    rays = np.column_stack([previous, np.ones(len(previous))]) @ R.T
    line = np.cross(t, rays)
    off = line[:, 0] * current[:, 0] + line[:, 1] * current[:, 1] + line[:, 2]
    return np.asarray(off**2 / np.maximum((line[:, :2] ** 2).sum(axis=1), 1e-30) / sigma**2)


@compiled()
def _levenberg_marquardt(
    prev: Any, cur: Any, rho0: Any, var0: Any, shared: Any, R: Any, t: Any, variance: float, fix_length: bool
) -> Any:
    """Refine R, t in place; returns H, depths, their variances and the whitened errors."""
    n = prev.shape[0]
    H = np.zeros((6, 6))
    g = np.zeros(6)
    A = np.zeros((6, 6))
    step = np.zeros(6)
    slope = np.empty((n, 2))
    rho = np.empty(n)
    rho_var = np.empty(n)
    chi2 = np.empty(n)
    dR = np.empty((3, 3))
    R_new = np.empty((3, 3))
    t_new = np.empty(3)
    first = True
    kernel = KERNEL_CHI2
    for _outer in range(_OUTER_ITERATIONS):
        # The covariance of each point is held while the pose moves: were it part of the cost, a longer
        # translation would make every error look more likely, and the scale would creep upwards.
        _update_depths(prev, cur, rho0, var0, R, t, variance, rho, rho_var, slope, chi2)
        if first:
            # Far from the minimum most points look like outliers: begin with a wide kernel, narrow it step by step.
            agreeing = 0
            for i in range(n):
                agreeing += chi2[i] < KERNEL_CHI2
            kernel = KERNEL_CHI2 if 2 * agreeing > n else _WIDE * KERNEL_CHI2
            first = False
        else:
            kernel = max(kernel / 8.0, KERNEL_CHI2)
        cost = _accumulate(prev, cur, rho0, var0, shared, rho, slope, R, t, variance, kernel, H, g)
        damping = 1e-5
        length = np.sqrt(t[0] ** 2 + t[1] ** 2 + t[2] ** 2)
        moved = 0.0
        for _ in range(_INNER_ITERATIONS):
            for a in range(6):  # `A[:] = H` would compile the text of its error too: 3 s
                step[a] = g[a]
                for b in range(6):
                    A[a, b] = H[a, b]
            if fix_length:  # a heavy prior along t keeps its length
                heavy = 0.0
                for a in range(6):
                    heavy = max(heavy, H[a, a])
                for a in range(3):
                    for b in range(a + 1):
                        A[a, b] += 1e3 * heavy * t[a] * t[b] / (length * length)
            for a in range(6):
                A[a, a] += damping * A[a, a] + 1e-12
            if not _cholesky_solve(A, step, 6):
                damping *= 10.0
                continue
            size = 0.0  # squared, in standard errors: step' H step, Newton's decrement
            for a in range(6):
                size += step[a] * g[a]
            if size < (_SETTLED if kernel <= KERNEL_CHI2 else 1.0):  # under a wide kernel it only has to come near
                break
            _exp_so3(step[3:], dR)
            for a in range(3):
                for b in range(3):
                    R_new[a, b] = dR[a, 0] * R[0, b] + dR[a, 1] * R[1, b] + dR[a, 2] * R[2, b]
                t_new[a] = dR[a, 0] * t[0] + dR[a, 1] * t[1] + dR[a, 2] * t[2] + step[a]
            if fix_length:
                norm = np.sqrt(t_new[0] ** 2 + t_new[1] ** 2 + t_new[2] ** 2)
                for a in range(3):
                    t_new[a] *= length / norm
            new_cost = _accumulate(
                prev, cur, rho0, var0, shared, rho, slope, R_new, t_new, variance, kernel, A, step
            )
            if new_cost < cost:
                for a in range(3):
                    t[a] = t_new[a]
                    for b in range(3):
                        R[a, b] = R_new[a, b]
                H, A = A, H
                g, step = step, g
                cost = new_cost
                moved += size
                damping = max(damping * 0.1, 1e-9)
            else:
                damping = max(damping * 10.0, 1e-4)
                if damping > 1e4:
                    break
        if kernel <= KERNEL_CHI2 and moved < _SETTLED:
            break
    _update_depths(prev, cur, rho0, var0, R, t, variance, rho, rho_var, slope, chi2)
    for a in range(6):
        for b in range(a + 1, 6):
            H[a, b] = H[b, a]
    return H, rho, rho_var, chi2


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
    R = np.array(T_cur_prev.R)
    t = np.array(T_cur_prev.t)
    shared = calibration_error**2 * ((current - previous) ** 2).sum(axis=1)
    H, rho, rho_var, chi2 = _levenberg_marquardt(
        np.ascontiguousarray(previous), np.ascontiguousarray(current), inverse_depth, inverse_depth_variance,
        shared, R, t, sigma * sigma, fix_length,
    )  # fmt: skip
    if fix_length:  # one length of the translation is as good as another
        H = H + np.outer(np.r_[t, 0, 0, 0], np.r_[t, 0, 0, 0]) / float(t @ t) ** 2
    return RelativePose(
        T_cur_prev=SE3(R, t),
        covariance=covariance_of(H),
        inverse_depth=rho,
        inverse_depth_variance=rho_var,
        chi2=chi2,
        across2=_across2(previous, current, R, t, sigma),
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
    seen = estimate_relative_pose(
        previous, current, pose.inverse_depth, wide, T, sigma=sigma, fix_length=True
    ).T_cur_prev  # fmt: skip
    seen = SE3.exp(_HEARD * (seen @ T.inverse()).log()) @ T
    rotated = np.column_stack([previous, np.ones(len(previous))]) @ seen.R.T
    shared = calibration_error**2 * ((current - previous) ** 2).sum(axis=1)
    t = seen.t
    for _ in range(_LENGTH_ITERATIONS):
        p = rotated + inverse_depth[:, None] * t
        d = np.maximum(p[:, 2:], _NEAR)
        slope = (t[:2] - p[:, :2] / d * t[2]) / d
        by_length = inverse_depth[:, None] * slope  # per share of the length
        along = (slope * slope).sum(axis=1)
        weight = pose.weight / (sigma**2 + inverse_depth_variance * along + shared)
        told = float(weight @ (by_length * by_length).sum(axis=1))
        if told <= 0.0:
            return pose
        share = float(weight @ (by_length * (current - p[:, :2] / d)).sum(axis=1)) / told
        t = t * (1.0 + min(max(share, -0.5), 0.5))
    n = len(previous)
    rho, rho_var, slope, _chi2 = np.empty(n), np.empty(n), np.empty((n, 2)), np.empty(n)
    _update_depths(
        np.ascontiguousarray(previous), np.ascontiguousarray(current), inverse_depth, inverse_depth_variance,
        np.array(seen.R), np.array(t), sigma * sigma, rho, rho_var, slope, _chi2,
    )  # fmt: skip
    # Which corners move as one is told by the motion that fits them all best, bent or not.
    return RelativePose(
        T_cur_prev=SE3(seen.R, t),
        covariance=pose.covariance,
        inverse_depth=rho,
        inverse_depth_variance=rho_var,
        chi2=pose.chi2,
        across2=_across2(previous, current, seen.R, t, sigma),
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
