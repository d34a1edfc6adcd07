"""How far a motion may be off: what two images tell of it, and how much their corners disagree in clusters.

The inverse of the information that the points give to the optimiser says too little, for two reasons. The depths
of a map all carry the errors of the motions that made them, so they are no independent witnesses of the next one:
here each point gives only what it tells with its depth hardly known, its epipolar constraint, and the map nothing
but the scale. And neighbouring corners err together (calibration, rolling shutter, fog that darkens as it nears,
things that move): so the scores of the points, ``g_i = J_i' W_i e_i``, are summed over clusters c of the image,

    C = A⁻¹ ( Σ_c g_c g_c' ) A⁻¹ B / (B - 6)

(Liang and Zeger, "Longitudinal data analysis using generalized linear models", 1986), which needs no model of how
they err together. A is how the scores change with the motion. A robust kernel's do so by ψ', not by its weight ψ/r
(Huber, *Robust Statistics*, 1981, ch. 7): ``A = s H``, with s the mean of ψ' over the mean of ψ/r, 0.75 in good
pictures and less where many corners are half-way out.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from belie.geometry import FloatArray, compiled
from belie.odometry.motion_fit import KERNEL_CHI2, pose_jacobian
from belie.odometry.relative_pose import RelativePose, covariance_of

_COLUMNS, _ROWS = 4, 3
_CLUSTERS = _COLUMNS * _ROWS
LEAST_CORNERS = 3 * _CLUSTERS  # in each part of the image a few, or their disagreement says nothing
_UNKNOWN_EXCESS = 4.0  # before frames have told: parts that disagree twice as much as noise explains
_UNKNOWN_STEEPNESS = 0.75  # likewise: the kernel's for Gaussian residuals
_LEAST_STEEPNESS = 0.2  # a kernel as flat as that holds on to nothing
_NEAR = 1e-3
_TRANSLATION, _ROTATION = slice(0, 3), slice(3, 6)


class PoseCovariance:
    """Covariance of motion after motion; how clusters disagree is averaged over frames, twelve of them say little.

    Parameters
    ----------
    memory_frames : int
        Over how many frames the disagreement of clusters is averaged.

    Examples
    --------
    Where the left half of the image moves up against the right one, the covariance is wider.

    >>> from belie.geometry import SE3
    >>> from belie.odometry.relative_pose import estimate_relative_pose
    >>> rng = np.random.default_rng(0)
    >>> points = np.column_stack([rng.uniform(-4, 4, (200, 2)), rng.uniform(5, 20, 200)])
    >>> motion, sigma = SE3.exp([0.02, 0.0, -0.8, 0.0, 0.01, 0.0]), 1e-3
    >>> moved, previous = motion.apply(points), points[:, :2] / points[:, 2:]
    >>> current = moved[:, :2] / moved[:, 2:] + rng.normal(0.0, sigma, (200, 2))
    >>> def deviation(shift):
    ...     shifted = current + shift * (current[:, :1] < 0.0) * np.array([0.0, 1.0])
    ...     pose = estimate_relative_pose(
    ...         previous, shifted, 1 / points[:, 2], np.full(200, 1e-4), motion, sigma=sigma)
    ...     C = PoseCovariance(1).update(previous, shifted, pose, sigma)
    ...     return float(np.sqrt(C[4, 4]))
    >>> deviation(3.0 * sigma) > 1.5 * deviation(0.0)
    True
    """

    def __init__(self, memory_frames: int) -> None:
        self._memory_frames = memory_frames
        self.forget()

    def forget(self) -> None:
        """The scene is another one."""
        self._frames, self._excess, self._steepness = 0, np.full(2, _UNKNOWN_EXCESS), _UNKNOWN_STEEPNESS

    def update(
        self, previous: FloatArray, current: FloatArray, pose: RelativePose, sigma: float
    ) -> FloatArray:
        """Covariance, shape (6, 6), of ``exp(xi) T_cur_prev``, translation first.

        Parameters
        ----------
        previous, current : arrays (N, 2)
            Undistorted coordinates in both frames of the points that the motion was estimated from.
        pose : RelativePose
        sigma : float
            Of a tracked position, in the same units.
        """
        C, scores, steepness = _information(previous, current, pose, sigma)
        g = (np.arange(_CLUSTERS)[:, None] == _clusters(current)).astype(np.float64) @ scores
        among = np.diag(C @ (g.T @ g) @ C) * _CLUSTERS / (_CLUSTERS - 6)
        within = np.diag(C)
        excess = np.array([among[k].sum() / within[k].sum() for k in (_TRANSLATION, _ROTATION)])
        # A mean, at first with what was supposed before as one frame of it; then it forgets.
        share = max(1.0 / self._memory_frames, 1.0 / (self._frames + 2.0))
        self._excess = (1.0 - share) * self._excess + share * excess
        self._steepness = (1.0 - share) * self._steepness + share * min(max(steepness, _LEAST_STEEPNESS), 1.0)
        self._frames += 1
        # Corners that happen to agree better than their noise allows are no better than their noise.
        spread = np.repeat(np.sqrt(np.maximum(self._excess, 1.0)), 3) / self._steepness
        return np.asarray(C * np.outer(spread, spread))


def _information(
    previous: FloatArray, current: FloatArray, pose: RelativePose, sigma: float
) -> tuple[FloatArray, FloatArray, float]:
    """Covariance (6, 6) by two images alone, the length as the map tells it; scores (N, 6); mean ψ' over mean ψ/r."""
    t, rho = pose.T_cur_prev.t, pose.inverse_depth
    wide = np.maximum(rho, float(np.median(rho))) ** 2
    H, scores, steepness = _weighed(
        np.ascontiguousarray(previous),
        current,
        rho,
        wide,
        pose.weight,
        pose.chi2,
        pose.T_cur_prev.R,
        t,
        sigma**2,
    )
    length = float(np.linalg.norm(t))
    if length > 0.0:
        along = np.concatenate([t / length, np.zeros(3)])
        H = H + np.outer(along, along) / float(along @ pose.covariance @ along)
    return covariance_of(H), scores, steepness


