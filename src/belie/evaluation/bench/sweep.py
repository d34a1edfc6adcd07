"""Had the thresholds been others: what would have been caught, how late, and how often falsely.

Each statistic is taken over its threshold, and one factor is swept over all of them. A sequential test starts anew when
it accuses, so that beyond factor 1 the answer is that of the test as it ran; it is exact at factor 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from belie.attacks import AttackLabel
from belie.detector.alerts import ALERT_OF_CHECK
from belie.evaluation.score import nearest_frame
from belie.types import Verdict

FACTORS: tuple[float, ...] = tuple(float(f"{x:.3g}") for x in np.geomspace(0.02, 20.0, 31))
# Below its threshold such a check accuses (the paper's e^L < T4): a factor means nothing there.
_LOW_ACCUSES = "px2"


@dataclass(frozen=True, slots=True, kw_only=True)
class Exceedances:
    """By kind of alert and for every factor of `FACTORS`.

    Parameters
    ----------
    episodes : mapping of str to list of int
        Honest time only: how often the statistics reached factor times threshold.
    delay_frames : mapping of str to list of int or None
        Of the attack of that kind: frames from its first lie until its source's statistic did so; None where it did
        not.
    """

    episodes: dict[str, list[int]]
    delay_frames: dict[str, list[int | None]]


def exceedances(verdicts: Sequence[Verdict], labels: Sequence[AttackLabel]) -> Exceedances:
    """The statistics of a run against every factor of their thresholds.

    Examples
    --------
    >>> from belie.types import CheckResult, Status
    >>> run = [Verdict(frame=k, stamp_ns=k, status=Status.CONSISTENT, latency_ms=1.0, checks=(CheckResult(
    ...     check="odometry", source="/odom", status=Status.CONSISTENT, statistic=x, threshold=10.0),))
    ...     for k, x in enumerate([1.0, 6.0, 2.0, 6.0])]
    >>> found = exceedances(run, []).episodes["odometry_spoofing"]
    >>> [count for factor, count in zip(FACTORS, found) if factor in (0.502, 1.0)]
    [2, 0]
    """
    factors = np.array(FACTORS)
    first_ns = min((label.start_ns for label in labels), default=None)
    honest = [v for v in verdicts if first_ns is None or v.stamp_ns < first_ns]
    ratios = _ratios(honest)
    episodes = {}
    for kind in sorted({ALERT_OF_CHECK[check] for check, _ in ratios}):
        rises = np.zeros(len(factors), dtype=np.int64)
        for (check, _), ratio in ratios.items():
            if ALERT_OF_CHECK[check] == kind:
                above = np.vstack([np.zeros((1, len(factors)), bool), ratio[:, None] >= factors])
                rises += (above[1:] & ~above[:-1]).sum(axis=0)
        episodes[kind.value] = rises.tolist()
    delays: dict[str, list[int | None]] = {}
    for label in labels:
        first = nearest_frame([v.stamp_ns for v in verdicts], label.onset_ns)
        during = [v for v in verdicts[first:] if v.stamp_ns <= label.end_ns + 1_000_000_000]
        found = [
            ratio
            for (check, source), ratio in _ratios(during).items()
            if ALERT_OF_CHECK[check] == label.alert and source in label.sources
        ]
        if found:
            above = np.max(found, axis=0)[:, None] >= factors
            delays[label.alert.value] = [int(a.argmax()) if a.any() else None for a in above.T]
    return Exceedances(episodes=episodes, delay_frames=delays)


def _ratios(verdicts: Sequence[Verdict]) -> dict[tuple[str, str], np.ndarray]:
    """Statistic over threshold by check and source, (N,): of several objects the worst, 0 where nothing was tested."""
    found: dict[tuple[str, str], np.ndarray] = {}
    for index, verdict in enumerate(verdicts):
        for check in verdict.checks:
            if check.check not in ALERT_OF_CHECK or not check.statistic or not check.threshold:
                continue
            if check.unit == _LOW_ACCUSES and check.check in ("hiding", "misclassification"):
                continue
            row = found.setdefault((check.check, check.source), np.zeros(len(verdicts)))
            row[index] = max(row[index], check.statistic / check.threshold)
    return found
