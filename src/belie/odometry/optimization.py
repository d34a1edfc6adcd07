"""Θ of equation (6): the camera pose that fits all pairs best, and the mean error ``e^G`` that remains.

Levenberg-Marquardt over the six parameters of the pose, with a Huber kernel, as ORB-SLAM does with g2o:

    min over T_odom_cam of  sum_i  huber( |z_i - π(T_odom_cam⁻¹ X_i)|² / σ_i² ),   σ_i = scale of level i

The step is a right-hand perturbation ``T_odom_cam exp(xi)``, translation first. The error that is reported is
the plain mean of ``|z_i - ẑ_i|² / σ_i²`` (g2o's chi2) over *all* pairs at the optimum: the kernel guides the
pose, it does not embellish the error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydantic import Field

from belie.geometry import SE3, CameraModel, FloatArray, flat_camera, huber_cost, huber_weight
from belie.geometry.compiled import compiled
from belie.geometry.projection import project_normalized
from belie.types import Settings, frozen


class OptimizationSettings(Settings):
    """Levenberg-Marquardt of equation (6).

    >>> OptimizationSettings().max_iterations
    20
    """

    huber_sigma: float = Field(
        2.447,
        gt=0.0,
        description="Where a residual begins to count linearly [standard deviations]: the 95 % point of"
        " chi2 with two degrees of freedom, as in ORB-SLAM.",
    )
    max_iterations: int = Field(
        20, ge=1, le=200, description="Most accepted or refused steps [count]; five are usual."
    )
    convergence: float = Field(
        1e-7,
        gt=0.0,
        description="Relative decrease of the cost below which the pose has settled [ratio]; well within"
        " 1e-3 deg and 1 mm of the optimum.",
    )
    inlier_chi2: float = Field(
        5.991, gt=0.0, description="Squared error over level variance below which a pair agrees [px^2]."
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OptimizedPose:
    """What Θ gives.

    Parameters
    ----------
    T_odom_cam : SE3
        The pose that fits best.
    covariance : array (6, 6)
        Of the right-hand perturbation ``T_odom_cam exp(xi)``, translation first, m² and rad²: the inverse
        of the normal matrix, for corners of one pixel sigma on level 0.
    error_px2 : float
        ``e^G``: mean over all pairs of the squared reprojection error over level variance.
    chi2 : array (N,)
        The same, pair by pair; infinite where the point is behind the camera.
    predicted_px : array (N, 2)
        ẑ at the best pose; NaN where the point is not in view.
    """

    T_odom_cam: SE3
    covariance: FloatArray
    error_px2: float
    chi2: FloatArray
    predicted_px: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", frozen(self.covariance, (6, 6), "covariance"))


@compiled()
def _solve_cholesky_6(A: FloatArray, b: FloatArray, x: FloatArray) -> bool:
    """Solve ``A x = b`` in place of A; False where A is not positive definite."""
    for i in range(6):
        for j in range(i + 1):
            s = A[i, j]
            for k in range(j):
                s -= A[i, k] * A[j, k]
            if i == j:
                if s <= 1e-30:
                    return False
                A[i, i] = np.sqrt(s)
            else:
                A[i, j] = s / A[j, j]
    for i in range(6):
        s = b[i]
        for k in range(i):
            s -= A[i, k] * x[k]
        x[i] = s / A[i, i]
    for i in range(5, -1, -1):
        s = x[i]
        for k in range(i + 1, 6):
            s -= A[k, i] * x[k]
        x[i] = s / A[i, i]
    return True


@compiled()
def _retract(R: FloatArray, t: FloatArray, xi: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``(R, t) exp(xi)``."""
    wx, wy, wz = xi[3], xi[4], xi[5]
    theta2 = wx * wx + wy * wy + wz * wz
    if theta2 < 1e-12:
        a, b, c = 1.0 - theta2 / 6.0, 0.5 - theta2 / 24.0, 1.0 / 6.0 - theta2 / 120.0
    else:
        theta = np.sqrt(theta2)
        a, b = np.sin(theta) / theta, (1.0 - np.cos(theta)) / theta2
        c = (1.0 - a) / theta2
    W = np.zeros((3, 3))
    W[0, 1], W[0, 2], W[1, 2] = -wz, wy, -wx
    W[1, 0], W[2, 0], W[2, 1] = wz, -wy, wx
    R_new, t_new = np.empty((3, 3)), t.copy()
    dR, V, W2 = np.eye(3), np.eye(3), np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            W2[i, j] = W[i, 0] * W[0, j] + W[i, 1] * W[1, j] + W[i, 2] * W[2, j]
    for i in range(3):
        for j in range(3):
            dR[i, j] += a * W[i, j] + b * W2[i, j]
            V[i, j] += b * W[i, j] + c * W2[i, j]
    for i in range(3):
        for j in range(3):
            R_new[i, j] = R[i, 0] * dR[0, j] + R[i, 1] * dR[1, j] + R[i, 2] * dR[2, j]
            t_new[i] += R[i, j] * (V[j, 0] * xi[0] + V[j, 1] * xi[1] + V[j, 2] * xi[2])
    return R_new, t_new


