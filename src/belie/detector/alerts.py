"""From contradictions to alerts: each accusation is raised once, and again only after it had ended."""

from __future__ import annotations

from dataclasses import dataclass

from belie.types import AccusedObject, Alert, AlertType, CheckResult, Status

ALERT_OF_CHECK = {
    "odometry": AlertType.ODOMETRY_SPOOFING,
    "twist": AlertType.ODOMETRY_SPOOFING,
    "imu": AlertType.ODOMETRY_SPOOFING,
    "position": AlertType.POSITION_SPOOFING,
    "camera": AlertType.CAMERA_FAULT,
    "hiding": AlertType.OBSTACLE_HIDING,
    "misclassification": AlertType.OBJECT_MISCLASSIFICATION,
    "injection": AlertType.OBSTACLE_INJECTION,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """The result of one check, and where it found a lie, since when that goes on and about which object, if any."""

    result: CheckResult
    onset_ns: int | None = None
    accused: AccusedObject | None = None


class AlertBook:
    """Which accusations stand; `raise_new` tells those that are new.

    Examples
    --------
    >>> book = AlertBook()
    >>> lie = Judgement(result=CheckResult(check="imu", source="/imu", status=Status.CONTRADICTED), onset_ns=5)
    >>> [a.type.value for a in book.raise_new([lie], 7)], book.raise_new([lie], 8)
    (['odometry_spoofing'], ())
    """

    def __init__(self) -> None:
        self._standing: set[tuple[AlertType, str, str | None]] = set()

    def raise_new(self, judgements: list[Judgement], stamp_ns: int) -> tuple[Alert, ...]:
        """Alerts for contradictions that did not stand before this frame."""
        now: dict[tuple[AlertType, str, str | None], int] = {}
        because: dict[tuple[AlertType, str, str | None], list[str]] = {}
        accused: dict[tuple[AlertType, str, str | None], AccusedObject | None] = {}
        undecided: set[tuple[AlertType, str, str | None]] = set()
        for judgement in judgements:
            result = judgement.result
            key = (ALERT_OF_CHECK[result.check], result.source, result.object)
            if result.status is Status.CONTRADICTED:
                onset = stamp_ns if judgement.onset_ns is None else judgement.onset_ns
                now[key] = min(onset, now.get(key, onset))
                because.setdefault(key, []).append(result.reason)
                accused.setdefault(key, judgement.accused)
            elif result.status is Status.UNDECIDED:
                undecided.add(key)
        alerts = tuple(
            Alert(
                type=kind,
                source=source,
                onset_ns=onset,
                object=name,
                because="; ".join(dict.fromkeys(because[kind, source, name])),
                accused=accused[kind, source, name],
            )
            for (kind, source, name), onset in now.items()
            if (kind, source, name) not in self._standing
        )
        # An accusation stands while it cannot be tested: dark frames do not acquit; and a check that is undecided
        # without naming an object is so about all of them.
        self._standing = set(now) | {
            key for key in self._standing if key in undecided or (*key[:2], None) in undecided
        }
        return alerts
