"""Alerts, with what raised them and how long it went on."""

from __future__ import annotations

from dataclasses import dataclass

from belie.evaluation.score import RaisedAlert
from belie.types import Status, Verdict


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
        Stamp of the last frame in a row that contradicts the same stream.
    """

    raised: RaisedAlert
    check: str
    reason: str
    end_ns: int

    @property
    def delay_ns(self) -> int:
        """From the estimated onset to the frame that raised the alert."""
        return max(0, self.raised.stamp_ns - self.raised.alert.onset_ns)


class AlertRecorder:
    """Follows each alert for as long as its stream stays contradicted.

    >>> AlertRecorder().finish()
    ()
    """

    def __init__(self) -> None:
        self._ended: list[TracedAlert] = []
        self._open: dict[int, tuple[RaisedAlert, str, str, int]] = {}
        self._number = 0

    def add(self, verdict: Verdict) -> None:
        """Take in the verdict on the next frame."""
        contradicted = {r.source: r for r in verdict.checks if r.status is Status.CONTRADICTED}
        undecided = {r.source for r in verdict.checks if r.status is Status.UNDECIDED}
        for number, (raised, check, reason, _) in list(self._open.items()):
            if raised.alert.source in contradicted:
                self._open[number] = (raised, check, reason, verdict.stamp_ns)
            elif raised.alert.source not in undecided:  # what cannot be tested is not acquitted
                self._end(number)
        for alert in verdict.alerts:
            raised = RaisedAlert(frame=verdict.frame, stamp_ns=verdict.stamp_ns, alert=alert)
            result = contradicted.get(alert.source)
            check, reason = ("", "") if result is None else (result.check, result.reason)
            self._open[self._number] = (raised, check, reason, verdict.stamp_ns)
            self._number += 1

    def _end(self, number: int) -> None:
        raised, check, reason, end_ns = self._open.pop(number)
        self._ended.append(TracedAlert(raised=raised, check=check, reason=reason, end_ns=end_ns))

    def finish(self) -> tuple[TracedAlert, ...]:
        """All alerts so far, in the order in which they were raised."""
        for number in list(self._open):
            self._end(number)
        return tuple(sorted(self._ended, key=lambda traced: traced.raised.stamp_ns))
