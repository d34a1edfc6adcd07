"""Sequential tests: jumps at once, slow lies by a bank of CUSUMs, at a false-alarm rate that the user states.

Page's CUSUM for a shift of δ standard deviations accumulates the log-likelihood ratio,
``S <- max(0, S + δ x - δ²/2)`` (Page 1954; Lorden 1971). The bank holds several δ, both signs, all components.
Its thresholds follow from the wanted mean time between false alarms through Siegmund's approximation
(Siegmund, *Sequential Analysis*, 1985, section 2.6): with k = δ/2 and b = h/δ + 1.166,
``ARL = (exp(2kb) - 2kb - 1) / (2k²)``; every member of the bank gets an equal share (Bonferroni).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydantic import Field
from scipy.optimize import brentq

from belie.geometry import FloatArray
from belie.types import Settings

_STORED = 1.02  # of a threshold
_HALF = 0.505  # of a threshold, and a little: two make a whole
_OVERSHOOT = 1.166  # mean overshoot of a Gaussian walk over both boundaries, in sigma (Siegmund)


class SequentialSettings(Settings):
    """How evidence adds up over time."""

    false_alarms_per_hour: float = Field(
        0.1, gt=0.0, le=1000.0, description="false alarms that are tolerated, all checks together [1/h]"
    )
    shifts_sigma: tuple[float, ...] = Field(
        (0.5, 1.0, 2.0, 4.0, 8.0), min_length=1,
        description="sizes of the lies that the CUSUM bank is best at [standard deviations a frame]",
    )  # fmt: skip
    clip_sigma: float = Field(
        3.5, gt=1.0,
        description="one frame counts for no more than this [standard deviations]: residuals have heavier tails "
        "than a Gaussian; one frame proves little, nor do the two that a bump in the road lasts. For a shift of more "
        "than twice this, a frame counts for half the threshold: two such frames are no bump",
    )  # fmt: skip
    jump_sigma: float = Field(
        15.0, gt=3.0,
        description="an error beyond this is a jump, believed at once [standard deviations]; beyond any outlier "
        "of a Student-t with six degrees of freedom in ten hours at 30 Hz",
    )  # fmt: skip
    release_s: float = Field(
        1.0,
        ge=0.0,
        description="quiet time after which a contradiction is over [s]; a new one is a new alert",
    )


def cusum_threshold(shift_sigma: float, mean_frames_between_alarms: float) -> float:
    """Threshold h, in nats, of a one-sided CUSUM for a mean number of frames between false alarms.

    >>> round(cusum_threshold(1.0, 1e6), 2)
    11.96
    """
    k = 0.5 * shift_sigma

    def log_excess(b: float) -> float:
        y = 2.0 * k * b
        # exp(y) - y - 1 without overflow or cancellation
        log_numerator = y if y > 50.0 else math.log(max(math.expm1(y) - y, 1e-300))
        return log_numerator - math.log(2.0 * k * k * mean_frames_between_alarms)

    b = float(brentq(log_excess, 1e-9, 2000.0 / shift_sigma))
    return max(shift_sigma * (b - _OVERSHOOT), 1e-3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What the tests hold after a frame.

    Parameters
    ----------
    contradicted : bool
        Whether some test is over its threshold, or was and has not been released yet.
    statistic, threshold : float
        Of the test nearest to (or furthest over) its threshold, in nats (CUSUM) or chi2 (jump).
    unit : str
        ``llr`` or ``chi2``.
    component : int
        Which component of the residual that test watches.
    onset_ns : int
        When that test last stood at zero: our estimate of when the lie began.
    """

    contradicted: bool
    statistic: float
    threshold: float
    unit: str
    component: int
    onset_ns: int


