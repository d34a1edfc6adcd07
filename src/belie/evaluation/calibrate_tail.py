"""What rate of false alarms clean driving supports: the tail of each check's statistic, extended to its threshold.

The largest statistic of every few seconds is taken over its threshold; what exceeds the upper part of these maxima is
exponential, as the statistic of a sequential test is in theory (Siegmund 1985, section 2.6; the extreme-value form
with shape zero, Coles 2001, chapter 4). From its slope follow the rate at the threshold, and the threshold of a wanted
rate; a bootstrap over the blocks gives the interval that the length of the driving allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from belie.detector import Config
from belie.evaluation.calibrate_part import SettingPath
from belie.evaluation.run import Run
from belie.geometry import FloatArray

_BLOCK_S = 2.0
_UPPER = 0.6  # quantile of the block maxima above which the tail begins
_LEAST_BLOCKS = 20
_DRAWS = 400
_LEAST_PER_HOUR = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Tail:
    """The tail of one check.

    Parameters
    ----------
    name : str
        Check and stream.
    per_hour, low, high : float
        False alarms an hour at the threshold, and the 95 % interval.
    slope : float
        Mean excess, in units of the threshold.
    threshold : float
        Median of it, in the statistic's unit.
    """

    name: str
    per_hour: float
    low: float
    high: float
    slope: float
    threshold: float

    def in_words(self) -> str:
        """One line.

        >>> Tail(name="odometry /odom", per_hour=0.012, low=1e-4, high=0.4, slope=0.1, threshold=18.0).in_words()
        'odometry /odom: its tail gives 0.012 false alarms an hour at its threshold (0.0001 to 0.4)'
        """
        return (
            f"{self.name}: its tail gives {self.per_hour:.2g} false alarms an hour at its threshold "
            f"({self.low:.1g} to {self.high:.1g})"
        )


def tails(runs: Sequence[Run], seed: int = 0) -> list[Tail]:
    """The tail of every check that was tested long enough.

    >>> tails([])
    []
    """
    found: dict[str, list[FloatArray]] = {}
    thresholds: dict[str, list[float]] = {}
    for run in runs:
        for check in run.trace.checks:
            name = f"{check.check} {check.source}"
            found.setdefault(name, []).append(block_maxima(run.trace.seconds, check.ratio))
            known = check.threshold[np.isfinite(check.threshold)]
            thresholds.setdefault(name, []).extend(known.tolist())
    rng = np.random.default_rng(seed)
    fitted = []
    for name, parts in found.items():
        maxima = np.concatenate(parts)
        if len(maxima) >= _LEAST_BLOCKS and thresholds[name]:
            fitted.append(_tail(name, maxima, float(np.median(thresholds[name])), rng))
    return fitted


def block_maxima(seconds: FloatArray, ratio: FloatArray) -> FloatArray:
    """Largest ratio of every block in which the check was tested.

    >>> block_maxima(np.array([0.0, 1.0, 2.5]), np.array([0.1, 0.3, 0.2]))
    array([0.3, 0.2])
    """
    blocks = (np.asarray(seconds) // _BLOCK_S).astype(int)
    kept = np.isfinite(ratio)
    return np.array([float(ratio[kept & (blocks == k)].max()) for k in np.unique(blocks[kept])])


def rate_at(maxima: FloatArray, level: float) -> tuple[float, float]:
    """Exceedances of a level an hour, and the mean excess of the tail.

    >>> rng = np.random.default_rng(0)
    >>> rate, slope = rate_at(rng.exponential(0.1, 5000), 0.8)
    >>> abs(slope - 0.1) < 0.01, 0.3 < rate / float(1800 * np.exp(-8.0)) < 3.0
    (True, True)
    """
    start = float(np.quantile(maxima, _UPPER))
    excess = maxima[maxima > start] - start
    if not len(excess):
        return 0.0, 0.0
    slope = max(float(excess.mean()), 1e-4)
    share = len(excess) / len(maxima)
    return 3600.0 / _BLOCK_S * share * math.exp(-max(level - start, 0.0) / slope), slope


def _tail(name: str, maxima: FloatArray, threshold: float, rng: np.random.Generator) -> Tail:
    rate, slope = rate_at(maxima, 1.0)
    drawn = [rate_at(rng.choice(maxima, len(maxima)), 1.0)[0] for _ in range(_DRAWS)]
    low, high = (float(x) for x in np.quantile(drawn, (0.025, 0.975)))
    return Tail(name=name, per_hour=rate, low=low, high=high, slope=slope, threshold=threshold)


def tightened(found: Sequence[Tail], config: Config) -> tuple[dict[SettingPath, object], dict[str, str]]:
    """A stricter stated rate, where the tails say that the thresholds would be crossed more often than it allows.

    The thresholds of sequential tests grow by the logarithm of the mean time between alarms: to raise one by a factor
    k is to state a rate lower by ``exp(-h (k - 1))``.

    >>> noisy = Tail(name="imu /imu", per_hour=2.0, low=1.0, high=5.0, slope=0.05, threshold=18.0)
    >>> changes, _ = tightened([noisy], Config())
    >>> changes["sequential", "false_alarms_per_hour"] < 0.1
    True
    >>> tightened([], Config())
    ({}, {})
    """
    wanted = config.sequential.false_alarms_per_hour
    share = wanted / max(len(found), 1)
    path: SettingPath = ("sequential", "false_alarms_per_hour")
    needed = [(tail.slope * math.log(tail.per_hour / share), tail) for tail in found if tail.per_hour > share]
    if sum(tail.per_hour for tail in found) <= wanted or not needed:
        return {}, {}
    rise, worst = max(needed, key=lambda pair: pair[0] * pair[1].threshold)
    stated = max(wanted * math.exp(-rise * worst.threshold), _LEAST_PER_HOUR)
    note = (
        f"calibrated: {worst.name} needs it for {wanted:g} false alarms an hour, by the tail of its statistic"
    )
    return {path: float(f"{stated:.2g}")}, {".".join(path): note}