@compiled()
def _residuals(
    flat: FloatArray,
    R: FloatArray,
    t: FloatArray,
    points: FloatArray,
    observed: FloatArray,
    inverse_variance: FloatArray,
    delta: float,
    chi2: FloatArray,
    predicted: FloatArray,
) -> float:
    """Robust cost at the pose; fills `chi2` and `predicted`. A point out of view costs infinity."""
    cost = 0.0
    for i in range(len(points)):
        dx, dy, dz = points[i, 0] - t[0], points[i, 1] - t[1], points[i, 2] - t[2]
        X = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
        Y = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
        Z = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
        u = v = np.nan
        if Z > 1e-6:
            u, v, _, _, _, _ = project_normalized(flat, X / Z, Y / Z)
        predicted[i, 0], predicted[i, 1] = u, v
        error = ((observed[i, 0] - u) ** 2 + (observed[i, 1] - v) ** 2) * inverse_variance[i]
        chi2[i] = error if error >= 0.0 else np.inf  # NaN compares false
        cost += huber_cost(chi2[i], delta)
    return cost


@compiled()
def _normal_equations(
    flat: FloatArray,
    R: FloatArray,
    t: FloatArray,
    points: FloatArray,
    observed: FloatArray,
    inverse_variance: FloatArray,
    delta: float,
    chi2: FloatArray,
    H: FloatArray,
    g: FloatArray,
) -> None:
    H[:] = 0.0
    g[:] = 0.0
    J = np.empty((2, 6))
    for i in range(len(points)):
        if not np.isfinite(chi2[i]):
            continue
        dx, dy, dz = points[i, 0] - t[0], points[i, 1] - t[1], points[i, 2] - t[2]
        X = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
        Y = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
        Z = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
        x, y, inverse_z = X / Z, Y / Z, 1.0 / Z
        u, v, ux, uy, vx, vy = project_normalized(flat, x, y)
        # d(x, y)/dX = [1 0 -x; 0 1 -y]/Z, and dX/dxi = [-I, skew(X)].
        for k in range(2):
            a, b = (ux, uy) if k == 0 else (vx, vy)
            c = -(a * x + b * y)
            J[k, 0], J[k, 1], J[k, 2] = -a * inverse_z, -b * inverse_z, -c * inverse_z
            J[k, 3] = b - c * y
            J[k, 4] = c * x - a
            J[k, 5] = a * y - b * x
        weight = inverse_variance[i] * huber_weight(chi2[i], delta)
        ru, rv = weight * (observed[i, 0] - u), weight * (observed[i, 1] - v)
        for r in range(6):
            g[r] += J[0, r] * ru + J[1, r] * rv
            j0, j1 = weight * J[0, r], weight * J[1, r]
            for c in range(6):  # all 36: constant bounds are unrolled, which beats half the work
                H[r, c] += j0 * J[0, c] + j1 * J[1, c]


