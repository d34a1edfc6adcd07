"""``diagnostic_msgs/DiagnosticArray`` on /diagnostics, and the latched list of alerts."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from belie.bridges.board import Answer, Input, Picture
from belie.bridges.settings import AnswerSettings
from belie.bridges.sinks.sink import SinkBase
from belie.bridges.wire import now_ns
from belie.recordings.messages import STORE, header, new
from belie.types import Alert, CheckResult, Status

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN, ERROR, STALE = 0, 1, 2, 3

_LEVEL = {Status.CONSISTENT: OK, Status.UNDECIDED: WARN, Status.CONTRADICTED: ERROR}


def status_message(level: int, name: str, message: str, values: Iterable[tuple[str, object]]) -> Any:
    """``diagnostic_msgs/DiagnosticStatus`` with key-values as text.

    >>> status_message(WARN, "belie: /odom odometry", "too dark", [("floor", "0.1 m")]).values[0].value
    '0.1 m'
    """
    pairs = [
        new("diagnostic_msgs/msg/KeyValue", key=key, value="" if value is None else str(value))
        for key, value in values
    ]
    return new(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level=level,
        name=name,
        message=message,
        hardware_id="belie",
        values=pairs,
    )


def array_bytes(stamp_ns: int, statuses: list[Any]) -> bytes:
    """The CDR of a ``DiagnosticArray``.

    >>> len(array_bytes(0, []))
    24
    """
    message = new(DIAGNOSTICS, header=header(stamp_ns, ""), status=statuses)
    return bytes(STORE.serialize_cdr(message, DIAGNOSTICS))


def check_status(check: CheckResult, *, stale: bool) -> Any:
    """One check of one stream: OK, WARN (undecided), ERROR (contradicted), STALE (its input is silent)."""
    name = f"belie: {check.check} {check.source}" + (f" {check.object}" if check.object else "")
    figure = None if check.statistic is None else f"{check.statistic:.6g}"
    values = [
        ("status", check.status.value),
        ("source", check.source),
        ("statistic", figure),
        ("threshold", None if check.threshold is None else f"{check.threshold:.6g}"),
        ("unit", check.unit),
        ("floor", check.floor),
    ]
    level = STALE if stale else _LEVEL[check.status]
    text = f"silent; last answer: {check.reason}" if stale else check.reason
    return status_message(level, name, text or check.status.value, values)


def input_status(one: Input, faults: list[tuple[str, str, int, bool]]) -> Any:
    """One input: OK, WARN with the name of the fault, or STALE."""
    recent = [f"{kind}: {text}" for kind, text, _, now in faults if now]
    level = STALE if one.silent else (WARN if recent else OK)
    age = "never" if one.age_s is None else f"{one.age_s:.2f}"
    text = "; ".join(recent) or ("silent" if one.silent else "receiving")
    if one.silent and recent:
        text = f"silent; {text}"
    values: list[tuple[str, object]] = [
        ("type", one.message_type),
        ("age [s]", age),
        ("rate [Hz]", None if one.rate_hz is None else f"{one.rate_hz:.1f}"),
        ("received", one.received),
        ("dropped", one.dropped),
        ("lost", one.lost),
        *((kind, count) for kind, _, count, _ in faults),
    ]
    return status_message(level, f"belie: input {one.topic}", text, values)


def statuses_of(picture: Picture) -> list[Any]:
    """Everything that a picture holds: the monitor, its inputs, the checks of the last frame."""
    recent = {(fault.topic, fault.kind) for fault in picture.recent_faults()}
    by_topic: dict[str, list[tuple[str, str, int, bool]]] = {}
    for fault in picture.faults:
        now = (fault.topic, fault.kind) in recent
        by_topic.setdefault(fault.topic, []).append((fault.kind, fault.text, fault.count, now))
    own = [f"{kind}: {text}" for kind, text, _, now in by_topic.get("", ()) if now]
    level = WARN if own or not picture.watching else OK
    values: list[tuple[str, object]] = [
        ("state", picture.state),
        *((f"frames {status}", count) for status, count in picture.statuses.items()),
        *((f"alerts {kind}", count) for kind, count in picture.raised.items()),
        *((kind, count) for kind, _, count, _ in by_topic.get("", ())),
        *((f"sink {name} {what}", n) for name, counts in picture.sinks.items() for what, n in counts.items()),
    ]
    statuses = [status_message(level, "belie: monitor", "; ".join(own) or picture.state, values)]
    listed = {one.topic for one in picture.inputs}
    statuses += [input_status(one, by_topic.get(one.topic, [])) for one in picture.inputs]
    for topic, faults in by_topic.items():
        if topic and topic not in listed:
            text = "; ".join(f"{kind}: {text}" for kind, text, _, _ in faults)
            statuses.append(
                status_message(WARN, f"belie: input {topic}", text, [(k, n) for k, _, n, _ in faults])
            )
    silent = {one.topic for one in picture.inputs if one.silent}
    if picture.answer is not None:
        statuses += [
            check_status(check, stale=_is_of(check.source, silent)) for check in picture.answer.verdict.checks
        ]
    return statuses


def _is_of(source: str, topics: set[str]) -> bool:
    return source in topics or f"{source}/compressed" in topics


class DiagnosticsSink(SinkBase):
    """Publishes the picture once a period, and at once where a check's status changes."""

    def __init__(
        self, publish: Callable[[bytes], None], settings: AnswerSettings, picture: Callable[[], Picture]
    ) -> None:
        self._publish, self._settings, self._picture = publish, settings, picture
        self._last_ns = 0
        self._last: tuple[tuple[str, str], ...] = ()

    def answer(self, answer: Answer) -> None:
        """Publish at once where something changed."""
        now = tuple((f"{c.check} {c.source} {c.object}", c.status.value) for c in answer.verdict.checks)
        if now != self._last or answer.verdict.alerts or self._settings.period_s == 0.0:
            self._last = now
            self._send(self._picture(), answer.verdict.stamp_ns)

    def tick(self, picture: Picture) -> None:
        """Publish where a period has passed."""
        if now_ns() - self._last_ns >= max(self._settings.period_s, 0.2) * 1e9:
            stamp_ns = now_ns() if picture.answer is None else picture.answer.verdict.stamp_ns
            self._send(picture, stamp_ns)

    def _send(self, picture: Picture, stamp_ns: int) -> None:
        self._last_ns = now_ns()
        self._publish(array_bytes(stamp_ns, statuses_of(picture)))