class CusumBank:
    """Two-sided CUSUMs for several shifts on every component of a whitened residual, and a jump test.

    Parameters
    ----------
    components : int
        Length of the residual.
    settings : SequentialSettings
    tests : int
        How many such banks share the stated false-alarm rate.

    Examples
    --------
    >>> bank = CusumBank(1, SequentialSettings())
    >>> rng = np.random.default_rng(0)
    >>> any(bank.update(rng.normal(size=1), i * 10**8, 0.1).contradicted for i in range(1000))
    False
    >>> frames = 0
    >>> while not bank.update(np.array([2.0]), (1000 + frames) * 10**8, 0.1).contradicted: frames += 1
    >>> frames < 12
    True
    """

    def __init__(self, components: int, settings: SequentialSettings, tests: int = 1) -> None:
        self._settings = settings
        self._shifts = np.sort(np.array(settings.shifts_sigma))
        self._share = 2 * components * len(self._shifts) * tests
        self._sums = np.zeros((components, 2, len(self._shifts)))
        self._since_ns = np.zeros((components, 2, len(self._shifts)), dtype=np.int64)
        self._thresholds = np.full(len(self._shifts), np.inf)
        # Middling shifts date a jump: small ones run for seconds, the largest forgets the first frame.
        self._dating = int(np.argmin(np.abs(self._shifts - settings.clip_sigma)))
        self._interval_s = 0.0
        self._last_over_ns: int | None = None
        self._accusation: Evidence | None = None

    @property
    def thresholds(self) -> FloatArray:
        """Threshold of each shift, nats, shape (len(shifts),)."""
        return self._thresholds

    @property
    def calm(self) -> float:
        """How far the evidence is from an accusation: 1 without any, 0 at a threshold."""
        return 1.0 - min(1.0, float(np.max(self._sums / self._thresholds)))

    def _set_rate(self, interval_s: float) -> None:
        if abs(interval_s - self._interval_s) <= 0.2 * self._interval_s:
            return
        self._interval_s = interval_s
        frames = 3600.0 / self._settings.false_alarms_per_hour / interval_s * self._share
        self._thresholds = np.array([cusum_threshold(float(d), frames) for d in self._shifts])

    def update(self, x: FloatArray, stamp_ns: int, interval_s: float, jumps_only: bool = False) -> Evidence:
        """Add the whitened residual of one frame, shape (components,), `interval_s` after the last.

        With `jumps_only` nothing is accumulated: while the noise is not known, small errors prove nothing.
        """
        self._set_rate(interval_s)
        s = self._settings
        largest = int(np.argmax(np.abs(x)))
        jump = float(x[largest] ** 2)
        clip = np.where(
            self._shifts > 2.0 * s.clip_sigma,
            0.5 * self._shifts + _HALF * self._thresholds / self._shifts,
            s.clip_sigma,
        )
        clipped = np.clip(x[:, None], -clip, clip)
        signed = np.stack([clipped, -clipped], axis=1)
        self._since_ns[self._sums == 0.0] = stamp_ns
        # Little more than the threshold is stored: a contradiction must be able to end.
        grown = self._sums + signed * self._shifts - 0.5 * self._shifts**2
        self._sums = np.clip(grown, 0.0, 0.0 if jumps_only else _STORED * self._thresholds)
        ratio = self._sums / self._thresholds
        i, side, j = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
        worst = float(ratio[i, side, j])
        is_jump = jump > s.jump_sigma**2
        over = is_jump or worst > 1.0
        held_before = self._last_over_ns is not None
        if over:
            self._last_over_ns = stamp_ns
        if self._last_over_ns is not None and stamp_ns - self._last_over_ns >= s.release_s * 1e9:
            self._sums[:] = 0.0  # the lie is over: the next one starts from nothing
            self._last_over_ns = None
        held = self._last_over_ns is not None and stamp_ns - self._last_over_ns < s.release_s * 1e9
        evidence = Evidence(
            contradicted=over,
            statistic=float(self._sums[i, side, j]),
            threshold=float(self._thresholds[j]),
            unit="llr",
            component=int(i),
            onset_ns=int(self._since_ns[i, side, j]),
        )
        if is_jump and worst <= 1.0:
            evidence = Evidence(
                contradicted=True, statistic=jump, threshold=s.jump_sigma**2, unit="chi2",
                component=largest, onset_ns=int(self._since_ns[largest, 0 if x[largest] > 0.0 else 1, self._dating]),
            )  # fmt: skip
        if over and not held_before:
            self._accusation = evidence
        elif held and self._accusation is not None:
            return self._accusation  # it stands as it was made, until it is released
        return evidence

    def smallest_shift(self, frames: int) -> float:
        """The steady shift, in sigma a frame, that the bank finds within `frames` frames on average.

        >>> bank = CusumBank(1, SequentialSettings()); _ = bank.update(np.zeros(1), 0, 0.1)
        >>> 1.0 < bank.smallest_shift(10) < 2.5
        True
        """
        if not np.isfinite(self._thresholds).all():
            return float("inf")
        return float(np.min(self._thresholds / (frames * self._shifts) + 0.5 * self._shifts))
