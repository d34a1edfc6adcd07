"""The noise of a position stream, from its structure function.

The noise of a position is a fast part, standard deviation r, and a slow part that wanders (multipath, a smoothing
receiver). Its structure function ``V(L) = E[(n(t+L) - n(t))²]``, half of which is the semivariogram of Matheron
(1963), tells them apart: ``V(L) = 2 r² + w² L`` for lags well below the correlation time τ of the slow part, a
first-order Gauss-Markov process of variance ``w² τ / 2`` (Gelb, *Applied Optimal Estimation*, 1974, section 3.6).
Two lags, the last claim and about a second, give r and w. A declared variance σ² is a promise: ``r >= σ`` and
``w² >= 2 σ² / τ``, so that noise that is all slow is covered before any was seen.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from belie.checks.noise_scale import NoiseScale, NoiseScaleSettings
from belie.checks.position_settings import PositionSettings
from belie.geometry import FloatArray

_LONG_LAG_S = 1.0
_LONG_LAG_CLAIMS = 5
_QUANTILE_ERROR = 1.6  # relative error of the square of a 68 % quantile of n Gaussian samples, times sqrt(n)
_EVERY_CLAIM = 60  # at first every claim teaches; later every second, for twice the memory at half the cost


class PositionNoise:
    """Learns r and w of each axis from believed claims.

    Parameters
    ----------
    settings : PositionSettings
    scale : NoiseScaleSettings
        How quickly it is learned, and how cautious it begins.
    declared : bool
        Whether the claims carry a covariance.

    Examples
    --------
    >>> noise = PositionNoise(PositionSettings(), NoiseScaleSettings(memory_frames=200), declared=False)
    >>> rng = np.random.default_rng(0)
    >>> for i in range(300): noise.learn(i * 10**8, rng.normal(0.0, 0.5, 3), np.ones(3))
    >>> bool((abs(noise.fast_sigma_m(np.ones(3)) - 0.5) < 0.1).all())
    True
    """

    def __init__(self, settings: PositionSettings, scale: NoiseScaleSettings, *, declared: bool) -> None:
        self._settings = settings
        least = scale.least_scale if declared else settings.least_sigma_m / settings.unknown_sigma_m
        scale = scale.model_copy(update={"least_scale": least, "most_offset": 0.0})
        self._least = least
        self._short, self._long = NoiseScale(3, scale), NoiseScale(3, scale)
        self._past: deque[tuple[int, FloatArray]] = deque()
        self._lags_s = (0.1, _LONG_LAG_S)
        self._memory = scale.memory_frames
        self._claims = self._learned = 0

    @property
    def missing_claims(self) -> int:
        """How many believed claims are missing before the noise is known well enough."""
        return self._short.missing_frames

    def fast_sigma_m(self, unit_m: FloatArray) -> FloatArray:
        """Standard deviation r of the fast part, shape (3,); `unit_m` is the declared one."""
        return np.asarray(self._short.value * unit_m)

    def walk_m(self, unit_m: FloatArray) -> FloatArray:
        """Intensity w of the slow part, m per sqrt(s), shape (3,)."""
        short, long = self._short.value**2, self._long.value**2
        # One standard error of the difference is no evidence of wander: it would cost power for nothing.
        doubt = _QUANTILE_ERROR / np.sqrt(max(self._learned, 1)) * np.hypot(short, long)
        seen = 2.0 * np.maximum(long - short - doubt, 0.0) / (self._lags_s[1] - self._lags_s[0])
        promised = 2.0 * np.maximum(self._least**2, np.minimum(long, short)) / self._settings.multipath_time_s
        return np.asarray(np.sqrt(np.maximum(seen, promised)) * unit_m)

    def learn(self, stamp_ns: int, difference_m: FloatArray, unit_m: FloatArray) -> None:
        """Take in position minus odometry of a believed claim, shape (3,), both in one frame."""
        past = self._past
        self._claims += 1
        if past and (self._claims < _EVERY_CLAIM or self._claims % 2 == 0):
            self._learned = min(self._learned + 1, self._memory)
            self._short.learn(self._normalised(difference_m - past[-1][1], unit_m))
            reach_s = (stamp_ns - past[0][0]) * 1e-9
            if len(past) >= _LONG_LAG_CLAIMS and reach_s >= _LONG_LAG_S:
                self._long.learn(self._normalised(difference_m - past[0][1], unit_m))
                self._lags_s = ((stamp_ns - past[-1][0]) * 1e-9, reach_s)
        past.append((stamp_ns, difference_m))
        while len(past) > _LONG_LAG_CLAIMS and (stamp_ns - past[1][0]) * 1e-9 >= _LONG_LAG_S:
            past.popleft()

    def learn_length(self, lag_s: float, mismatch_m: float, unit_m: FloatArray) -> None:
        """Take in how much two displacements differ in length, while their directions cannot be compared."""
        x = np.full(3, mismatch_m) / (np.sqrt(2.0) * unit_m)
        (self._short if lag_s < 0.7 * _LONG_LAG_S else self._long).learn(x)

    def forget_past(self) -> None:
        """Take no difference across this moment: odometry or claims were missing."""
        self._past.clear()

    def _normalised(self, increment_m: FloatArray, unit_m: FloatArray) -> FloatArray:
        # Signs are kept: the noise's own correlation is not used here, its size is.
        return np.asarray(increment_m / (np.sqrt(2.0) * unit_m))
