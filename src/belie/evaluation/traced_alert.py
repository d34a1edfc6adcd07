"""Alerts, with what raised them and how long it went on."""

from __future__ import annotations

from dataclasses import dataclass

from belie.detector.alerts import ALERT_OF_CHECK
from belie.evaluation.score import RaisedAlert
from belie.types import AlertType, CheckResult, Status, Verdict

_Key = tuple[AlertType, str, str | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class TracedAlert:
    """An alert, the frame in which it was raised, and how long what raised it stayed contradicted.

    Parameters
    ----------
    raised : RaisedAlert
        The alert.
    check, reason : str
        The check behind it, and what that said.
    end_ns : int
        Stamp of the last frame in a row that contradicts the same stream, of the same object.
    label : str
        What the object of the alert is, if it names one.
    """

    raised: RaisedAlert
    check: str
    reason: str
    end_ns: int
    label: str = ""

    @property
    def object(self) -> str | None:
        """The object that it names, with what it is; None where it names none.

        >>> from belie.types import Alert, AlertType
        >>> alert = Alert(type=AlertType.OBSTACLE_HIDING, source="/d", onset_ns=0, object="7")
        >>> raised = RaisedAlert(frame=0, stamp_ns=0, alert=alert)
        >>> TracedAlert(raised=raised, check="hiding", reason="", end_ns=0, label="car").object
        'car 7'
        """
        name = self.raised.alert.object
        return name if name is None else f"{self.label} {name}".strip()

    @property
    def delay_ns(self) -> int:
        """From the estimated onset to the frame that raised the alert."""
        return max(0, self.raised.stamp_ns - self.raised.alert.onset_ns)


@dataclass(slots=True)
class _Open:
    """An alert that may still go on."""

    key: _Key
    raised: RaisedAlert
    check: str
    reason: str
    end_ns: int
    label: str


def _key(result: CheckResult) -> _Key:
    return ALERT_OF_CHECK[result.check], result.source, result.object


class AlertRecorder:
    """Follows each alert for as long as its stream stays contradicted.

    >>> AlertRecorder().finish()
    ()
    """

    def __init__(self) -> None:
        self._ended: dict[int, TracedAlert] = {}
        self._open: dict[int, _Open] = {}
        self._number = 0

    def add(self, verdict: Verdict) -> None:
        """Take in the verdict on the next frame."""
        contradicted = {_key(r): r for r in verdict.checks if r.status is Status.CONTRADICTED}
        undecided = {_key(r) for r in verdict.checks if r.status is Status.UNDECIDED}
        for number, opened in list(self._open.items()):
            kind, source, _ = opened.key
            if opened.key in contradicted:
                opened.end_ns = verdict.stamp_ns
            elif not undecided & {opened.key, (kind, source, None)}:  # what cannot be tested is not acquitted
                self._end(number)
        for alert in verdict.alerts:
            raised = RaisedAlert(frame=verdict.frame, stamp_ns=verdict.stamp_ns, alert=alert)
            key = (alert.type, alert.source, alert.object)
            result = contradicted.get(key)
            check, reason = ("", "") if result is None else (result.check, result.reason)
            reason = alert.because or reason  # which detectors of others do not tell
            about = alert.accused
            label = "" if about is None else about.label_before or about.label_after or ""
            self._open[self._number] = _Open(key, raised, check, reason, verdict.stamp_ns, label)
            self._number += 1

    def _end(self, number: int) -> None:
        o = self._open.pop(number)
        self._ended[number] = TracedAlert(
            raised=o.raised, check=o.check, reason=o.reason, end_ns=o.end_ns, label=o.label
        )

    def finish(self) -> tuple[TracedAlert, ...]:
        """All alerts so far, in the order in which they were raised."""
        for number in list(self._open):
            self._end(number)
        return tuple(self._ended[number] for number in sorted(self._ended))
