"""How much noisier a stream is than its model, learned while it is believed.

A noise model is never the truth: bumps, rolling shutter, clock jitter and a poor calibration add to it, and what
they add is correlated from frame to frame. An AR(1) correlation of 0.3 alone turns one promised false alarm in
10 h into one in 17 minutes. So each component of the residual is divided by a scale that is learned from recent,
believed frames, the 68 % quantile of its size (robust against outliers and short lies), and then whitened by its
lag-one correlation, which is learned from signs alone: for a Gaussian ``E[sign x_t sign x_t-1] = 2/π asin φ``.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from pydantic import Field
from scipy.special import ndtri

from belie.geometry import FloatArray
from belie.types import Settings

_ONE_SIGMA = 0.6827  # of a Gaussian lies within one standard deviation


class NoiseScaleSettings(Settings):
    """How quickly, and how far, the noise model adapts to what is seen."""

    memory_frames: int = Field(
        60, ge=10,
        description="believed frames that the scale is learned from [count]; its relative error is about "
        "0.8/sqrt(memory)",
    )  # fmt: skip
    recent_frames: int = Field(
        20, ge=5,
        description="believed frames that suffice to see that the noise has fallen again, after a start-up, a turn "
        "or a lie [count]",
    )  # fmt: skip
    recent_caution: float = Field(
        1.25, ge=1.0,
        description="factor on the scale of so few frames [1]: one and a half standard errors of it",
    )  # fmt: skip
    prior_frames: int = Field(
        10, ge=1,
        description="frames of evidence that the prior scale is worth [count]: caution, not only at the start; it "
        "lets the scale rise at once when residuals grow for another reason than a lie",
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
    array([1.2, 1.6])
    """

    def __init__(self, components: int, settings: NoiseScaleSettings) -> None:
        self._settings = settings
        # what |x| of the prior noise looks like: evenly spaced quantiles
        p = (np.arange(settings.prior_frames) + 0.5) / settings.prior_frames
        self._prior = np.tile(settings.prior_scale * ndtri(0.5 + 0.5 * p)[:, None], (1, components))
        self._seen: deque[FloatArray] = deque(maxlen=settings.memory_frames)
        self._untested = 0
        self._correlation = np.zeros(components)
        self._offset = np.zeros(components)
        self._value = np.full(components, max(settings.prior_scale, settings.least_scale))

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

    def unknown(self) -> FloatArray:
        """What to learn for a component that was not tested: noise as large as the prior's.

        Its signs go ``+ + - -``: neither an offset nor a correlation is learned from it.
        """
        self._untested += 1
        sign = 1.0 if (self._untested // 2) % 2 else -1.0
        return np.full(len(self._value), sign * self._settings.prior_scale)

    def learn(self, x: FloatArray) -> None:
        """Take in the normalised residual of a believed frame, shape (components,)."""
        self._seen.append(np.array(x))
        seen = np.array(self._seen)
        limit = self._settings.most_offset * self._value
        self._offset = np.clip(np.median(np.concatenate([seen, 0.0 * self._prior]), axis=0), -limit, limit)
        centred = seen - self._offset
        one_sigma = self._one_sigma(centred)
        if len(seen) > self._settings.recent_frames:
            # The smaller one: what was noisy long ago is over, and what is noisy just now may be a lie.
            recent = self._settings.recent_caution * self._one_sigma(centred[-self._settings.recent_frames :])
            one_sigma = np.minimum(one_sigma, recent)
        self._value = np.maximum(one_sigma, self._settings.least_scale)
        # relative to the variance that the tests assume: a small correlated part of a large one does no harm
        share = self._one_sigma(centred) / self._value
        self._correlation = _sign_correlation(centred) * np.minimum(share, 1.0) ** 2

    def _one_sigma(self, centred: FloatArray) -> FloatArray:
        return np.asarray(np.quantile(np.concatenate([np.abs(centred), self._prior]), _ONE_SIGMA, axis=0))


def _sign_correlation(x: FloatArray) -> FloatArray:
    """Lag-one correlation of each column, shrunk towards zero by its own standard error.

    A negative one is as real: where each claimed position has an error of its own, consecutive steps share it with
    opposite signs.
    """
    n = len(x)
    if n < 8:
        return np.zeros(x.shape[1])
    signs = np.sign(x)
    phi = np.sin(0.5 * np.pi * np.mean(signs[1:] * signs[:-1], axis=0))
    shrunk = np.sign(phi) * np.maximum(np.abs(phi) - 1.0 / np.sqrt(n), 0.0)
    return np.asarray(np.clip(shrunk, -0.6, 0.9))
