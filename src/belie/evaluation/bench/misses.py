"""Why an attack was missed: what the checks that should have found it said while it lasted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from belie.attacks import AttackLabel
from belie.detector.alerts import ALERT_OF_CHECK
from belie.evaluation.trace import without_numbers
from belie.types import CheckResult, Status, Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Miss:
    """What is known of a miss.

    Parameters
    ----------
    why : str
        The commonest answer of the right checks on the attacked streams, numbers struck out: of those that were
        undecided, if that was half of the attacked frames or more. Empty where the detector shows no checks.
    nearest : float or None
        The largest statistic over its threshold; None where nothing was tested.
    """

    why: str = ""
    nearest: float | None = None


def why_missed(verdicts: Sequence[Verdict], label: AttackLabel) -> Miss:
    """What a run says of an attack that it missed.

    Examples
    --------
    >>> label = AttackLabel(name="imu-freeze", text="imu-freeze", stream="imu", sources=("/imu",),
    ...     alert="odometry_spoofing", start_frame=0, stop_frame=9, start_ns=0, onset_ns=0, end_ns=9, seed=0)
    >>> dark = CheckResult(check="imu", source="/imu", status=Status.UNDECIDED, reason="too dark: 3 corners")
    >>> run = [Verdict(frame=0, stamp_ns=0, status=Status.UNDECIDED, latency_ms=1.0, checks=(dark,))]
    >>> why_missed(run, label).why
    'imu undecided: too dark: … corners'
    """
    during = [v for v in verdicts if label.start_ns <= v.stamp_ns <= label.end_ns]
    if not any(v.checks for v in during):
        return Miss()
    answers = [[c for c in v.checks if _is_meant(c, label)] for v in during]
    told = [answer for answer in answers if answer]
    if not told:
        return Miss(why=f"no check judged {', '.join(label.sources)}")
    undecided = [answer for answer in told if all(c.status is Status.UNDECIDED for c in answer)]
    chosen = undecided if 2 * len(undecided) >= len(told) else told
    reasons = Counter(_words(c) for answer in chosen for c in answer)
    ratios = [
        c.statistic / c.threshold
        for answer in told
        for c in answer
        if c.threshold and c.statistic is not None
    ]
    return Miss(why=reasons.most_common(1)[0][0], nearest=max(ratios, default=None))


def _is_meant(check: CheckResult, label: AttackLabel) -> bool:
    return ALERT_OF_CHECK.get(check.check) == label.alert and check.source in label.sources


def _words(check: CheckResult) -> str:
    # An accusation that is no hit is one of something else: another object of the same stream.
    status = "accuses another" if check.status is Status.CONTRADICTED else check.status.value
    return f"{check.check} {status}: {without_numbers(check.reason)}".removesuffix(": ")
