"""From the settings to the sinks that they ask for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

from belie.bridges.board import Board, Picture
from belie.bridges.introduction import TF_STATIC
from belie.bridges.settings import LiveSettings
from belie.bridges.sinks.diagnostics import DIAGNOSTICS, AlertsSink, DiagnosticsSink
from belie.bridges.sinks.outlet import Outlet
from belie.bridges.sinks.sink import Sink, SinkBase
from belie.bridges.wire import Transport
from belie.recordings import topics as ros

_CLOSE_S = 0.5


class _Topic(SinkBase):
    """One topic of ours, in a thread of its own: a middleware whose peer is slow may block a writer."""

    def __init__(self, outlet: Outlet[bytes]) -> None:
        self._outlet = outlet
        self.publish = outlet.give

    def close(self, timeout_s: float) -> None:
        """Publish what waits, and end the thread."""
        self._outlet.close(timeout_s)


def open_all(sinks: Iterator[Sink]) -> list[Sink]:
    """Open every sink of `sinks_for`.

    Raises
    ------
    MissingExtraError, TransportError
        If one of them cannot work: told at the start, not after the first alert. Those that were open by then are
        closed, so that the settings of before can be opened again.
    """
    open_ones: list[Sink] = []
    with ExitStack() as opened:
        for sink in sinks:
            opened.callback(sink.close, _CLOSE_S)
            open_ones.append(sink)
        opened.pop_all()
    return open_ones


def sinks_for(
    settings: LiveSettings,
    *,
    transport: Transport,
    board: Board,
    picture: Callable[[], Picture],
    choice: ros.Choice,
    json: Path | None,
    dashboard: bool,
    on_event: Callable[[str], None],
) -> Iterator[Sink]:
    """Every sink that is asked for, each opened when it is its turn; see `open_all`."""
    answers = settings.answers

    def topic_of_ours(topic: str, message_type: str, *, latched: bool) -> _Topic:
        publisher = transport.advertise(topic, message_type, latched=latched)
        return _Topic(Outlet(topic, publisher.publish, settings.retry, board.sink(topic), tries=3))

    # Each topic comes before the sink that publishes on it: it is closed even where that one cannot be opened.
    if answers.diagnostics:
        yield (topic := topic_of_ours(answers.diagnostics, DIAGNOSTICS, latched=False))
        yield DiagnosticsSink(topic.publish, answers, picture)
    if answers.alerts:
        yield (topic := topic_of_ours(answers.alerts, DIAGNOSTICS, latched=True))
        yield AlertsSink(topic.publish, picture)
    if answers.annotated:
        from belie.bridges.sinks.annotated import AnnotatedSink

        yield (topic := topic_of_ours(answers.annotated, ros.COMPRESSED, latched=False))
        yield AnnotatedSink(topic.publish, answers.annotated_hz)
    if json is not None:
        from belie.bridges.sinks.json_lines import JsonLinesSink

        yield JsonLinesSink(json, board, settings.retry)
    if settings.metrics:
        from belie.bridges.sinks.metrics import MetricsSink

        yield MetricsSink(settings.metrics, picture)
    if settings.evidence.folder:
        from belie.bridges.sinks.evidence import EvidenceSink

        lasting = (TF_STATIC, choice.camera_info.name)
        yield EvidenceSink(settings.evidence, lasting, board, on_event)
    if settings.mqtt.host:
        from belie.bridges.sinks.mqtt import MqttSink

        yield MqttSink(settings.mqtt, settings.retry, board)
    if settings.webhook.url:
        from belie.bridges.sinks.webhook import WebhookSink

        yield WebhookSink(settings.webhook, settings.retry, board)
    if dashboard:
        from belie.bridges.sinks.dashboard import DashboardSink

        yield DashboardSink()
