"""Hot loop of Θ, equation (6): Levenberg-Marquardt over one camera pose, compiled.

Residuals and Jacobians through any camera model, a Huber kernel by reweighting (as g2o does). Steps are
right-hand perturbations ``T_odom_cam exp(xi)``, translation first.
Method: Madsen, Nielsen and Tingleff, "Methods for Non-Linear Least Squares Problems" (2004).
"""

from __future__ import annotations

import numpy as np

from belie.geometry import FloatArray, huber_cost, huber_weight
from belie.geometry.compiled import compiled
from belie.geometry.projection import project_normalized
from belie.odometry.cholesky import solve_cholesky_6


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
def fit_pose(
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
    """Pose of least robust cost: rotation and translation of ``T_odom_cam``, normal matrix, chi2, ẑ.

    Parameters
    ----------
    flat : array (27,)
        Camera, from `flat_camera`.
    R, t : array (3, 3), (3,)
        ``T_odom_cam`` where the search begins.
    points, observed, inverse_variance : array (N, 3), (N, 2), (N,)
        Map points (odom), their corners (px), and 1 / σ² of each corner.
    delta : float
        Of the Huber kernel, standard deviations.
    max_iterations, convergence : int, float
        When to stop; see `OptimizationSettings`.

    Returns
    -------
    R, t, H, chi2, predicted : arrays (3, 3), (3,), (6, 6), (N,), (N, 2)

    Examples
    --------
    >>> from belie.geometry import CameraModel, flat_camera
    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> points = np.random.default_rng(0).uniform([-2, -2, 4], [2, 2, 9], (50, 3))
    >>> observed = camera.project(points - [0.1, 0.0, 0.2])
    >>> _, t, _, _, _ = fit_pose(
    ...     flat_camera(camera), np.eye(3), np.zeros(3), points, observed, np.ones(50), 2.4, 20, 1e-9)
    >>> np.allclose(t, [0.1, 0.0, 0.2], atol=1e-6)
    True
    """
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
            xi[r] = g[r]
        trial_cost = np.inf
        if solve_cholesky_6(damped, xi):
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