@compiled()
def _levenberg_marquardt(
    flat: FloatArray,
    R: FloatArray,
    t: FloatArray,
    points: FloatArray,
    observed: FloatArray,
    inverse_variance: FloatArray,
    delta: float,
    max_iterations: int,
    convergence: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    count = len(points)
    chi2, trial_chi2 = np.empty(count), np.empty(count)
    predicted, trial_predicted = np.empty((count, 2)), np.empty((count, 2))
    H, damped = np.empty((6, 6)), np.empty((6, 6))
    g, xi = np.empty(6), np.empty(6)
    cost = _residuals(flat, R, t, points, observed, inverse_variance, delta, chi2, predicted)
    _normal_equations(flat, R, t, points, observed, inverse_variance, delta, chi2, H, g)
    damping = 1e-4
    for _ in range(max_iterations):
        for r in range(6):
            for c in range(6):
                damped[r, c] = H[r, c]
            damped[r, r] += damping * H[r, r] + 1e-12
        trial_cost = np.inf
        if _solve_cholesky_6(damped, g, xi):
            R_trial, t_trial = _retract(R, t, xi)
            trial_cost = _residuals(
                flat, R_trial, t_trial, points, observed, inverse_variance, delta, trial_chi2, trial_predicted
            )
        if trial_cost < cost or (np.isinf(cost) and np.isfinite(trial_cost)):
            settled = cost - trial_cost <= convergence * cost
            R, t, cost = R_trial, t_trial, trial_cost
            chi2, trial_chi2 = trial_chi2, chi2
            predicted, trial_predicted = trial_predicted, predicted
            _normal_equations(flat, R, t, points, observed, inverse_variance, delta, chi2, H, g)
            damping = max(damping * 0.1, 1e-12)
            if settled:
                break
        else:
            damping = max(damping * 10.0, 1e-6)
            if damping > 1e8:
                break
    return R, t, H, chi2, predicted


def _covariance(H: FloatArray) -> FloatArray:
    """Inverse of the normal matrix; directions that no pair constrains get a huge variance."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-12))
    values, vectors = np.linalg.eigh(H * np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1e-12)) @ vectors.T
    return np.asarray(inverse * np.outer(scale, scale))


def optimize_pose(
    camera: CameraModel,
    T_odom_cam: SE3,
    points_m: FloatArray,
    observed_px: npt.NDArray[np.floating],
    sigma_px: npt.NDArray[np.floating],
    settings: OptimizationSettings,
) -> OptimizedPose:
    """Pose that fits the pairs best, and what error remains: Θ of equation (6).

    Parameters
    ----------
    camera : CameraModel
    T_odom_cam : SE3
        Predicted pose, where the search begins.
    points_m : array (N, 3)
        Map points, odom coordinates.
    observed_px : array (N, 2)
        Their corners, full-resolution pixels.
    sigma_px : array (N,)
        Standard deviation of each corner: the scale of its pyramid level.
    settings : OptimizationSettings

    Returns
    -------
    OptimizedPose

    Raises
    ------
    ValueError
        With fewer than three pairs, or arrays of different lengths.

    Examples
    --------
    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> points = np.random.default_rng(0).uniform([-2, -2, 4], [2, 2, 9], (50, 3))
    >>> T_odom_cam = SE3.exp([0.1, -0.05, 0.2, 0.01, 0.02, -0.01])
    >>> observed = camera.project(T_odom_cam.inverse().apply(points))
    >>> found = optimize_pose(
    ...     camera, SE3.identity(), points, observed, np.ones(50), OptimizationSettings())
    >>> found.T_odom_cam.is_close(T_odom_cam, 1e-6), found.error_px2 < 1e-9
    (True, True)
    """
    points = np.ascontiguousarray(points_m, dtype=np.float64)
    observed = np.ascontiguousarray(observed_px, dtype=np.float64)
    sigma = np.ascontiguousarray(sigma_px, dtype=np.float64)
    if not (points.shape == (len(sigma), 3) and observed.shape == (len(sigma), 2) and len(sigma) >= 3):
        raise ValueError(
            f"a pose needs three pairs or more of equal number, got points {points.shape},"
            f" observed {observed.shape}, sigma {sigma.shape}"
        )
    R, t, H, chi2, predicted = _levenberg_marquardt(
        flat_camera(camera),
        np.array(T_odom_cam.R),
        np.array(T_odom_cam.t),
        points,
        observed,
        1.0 / sigma**2,
        settings.huber_sigma,
        settings.max_iterations,
        settings.convergence,
    )
    return OptimizedPose(
        T_odom_cam=SE3(R, t),
        covariance=_covariance(H),
        error_px2=float(chi2.mean()),
        chi2=chi2,
        predicted_px=predicted,
    )
