"""One detector over one recording: every frame's answer in columns, and what came of it by the labels."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from belie.attacks import AttackLabel
from belie.evaluation.bench.misses import Miss, why_missed
from belie.evaluation.bench.rivals import Rival, RivalError, checks_of, status_of
from belie.evaluation.bench.sweep import Exceedances, exceedances
from belie.evaluation.score import RaisedAlert, Score, score
from belie.types import Alert, CheckResult, Status, Step, Verdict

_SETTLING = 10  # frames at the start that no latency is taken of: caches are cold


@dataclass(slots=True)
class FrameTable:
    """The answers of a run: one row a frame and check; a frame without checks has one row, too."""

    columns: dict[str, list[Any]] = field(
        default_factory=lambda: {
            name: [] for name in ("frame", "stamp_ns", "status", "latency_ms", "decode_ms", "alerts", "check", "source",
                                  "object", "check_status", "statistic", "threshold", "unit", "reason")
        }
    )  # fmt: skip

    def add(self, verdict: Verdict, decode_ms: float) -> None:
        """Take in one frame."""
        alerts = [
            f"{alert.type.value} {alert.source} {alert.object or ''}".strip() for alert in verdict.alerts
        ]
        base = (
            verdict.frame,
            verdict.stamp_ns,
            verdict.status.value,
            verdict.latency_ms,
            decode_ms,
            "; ".join(alerts),
        )
        checks: Sequence[CheckResult | None] = verdict.checks or (None,)
        for check in checks:
            told = (
                (None,) * 8
                if check is None
                else (check.check, check.source, check.object, check.status.value, check.statistic, check.threshold,
                      check.unit, check.reason)
            )  # fmt: skip
            for column, value in zip(self.columns.values(), (*base, *told), strict=True):
                column.append(value)


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What came of a run; made by `measure`.

    Parameters
    ----------
    score : Score
        By the labels.
    frames : int
        How many were judged.
    undecided : int
        Of these, how many had no answer.
    latency_ms, decode_ms, seeing_ms : tuple of float
        Of every frame but the first few: of the update, of decoding the image (not part of it), and of visual odometry
        (part of it), where the detector tells.
    right_first : bool or None
        Whether the first alert within the attack named the right kind and source (and object, where both name one);
        None where there was none.
    during : int
        Alerts within the attack that it does not explain; those about honest frames after it are not among them.
    miss : Miss
        What is known of why the attack was missed.
    exceeded : Exceedances
        How the statistics stood to their thresholds: for the curves.
    table : FrameTable
        Every frame's answer.
    """

    score: Score
    frames: int
    undecided: int
    latency_ms: tuple[float, ...]
    decode_ms: tuple[float, ...]
    seeing_ms: tuple[float, ...]
    right_first: bool | None
    during: int
    miss: Miss
    exceeded: Exceedances
    table: FrameTable


def measure(steps: Iterable[Step], labels: Sequence[AttackLabel], rival: Rival) -> Measured:
    """Run a detector, and score it.

    Parameters
    ----------
    steps : iterable of Step
        Attacked or not.
    labels : sequence of AttackLabel
        What was attacked; none for an honest run.
    rival : Rival
        Fresh.

    Examples
    --------
    >>> import numpy as np
    >>> from belie.types import Frame
    >>> class Silent:
    ...     def update(self, step):
    ...         return []
    >>> frames = [Frame(camera="/c", stamp_ns=t, received_ns=t, image=np.zeros((4, 6), np.uint8)) for t in (0, 10**9)]
    >>> measure([Step(frame=frame) for frame in frames], [], Silent()).score.honest_s
    1.0
    """
    table, verdicts = FrameTable(), list[Verdict]()
    latency_ms, decode_ms, seeing_ms = [], [], []
    for verdict, step in _verdicts(steps, rival):
        table.add(verdict, step.decode_ms)
        verdicts.append(verdict)
        latency_ms.append(verdict.latency_ms)
        decode_ms.append(step.decode_ms)
        if hasattr(rival, "seeing_ms"):
            seeing_ms.append(float(rival.seeing_ms))
    scored = score(verdicts, labels)
    unexplained = _unexplained(scored)
    missed = [one.label for one in scored.labels if one.hit is None]
    return Measured(
        score=scored,
        frames=len(verdicts),
        undecided=sum(verdict.status is Status.UNDECIDED for verdict in verdicts),
        latency_ms=tuple(latency_ms[_SETTLING:]),
        decode_ms=tuple(decode_ms[_SETTLING:]),
        seeing_ms=tuple(seeing_ms[_SETTLING:]),
        right_first=_right_first(scored, unexplained),
        during=len(unexplained),
        miss=why_missed(verdicts, missed[0]) if missed else Miss(),
        exceeded=exceedances(verdicts, labels),
        table=table,
    )


def _verdicts(steps: Iterable[Step], rival: Rival) -> Iterator[tuple[Verdict, Step]]:
    for number, step in enumerate(steps):
        began = time.perf_counter()
        alerts = _alerts(rival, rival.update(step))
        spent_ms = (time.perf_counter() - began) * 1e3 + float(getattr(rival, "saved_ms", 0.0))
        verdict = Verdict(
            frame=number,
            stamp_ns=step.frame.stamp_ns,
            status=status_of(rival, alerts),
            latency_ms=spent_ms,
            checks=checks_of(rival),
            alerts=alerts,
        )
        yield verdict, step


def _alerts(rival: Rival, answer: object) -> tuple[Alert, ...]:
    """What a detector gave for a frame, if these are alerts: a user's own may give anything."""
    if not isinstance(answer, Iterable):
        raise RivalError(f"{type(rival).__name__}.update() must return the alerts, got {answer!r}")
    alerts = tuple(answer)
    if strange := [one for one in alerts if not isinstance(one, Alert)]:
        raise RivalError(f"{type(rival).__name__}.update() must return belie.types.Alert, got {strange[0]!r}")
    return alerts


def _unexplained(scored: Score) -> list[RaisedAlert]:
    """Alerts within an attack that are of another kind, source or object; not those about honest frames around it."""
    outside = (*scored.before_onset, *scored.aftermath)
    return [one for one in (*scored.wrong_attributions, *scored.false_alerts) if one not in outside]


def _right_first(scored: Score, unexplained: Sequence[RaisedAlert]) -> bool | None:
    """Whether the earliest alert within the attack was the right one."""

    def first(alerts: Iterable[RaisedAlert | None]) -> float:
        return min((one.frame for one in alerts if one is not None), default=math.inf)

    right, wrong = first(label.hit for label in scored.labels), first(unexplained)
    return None if math.isinf(right) and math.isinf(wrong) else right <= wrong