class AlertsSink(SinkBase):
    """Publishes the last alerts whenever one is raised, on a latched topic: who comes late sees them, too."""

    def __init__(self, publish: Callable[[bytes], None], picture: Callable[[], Picture]) -> None:
        self._publish, self._picture = publish, picture
        publish(array_bytes(now_ns(), []))

    def answer(self, answer: Answer) -> None:
        """Publish where there is an alert."""
        if answer.verdict.alerts:
            alerts = [alert_status(frame, alert) for frame, alert in self._picture().alerts]
            self._publish(array_bytes(answer.verdict.stamp_ns, alerts))


def alert_status(frame: int, alert: Alert) -> Any:
    """One alert as ``DiagnosticStatus``.

    >>> from belie.types import AlertType
    >>> alert_status(7, Alert(type=AlertType.CAMERA_FAULT, source="/cam", onset_ns=5)).name
    'belie: camera_fault /cam'
    """
    about = f" object {alert.object}" if alert.object else ""
    accused = {} if alert.accused is None else alert.accused.to_json()
    values = [
        ("type", alert.type.value),
        ("source", alert.source),
        ("onset_ns", alert.onset_ns),
        ("object", alert.object),
        ("frame", frame),
        *accused.items(),
    ]
    text = f"the camera contradicts {alert.source}{about} since {alert.onset_ns / 1e9:.3f} s"
    return status_message(ERROR, f"belie: {alert.type.value} {alert.source}{about}", text, values)
