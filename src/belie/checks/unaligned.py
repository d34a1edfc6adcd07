"""Position against odometry while the rotation between them is not known.

Length does not care for rotation: ``| |Δp| - |Δq| | <= |noise|`` by the triangle inequality, so its square
over the noise's variance lies below a χ² of three degrees of freedom. It is tested over several windows,
each with its share of the false alarms (Bonferroni, which needs no independence). Meanwhile the heading is
fitted to the two tracks: ``ψ = arg Σ conj(z_q) z_p`` over centred complex horizontal positions, the planar
case of Umeyama (1991).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from belie.checks.position_noise import PositionNoise
from belie.checks.position_settings import PositionSettings
from belie.checks.sequential import Evidence, SequentialSettings
from belie.geometry import FloatArray

_WINDOWS_S = (0.0, 1.0, 4.0, 16.0)
_MEMORY = 600
_SPACING_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """Estimated rotation about z from odometry to the position's frame."""

    yaw_rad: float
    sigma_rad: float
    extent_m: float
    needed_m: float


class Unaligned:
    """Tests lengths and waits for the heading to become observable.

    Examples
    --------
    >>> settings = PositionSettings(unknown_sigma_m=0.01)
    >>> noise = PositionNoise(settings, declared=False)
    >>> unaligned = Unaligned(settings, SequentialSettings(), tests=1)
    >>> for i in range(30):
    ...     q = np.array([0.5 * i, 0.0, 0.0])
    ...     evidence = unaligned.update(i * 10**8, q[[1, 0, 2]], q, noise, np.full(3, 0.01))
    >>> evidence.contradicted, round(np.degrees(unaligned.heading(noise, np.full(3, 0.01)).yaw_rad))
    (False, 90)
    """

    def __init__(self, settings: PositionSettings, sequential: SequentialSettings, *, tests: int) -> None:
        self._settings, self._sequential, self._tests = settings, sequential, tests
        self._past: deque[tuple[int, FloatArray, FloatArray]] = deque(maxlen=_MEMORY)
        self._last: tuple[int, FloatArray, FloatArray] | None = None
        self._last_over_ns: int | None = None
        self._interval_s = 0.1

    def update(
        self, stamp_ns: int, p_m: FloatArray, q_m: FloatArray, noise: PositionNoise, unit_m: FloatArray
    ) -> Evidence:
        """Test the position `p_m` at odometry's `q_m`, both shape (3,); learn from both if believed."""
        if self._last is not None:
            self._interval_s = max((stamp_ns - self._last[0]) * 1e-9, 1e-3)
        hours = self._interval_s / 3600.0
        share = self._sequential.false_alarms_per_hour * hours / (len(_WINDOWS_S) * self._tests)
        threshold = float(chdtri(3, share))
        worst, since_ns, lengths = 0.0, stamp_ns, []
        for window_s in _WINDOWS_S:
            then = self._before(stamp_ns, window_s)
            if then is None:
                continue
            lag_s = (stamp_ns - then[0]) * 1e-9
            travelled_m = float(np.linalg.norm(q_m - then[2]))
            mismatch_m = float(np.linalg.norm(p_m - then[1])) - travelled_m
            lengths.append((window_s, lag_s, mismatch_m))
            statistic = mismatch_m**2 / self._variance(lag_s, travelled_m, noise, unit_m)
            if statistic > worst:
                worst, since_ns = statistic, then[0]
        if worst > threshold:
            self._last_over_ns = stamp_ns
        release_ns = self._sequential.release_s * 1e9
        contradicted = self._last_over_ns is not None and (
            stamp_ns - self._last_over_ns < release_ns or worst > threshold
        )
        if contradicted:
            noise.reject()
        else:
            self._learn(stamp_ns, p_m, q_m, lengths, noise, unit_m)
        return Evidence(
            contradicted=contradicted, statistic=worst, threshold=threshold, unit="chi2", component=0,
            onset_ns=since_ns,
        )  # fmt: skip

    def floor_m(self, noise: PositionNoise, unit_m: FloatArray) -> float:
        """Smallest jump that one claim would show, m."""
        hours = self._interval_s / 3600.0
        share = self._sequential.false_alarms_per_hour * hours / (len(_WINDOWS_S) * self._tests)
        return math.sqrt(float(chdtri(3, share)) * self._variance(self._interval_s, 0.0, noise, unit_m))

    def heading(self, noise: PositionNoise, unit_m: FloatArray) -> Heading:
        """The heading so far, with an error that allows for noise that is all slow."""
        s = self._settings
        extent_m, span_s, sigma_rad, yaw_rad = 0.0, 0.0, math.pi, 0.0
        if len(self._past) >= 3:
            z_p = np.array([complex(p[0], p[1]) for _, p, _ in self._past])
            z_q = np.array([complex(q[0], q[1]) for _, _, q in self._past])
            extent_m = float(np.abs(z_q - z_q[0]).max())
            span_s = (self._past[-1][0] - self._past[0][0]) * 1e-9
            yaw_rad = float(np.angle(np.sum(np.conj(z_q - z_q.mean()) * (z_p - z_p.mean()))))
        # However many claims lie between, slow noise moves the two ends of a track against each other.
        error_m = math.sqrt(self._variance(span_s, 0.0, noise, unit_m) + s.odometry_walk_m**2 * extent_m)
        if extent_m > 0.0:
            sigma_rad = min(error_m / extent_m, math.pi)
        needed_m = error_m / math.tan(math.radians(s.heading_known_deg))
        return Heading(yaw_rad=yaw_rad, sigma_rad=sigma_rad, extent_m=extent_m, needed_m=needed_m)

    def forget_past(self) -> None:
        """Compare nothing across this moment: the odometry was lost."""
        self._past.clear()
        self._last = None

    def _variance(self, lag_s: float, travelled_m: float, noise: PositionNoise, unit_m: FloatArray) -> float:
        s = self._settings
        fast, walk = float(noise.fast_sigma_m(unit_m).max()), float(noise.walk_m(unit_m).max())
        slow = walk**2 * s.multipath_time_s * (1.0 - math.exp(-lag_s / s.multipath_time_s))
        odometry = s.odometry_walk_m**2 * travelled_m + (s.scale_sigma * travelled_m) ** 2
        turned = 2.0 * s.lever_sigma_m**2 if lag_s > 0.5 else 0.0
        return 2.0 * fast**2 + slow + odometry + turned + s.standing_walk_m**2 * lag_s

    def _before(self, stamp_ns: int, window_s: float) -> tuple[int, FloatArray, FloatArray] | None:
        """The youngest believed claim at least `window_s` old; the last one for 0."""
        if window_s == 0.0:
            return self._last
        limit_ns = stamp_ns - round(window_s * 1e9)
        return next((entry for entry in reversed(self._past) if entry[0] <= limit_ns), None)

    def _learn(
        self,
        stamp_ns: int,
        p_m: FloatArray,
        q_m: FloatArray,
        lengths: list[tuple[float, float, float]],
        noise: PositionNoise,
        unit_m: FloatArray,
    ) -> None:
        for window_s, lag_s, mismatch_m in lengths:
            if window_s <= 1.0:
                noise.learn_length(lag_s, mismatch_m, unit_m)
        self._last = (stamp_ns, p_m, q_m)
        if not self._past or stamp_ns - self._past[-1][0] >= _SPACING_S * 0.9e9:
            self._past.append(self._last)
