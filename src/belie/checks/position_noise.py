"""The noise of a position stream, from its structure function.

The noise of a position is a fast part, standard deviation r, and a slow part that wanders (multipath, a
smoothing receiver). Its structure function ``V(L) = E[(n(t+L) - n(t))²]``, half of which is the semivariogram
of Matheron (1963), tells them apart: ``V(L) = 2 r² + w² L`` for lags well below the correlation time τ of the
slow part, a first-order Gauss-Markov process of variance ``w² τ / 2`` (Gelb, *Applied Optimal Estimation*,
1974, section 3.6). Two lags, the last claim and about a second, give r and w. A declared variance σ² is a
promise: ``r >= σ`` and ``w² >= 2 σ² / τ``, so that noise that is all slow is covered before any was seen.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from belie.checks.position_settings import PositionSettings
from belie.checks.running_scale import FEW, FEW_CAUTION, RunningScale
from belie.geometry import FloatArray

_LONG_LAG_S = 1.0
_LONG_LAG_CLAIMS = 5
_QUANTILE_ERROR = 1.6  # relative error of the square of a 68 % quantile of n Gaussian samples, times sqrt(n)
_ONE_IN_FIFTY = 2.05  # sigma


class PositionNoise:
    """Learns r and w of each axis from believed claims.

    Parameters
    ----------
    settings : PositionSettings
    declared : bool
        Whether the claims carry a covariance.

    Examples
    --------
    >>> noise = PositionNoise(PositionSettings(), declared=False)
    >>> rng = np.random.default_rng(0)
    >>> for i in range(300): noise.learn(i * 10**8, rng.normal(0.0, 0.5, 3), np.ones(3))
    >>> bool((abs(noise.fast_sigma_m(np.ones(3)) - 0.5) < 0.1).all())
    True
    """

    def __init__(self, settings: PositionSettings, *, declared: bool) -> None:
        self._settings = settings
        self._least = 1.0 if declared else settings.least_sigma_m / settings.unknown_sigma_m

        def scales() -> list[RunningScale]:
            return [
                RunningScale(
                    prior=settings.prior_scale, least=0.0, memory=settings.memory_claims,
                    learning=settings.learning_claims, waiting=settings.waiting_claims,
                )
                for _ in range(3)
            ]  # fmt: skip

        self._short, self._long = scales(), scales()
        self._past: deque[tuple[int, FloatArray]] = deque()
        self._lag_difference_s = _LONG_LAG_S
        self._lag_claims = 10

    @property
    def missing_claims(self) -> int:
        """How many believed claims are missing before the noise is known well enough."""
        return max(self._short[0].missing, self._long[0].missing)

    def fast_sigma_m(self, unit_m: FloatArray) -> FloatArray:
        """Standard deviation r of the fast part, shape (3,); `unit_m` is the declared one."""
        return np.maximum([scale.value for scale in self._short], self._least) * unit_m

    def walk_m(self, unit_m: FloatArray) -> FloatArray:
        """Intensity w of the slow part, m per sqrt(s), shape (3,)."""
        short = np.array([scale.value for scale in self._short]) ** 2
        long = self._long_scale(unit_m) ** 2
        # Two standard errors of fast noise are no evidence of wander: it would cost power for nothing. Where
        # what is seen is not independent it is no fast noise, but then it says little of how large it can be.
        count = max(self._long[0].count, 1)
        independent = np.array([scale.independent for scale in self._long])
        doubt = 2.0 * _QUANTILE_ERROR / np.sqrt(count) * np.sqrt(2.0) * short * np.sqrt(independent / count)
        excess = np.maximum(long - short - doubt, 0.0)
        likely = np.maximum(
            excess, np.minimum(excess * _caution(independent), 2.0 * self._lag_claims * short)
        )
        seen = 2.0 * likely / self._lag_difference_s
        promised = 2.0 * np.maximum(self._least**2, np.minimum(long, short)) / self._settings.multipath_time_s
        return np.asarray(np.sqrt(np.maximum(seen, promised)) * unit_m)

    def _long_scale(self, unit_m: FloatArray) -> FloatArray:
        """Scale over the long lag; before it has passed, a bound from all the claims that there are."""
        scale = np.array([scale.value for scale in self._long])
        if self._long[0].count >= FEW or self._short[0].count < FEW or len(self._past) < FEW:
            return scale
        past = np.array([difference_m for _, difference_m in self._past])
        reach = np.abs(past - past[0]).max(axis=0) / (np.sqrt(2.0) * unit_m)
        return np.asarray(np.minimum(scale, FEW_CAUTION * reach))

    def learn(self, stamp_ns: int, difference_m: FloatArray, unit_m: FloatArray) -> None:
        """Take in position minus odometry of a believed claim, shape (3,), both in one frame."""
        past = self._past
        if past:
            self._take(self._short, difference_m - past[-1][1], unit_m)
            reach_s = (stamp_ns - past[0][0]) * 1e-9
            if len(past) >= _LONG_LAG_CLAIMS and reach_s >= _LONG_LAG_S:
                self._take(self._long, difference_m - past[0][1], unit_m)
                self._lag_difference_s = reach_s - (stamp_ns - past[-1][0]) * 1e-9
                self._lag_claims = len(past)
        past.append((stamp_ns, difference_m))
        while len(past) > _LONG_LAG_CLAIMS and (stamp_ns - past[1][0]) * 1e-9 >= _LONG_LAG_S:
            past.popleft()

    def learn_length(self, lag_s: float, mismatch_m: float, unit_m: FloatArray) -> None:
        """Take in how much two displacements differ in length, while their directions cannot be compared."""
        self._take(self._short if lag_s < 0.7 * _LONG_LAG_S else self._long, np.full(3, mismatch_m), unit_m)

    def reject(self) -> None:
        """A claim was contradicted: what led up to it is not learned, nor a difference across it."""
        self.forget_past()
        for scale in (*self._short, *self._long):
            scale.drop_waiting()

    def forget_past(self) -> None:
        """Take no difference across this moment: odometry or claims were missing."""
        self._past.clear()

    def _take(self, scales: list[RunningScale], increment_m: FloatArray, unit_m: FloatArray) -> None:
        for scale, x in zip(scales, increment_m / (np.sqrt(2.0) * unit_m), strict=True):
            scale.learn(float(x))


def _caution(n: FloatArray) -> FloatArray:
    """How much larger a variance may be than n independent values show, in all but one case of fifty.

    By the χ² quantile of Wilson and Hilferty (1931).
    """
    root = 1.0 - 2.0 / (9.0 * n) - _ONE_IN_FIFTY * np.sqrt(2.0 / (9.0 * n))
    return np.asarray(1.0 / np.maximum(root, 0.1) ** 3)
