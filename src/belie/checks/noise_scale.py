"""How much noisier a stream is than its model, learned while it is believed.

A noise model is never the truth: bumps, rolling shutter, clock jitter and a poor calibration add to it, and what
they add is correlated from frame to frame. An AR(1) correlation of 0.3 alone turns one promised false alarm in
10 h into one in 17 minutes. So each component of the residual is divided by a scale that is learned from recent,
believed frames, the 68 % quantile of its size (robust against outliers and short lies), and then whitened by its
lag-one correlation, which is learned from signs alone: for a Gaussian ``E[sign x_t sign x_t-1] = 2/π asin φ``.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
import numpy.typing as npt
from pydantic import Field
from scipy.special import ndtri

from belie.geometry import FloatArray
from belie.types import Settings

_ONE_SIGMA = 0.6827  # of a Gaussian lies within one standard deviation
_QUANTILE_ERROR = 0.8  # relative error of the 68 % quantile of n Gaussian values, times sqrt(n)
_MEAN_SIZE = float(np.sqrt(2.0 / np.pi))  # mean of |x| of a standard Gaussian


class NoiseScaleSettings(Settings):
    """How quickly, and how far, the noise model adapts to what is seen."""

    memory_frames: int = Field(
        100, ge=10,
        description="believed frames that the scale is learned from [count]; its relative error is about "
        "0.8/sqrt(memory)",
    )  # fmt: skip
    recent_frames: int = Field(
        12, ge=5,
        description="believed frames that suffice to see that noise has fallen after a start-up, while the memory is "
        "not full, and frames whose differences show that it has risen [count]",
    )  # fmt: skip
    recent_caution: float = Field(
        1.4, ge=1.0,
        description="factor on the scale of so few frames [1]: one and a half standard errors of it",
    )  # fmt: skip
    waiting_frames: int = Field(
        8, ge=0,
        description="believed frames that wait before they are learned from, once the noise is known [count]: a lie "
        "that is found within them never becomes noise",
    )  # fmt: skip
    prior_frames: int = Field(
        10, ge=1,
        description="frames of evidence that the prior scale is worth [count]: caution, not only at the start",
    )  # fmt: skip
    prior_scale: float = Field(
        3.0, gt=0.0, description="noise expected before any was seen, in units of the noise model [1]"
    )
    learning_frames: int = Field(
        20, ge=1,
        description="believed frames before slow lies are looked for, and CONSISTENT is said [count]; the scale of 20 "
        "is known to 18 %",
    )  # fmt: skip
    learning_s: float = Field(
        2.0, ge=0.0,
        description="the same in time [s]: at a high frame rate many frames show the same scene, and so the same "
        "systematic errors",
    )  # fmt: skip
    most_offset: float = Field(
        1.0, ge=0.0,
        description="how much of a steady residual may be taken for a systematic error [units of the noise seen]; "
        "a gyroscope's bias, say",
    )  # fmt: skip
    least_scale: float = Field(
        1.0,
        gt=0.0,
        description="the scale never falls below this [1]: the noise model is a promise, not a guess",
    )


class NoiseScale:
    """Running robust scale of each component of a normalised residual.

    Examples
    --------
    >>> scale = NoiseScale(2, NoiseScaleSettings())
    >>> scale.value
    array([3., 3.])
    >>> rng = np.random.default_rng(0)
    >>> for _ in range(300): scale.learn(rng.normal(size=2) * (1.0, 2.0))
    >>> scale.value.round(1)
    array([1.2, 2.1])
    """

    def __init__(self, components: int, settings: NoiseScaleSettings) -> None:
        self._settings = settings
        # what |x| of the prior noise looks like: evenly spaced quantiles
        p = (np.arange(settings.prior_frames) + 0.5) / settings.prior_frames
        self._prior = np.tile(settings.prior_scale * ndtri(0.5 + 0.5 * p)[:, None], (1, components))
        self._waiting: deque[tuple[FloatArray, npt.NDArray[np.bool_]]] = deque()
        self._seen: deque[FloatArray] = deque(maxlen=settings.memory_frames)
        self._settled: deque[npt.NDArray[np.bool_]] = deque(maxlen=settings.memory_frames)
        self._last = np.full(components, np.nan)
        self._differences: deque[FloatArray] = deque(maxlen=settings.recent_frames)
        self._untested = 0
        self._correlation = np.zeros(components)
        self._offset = np.zeros(components)
        self._learned = np.full(components, max(settings.prior_scale, settings.least_scale))
        self._value = self._learned

    @property
    def value(self) -> FloatArray:
        """Scale of each component, shape (components,)."""
        return self._value

    @property
    def offset(self) -> FloatArray:
        """Steady part of each component, a running median, shape (components,)."""
        return self._offset

    @property
    def correlation(self) -> FloatArray:
        """Lag-one correlation of each component, shape (components,), in [-0.6, 0.9]."""
        return self._correlation

    @property
    def missing_frames(self) -> int:
        """How many believed frames are missing before the scale is known well enough."""
        return max(0, self._settings.learning_frames - len(self._seen))

    def learn(
        self,
        x: FloatArray,
        tested: npt.NDArray[np.bool_] | None = None,
        settled: npt.NDArray[np.bool_] | None = None,
    ) -> None:
        """Take in the normalised residual of a believed frame, shape (components,).

        What was not `tested` says nothing; what is not `settled`, since a systematic error still dominates it, says
        nothing of how noise is correlated. Both have shape (components,), and hold everywhere if they are not given.
        """
        self._see_difference(np.array(x) if tested is None else np.where(tested, x, np.nan))
        seen = np.array(x) if tested is None else np.where(tested, x, self._unknown())
        self._waiting.append((seen, np.ones(len(x), bool) if settled is None else settled))
        if len(self._waiting) > self._settings.waiting_frames or self.missing_frames > 0:
            seen, settled = self._waiting.popleft()
            self._seen.append(seen)
            self._settled.append(settled)
            self._learn_seen()
        self._value = np.maximum(self._learned, self._rough())

    def reject(self) -> None:
        """The frame is contradicted: what led up to it is not learned."""
        self._waiting.clear()
        self._last = np.full(len(self._last), np.nan)

    def _learn_seen(self) -> None:
        seen = np.array(self._seen)
        limit = self._settings.most_offset * self._learned
        self._offset = np.clip(_quantile(np.concatenate([seen, 0.0 * self._prior]), 0.5), -limit, limit)
        centred = seen - self._offset
        caution = 1.0 + _QUANTILE_ERROR / math.sqrt(len(seen))
        one_sigma = caution * _quantile(np.concatenate([np.abs(centred), self._prior]))
        latest, settled = centred, np.array(self._settled)
        if len(seen) < self._settings.memory_frames:
            # The start must not count for long: a filter that starts up is noisier, and errs one way for seconds.
            recent = np.abs(centred[-self._settings.recent_frames :])
            if len(recent) == self._settings.recent_frames:
                one_sigma = np.minimum(one_sigma, self._settings.recent_caution * _quantile(recent))
            window = slice(-2 * self._settings.recent_frames, None)
            latest, settled = latest[window], settled[window]
        self._learned = np.maximum(one_sigma, self._settings.least_scale)
        # relative to the variance that the tests assume: a small correlated part of a large one does no harm
        share = _quantile(np.abs(latest)) / self._learned
        self._correlation = _sign_correlation(latest, settled) * np.minimum(share, 1.0) ** 2

    def _see_difference(self, x: FloatArray) -> None:
        """Note how far the residual has moved; one frame counts for no more than four standard deviations."""
        difference = np.abs(x - self._last)
        self._last = x
        if np.isfinite(difference).any():
            self._differences.append(np.minimum(difference, 4.0 * np.sqrt(2.0) * self._value))

    def _rough(self) -> FloatArray:
        """Scale from successive differences (von Neumann 1941): a steady lie leaves them as they were."""
        if len(self._differences) < self._settings.recent_frames:
            return np.zeros(len(self._value))
        differences = np.array(self._differences)
        known = np.isfinite(differences)
        count = known.sum(axis=0)
        mean = np.where(known, differences, 0.0).sum(axis=0) / np.maximum(count, 1)
        rough = mean / (_MEAN_SIZE * np.sqrt(2.0 * (1.0 - np.minimum(self._correlation, 0.5))))
        return np.asarray(np.where(2 * count >= self._settings.recent_frames, rough, 0.0))

    def _unknown(self) -> FloatArray:
        """What to learn for a component that was not tested: noise as large as the prior's.

        Its signs go ``+ + - -``: neither an offset nor a correlation is learned from it.
        """
        self._untested += 1
        sign = 1.0 if (self._untested // 2) % 2 else -1.0
        return np.full(len(self._value), sign * self._settings.prior_scale)


def _quantile(sizes: FloatArray, share: float = _ONE_SIGMA) -> FloatArray:
    """The value below which a share of each column lies; the next one, since interpolating costs ten times more."""
    k = math.ceil(share * (len(sizes) - 1))
    return np.asarray(np.partition(sizes, k, axis=0)[k])


def _sign_correlation(x: FloatArray, settled: npt.NDArray[np.bool_]) -> FloatArray:
    """Lag-one correlation of each column over settled pairs, shrunk towards zero as James and Stein (1961) do.

    A negative one is as real: where each claimed position has an error of its own, consecutive steps share it with
    opposite signs.
    """
    pairs = settled[1:] & settled[:-1]
    n = pairs.sum(axis=0)
    signs = np.sign(x)
    agreement = (signs[1:] * signs[:-1] * pairs).sum(axis=0) / np.maximum(n, 1)
    phi = np.sin(0.5 * np.pi * agreement)
    shrunk = phi * np.maximum(1.0 - 1.0 / np.maximum(n * phi**2, 1e-9), 0.0)
    return np.asarray(np.where(n >= 8, np.clip(shrunk, -0.6, 0.9), 0.0))
