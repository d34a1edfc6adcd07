"""Hot loops of Θ, equation (6), default profile: Levenberg-Marquardt over the motion between two images, compiled.

What is minimised is told in `relative_pose.py`. Arrays `prev`, `cur` (N, 2) are undistorted coordinates; `rho0`, `var0`
(N,) what is known of the inverse depths in the previous frame; `variance` is that of a tracked position, `calibration2`
the square of the error that calibration causes, relative to a displacement; R, t are those of ``T_cur_prev``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from belie.geometry import compiled
from belie.odometry.cholesky import solve_cholesky_6

_OUTER_ITERATIONS = 8
_WIDE = 512.0  # times the kernel: 68 sigma, 7 px for corners tracked to 0.1 px
_INNER_ITERATIONS = 5
_SETTLED = 1e-4  # squared length of a step in its own standard errors: a hundredth of one
_LENGTH_ITERATIONS = 3
_NEAR = 1e-3  # smallest Z_cur / Z_prev that is still in front of the camera
KERNEL_CHI2 = 9.0  # the kernel's half-way point: a 3-sigma error


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
def pose_jacobian(u: float, v: float, inv: float, J: Any) -> None:
    """d(u, v) / d(translation, rotation) under exp(xi) T, shape (2, 6), of a point with the inverse depth `inv`."""
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


@compiled()
def _accumulate(
    prev: Any, cur: Any, rho0: Any, var0: Any, calibration2: float, rho: Any, slope: Any, R: Any, t: Any,
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
        shared = calibration2 * ((cur[i, 0] - x) ** 2 + (cur[i, 1] - y) ** 2)
        along_var = var0[i] * length2 + shared
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
        pose_jacobian(u, v, q / d, J)
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
def update_depths(
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


@compiled()
def across_lines(prev: Any, cur: Any, R: Any, t: Any, variance: float) -> Any:
    """Squared distances (N,) from the epipolar lines, in units of `variance`; infinite without a translation."""
    n = prev.shape[0]
    off2 = np.empty(n)
    still = t[0] == 0.0 and t[1] == 0.0 and t[2] == 0.0
    for i in range(n):
        x, y = prev[i, 0], prev[i, 1]
        r0 = R[0, 0] * x + R[0, 1] * y + R[0, 2]
        r1 = R[1, 0] * x + R[1, 1] * y + R[1, 2]
        r2 = R[2, 0] * x + R[2, 1] * y + R[2, 2]
        a, b, c = t[1] * r2 - t[2] * r1, t[2] * r0 - t[0] * r2, t[0] * r1 - t[1] * r0
        off = a * cur[i, 0] + b * cur[i, 1] + c
        off2[i] = np.inf if still else off * off / max(a * a + b * b, 1e-30) / variance
    return off2


@compiled()
def fit_length(
    prev: Any,
    cur: Any,
    rho0: Any,
    var0: Any,
    weight: Any,
    calibration2: float,
    R: Any,
    t: Any,
    variance: float,
) -> bool:
    """Stretch t, in place, until it fits the depths; False where they say nothing of its length."""
    for _ in range(_LENGTH_ITERATIONS):
        told = 0.0
        wanted = 0.0
        for i in range(prev.shape[0]):
            x, y, q = prev[i, 0], prev[i, 1], rho0[i]
            d = max(R[2, 0] * x + R[2, 1] * y + R[2, 2] + q * t[2], _NEAR)
            u = (R[0, 0] * x + R[0, 1] * y + R[0, 2] + q * t[0]) / d
            v = (R[1, 0] * x + R[1, 1] * y + R[1, 2] + q * t[1]) / d
            su, sv = (t[0] - u * t[2]) / d, (t[1] - v * t[2]) / d
            along = su * su + sv * sv
            shared = calibration2 * ((cur[i, 0] - x) ** 2 + (cur[i, 1] - y) ** 2)
            w = weight[i] * q / (variance + var0[i] * along + shared)
            told += w * q * along
            wanted += w * (su * (cur[i, 0] - u) + sv * (cur[i, 1] - v))
        if told <= 0.0:
            return False
        stretch = 1.0 + min(max(wanted / told, -0.5), 0.5)
        for k in range(3):
            t[k] *= stretch
    return True


@compiled()
def fit_motion(
    prev: Any,
    cur: Any,
    rho0: Any,
    var0: Any,
    calibration2: float,
    R: Any,
    t: Any,
    variance: float,
    fix_length: bool,
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
        update_depths(prev, cur, rho0, var0, R, t, variance, rho, rho_var, slope, chi2)
        if first:
            # Far from the minimum most points look like outliers: begin with a wide kernel, narrow it step by step.
            agreeing = 0
            for i in range(n):
                agreeing += chi2[i] < KERNEL_CHI2
            kernel = KERNEL_CHI2 if 2 * agreeing > n else _WIDE * KERNEL_CHI2
            first = False
        else:
            kernel = max(kernel / 8.0, KERNEL_CHI2)
        cost = _accumulate(prev, cur, rho0, var0, calibration2, rho, slope, R, t, variance, kernel, H, g)
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
            if not solve_cholesky_6(A, step):
                damping *= 10.0
                continue
            size = 0.0  # squared, in standard errors: step' H step, Newton's decrement
            for a in range(6):
                size += step[a] * g[a]
            if size < (
                _SETTLED if kernel <= KERNEL_CHI2 else 1.0
            ):  # under a wide kernel it only has to come near
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
                prev, cur, rho0, var0, calibration2, rho, slope, R_new, t_new, variance, kernel, A, step
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
    update_depths(prev, cur, rho0, var0, R, t, variance, rho, rho_var, slope, chi2)
    for a in range(6):
        for b in range(a + 1, 6):
            H[a, b] = H[b, a]
    return H, rho, rho_var, chi2
