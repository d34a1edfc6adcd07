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
from belie.bridges.sinks.sink import Sink
from belie.bridges.wire import Transport
from belie.recordings import topics as ros

_CLOSE_S = 0.5


def open_sinks(
    settings: LiveSettings,
    *,
    transport: Transport,
    board: Board,
    picture: Callable[[], Picture],
    choice: ros.Choice,
    json: Path | None,
    dashboard: bool,
    on_event: Callable[[str], None],
) -> list[Sink]:
    """Open every sink that is asked for.

    Raises
    ------
    MissingExtraError, TransportError
        If one of them cannot work: told at the start, not after the first alert. Those that were open by then are
        closed, so that the settings of before can be opened again.
    """
    sinks: list[Sink] = []
    with ExitStack() as opened:
        for sink in _sinks(
            settings,
            transport=transport,
            board=board,
            picture=picture,
            choice=choice,
            json=json,
            dashboard=dashboard,
            on_event=on_event,
        ):
            opened.callback(sink.close, _CLOSE_S)
            sinks.append(sink)
        opened.pop_all()
    return sinks


def _sinks(
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
    answers = settings.answers

    def publisher(topic: str, message_type: str, *, latched: bool) -> Callable[[bytes], None]:
        # In a thread of its own: a middleware whose peer is slow may block a writer.
        publish = transport.advertise(topic, message_type, latched=latched).publish
        outlet: Outlet[bytes] = Outlet(topic, publish, settings.retry, board.sink(topic), tries=3)
        return outlet.give

    if answers.diagnostics:
        publish = publisher(answers.diagnostics, DIAGNOSTICS, latched=False)
        yield DiagnosticsSink(publish, answers, picture)
    if answers.alerts:
        yield AlertsSink(publisher(answers.alerts, DIAGNOSTICS, latched=True), picture)
    if answers.annotated:
        from belie.bridges.sinks.annotated import AnnotatedSink

        publish = publisher(answers.annotated, ros.COMPRESSED, latched=False)
        yield AnnotatedSink(publish, answers.annotated_hz)
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