@compiled()
def _weighed(
    prev: Any, cur: Any, rho: Any, wide: Any, weight: Any, chi2: Any, R: Any, t: Any, variance: float
) -> tuple[Any, Any, float]:
    """Information (6, 6), scores (N, 6) and steepness, the depths `rho` known to a variance of `wide`."""
    n = prev.shape[0]
    H, scores, J = np.zeros((6, 6)), np.zeros((n, 6)), np.empty((2, 6))
    total = flatter = 0.0
    for i in range(n):
        x, y, q = prev[i, 0], prev[i, 1], rho[i]
        z = max(R[2, 0] * x + R[2, 1] * y + R[2, 2] + q * t[2], _NEAR)
        u = (R[0, 0] * x + R[0, 1] * y + R[0, 2] + q * t[0]) / z
        v = (R[1, 0] * x + R[1, 1] * y + R[1, 2] + q * t[1]) / z
        su, sv = (t[0] - u * t[2]) / z, (t[1] - v * t[2]) / z
        length2 = su * su + sv * sv
        gain = wide[i] / (variance + wide[i] * length2)
        eu, ev = cur[i, 0] - u, cur[i, 1] - v
        along = (su * eu + sv * ev) * gain
        wu, wv = (eu - su * along) / variance, (ev - sv * along) / variance  # W e
        # w = (K / (K + c))² of c = e'We, whose slope is -2 w / (K + c); of d components of e one is along e
        c, d = eu * wu + ev * wv, 2.0 - gain * length2
        total += weight[i]
        flatter += weight[i] * 4.0 * c / d / (KERNEL_CHI2 + chi2[i])
        pose_jacobian(u, v, q / z, J)
        w = weight[i] / variance
        for a in range(6):
            scores[i, a] = weight[i] * (J[0, a] * wu + J[1, a] * wv)
            h_a = (J[0, a] * su + J[1, a] * sv) * gain
            ja0, ja1 = (J[0, a] - h_a * su) * w, (J[1, a] - h_a * sv) * w
            for b in range(6):
                H[a, b] += ja0 * J[0, b] + ja1 * J[1, b]
    return H, scores, 1.0 - flatter / total


def _clusters(current: FloatArray) -> npt.NDArray[np.int64]:
    """Which of equally populated parts of the image each point lies in, shape (N,)."""
    n = len(current)
    column, row = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    column[np.argsort(current[:, 0])] = np.arange(n) * _COLUMNS // n
    order = np.lexsort((current[:, 1], column))  # column by column, downwards
    populated = np.bincount(column, minlength=_COLUMNS)
    place = np.arange(n) - np.repeat(np.cumsum(populated) - populated, populated)
    row[order] = place * _ROWS // np.repeat(populated, populated)
    return np.asarray(column * _ROWS + row)
