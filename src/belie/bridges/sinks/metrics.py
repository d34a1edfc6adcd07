"""Prometheus: ``--metrics 127.0.0.1:9464``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from belie.bridges.board import Answer, Picture
from belie.bridges.sinks.sink import SinkBase
from belie.types import ConfigError, MissingExtraError, TransportError

_BUCKETS_S = (0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.15, 0.25, 0.5, 1.0, 2.5)


def address_of(text: str) -> tuple[str, int]:
    """Host and port of ``HOST:PORT``.

    Raises
    ------
    ConfigError
        If it is none.

    Examples
    --------
    >>> address_of("127.0.0.1:9464")
    ('127.0.0.1', 9464)
    """
    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise ConfigError(f"metrics {text!r}: expected HOST:PORT, e.g. 127.0.0.1:9464")
    return host, int(port)


class MetricsSink(SinkBase):
    """Serves metrics over HTTP. What the board counts is read when somebody asks.

    Raises
    ------
    MissingExtraError
        Without ``prometheus_client``.
    TransportError
        If the address cannot be listened to.
    """

    def __init__(self, address: str, picture: Callable[[], Picture]) -> None:
        try:
            import prometheus_client as prom
        except ImportError:
            raise MissingExtraError("prometheus_client", "live") from None
        host, port = address_of(address)
        registry = prom.CollectorRegistry()
        self._latency = prom.Histogram(
            "belie_answer_latency_seconds",
            "from the receipt of an image to its verdict",
            buckets=_BUCKETS_S,
            registry=registry,
        )
        self._checking = prom.Histogram(
            "belie_check_latency_seconds", "of the detector alone", buckets=_BUCKETS_S, registry=registry
        )
        registry.register(_BoardCollector(picture))
        try:
            self._server, self._thread = prom.start_http_server(port, addr=host, registry=registry)
        except OSError as error:
            raise TransportError(f"metrics {address}: {error.strerror or error}") from None

    def answer(self, answer: Answer) -> None:
        """Observe the latencies."""
        self._latency.observe((answer.answered_ns - answer.frame.received_ns) * 1e-9)
        self._checking.observe(answer.verdict.latency_ms * 1e-3)

    def close(self, timeout_s: float) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(timeout_s)


class _BoardCollector:
    """The board's counts as metrics, read when they are asked for."""

    def __init__(self, picture: Callable[[], Picture]) -> None:
        self._picture = picture

    def collect(self) -> Iterator[Any]:
        from prometheus_client.core import CounterMetricFamily as Counts
        from prometheus_client.core import GaugeMetricFamily as Gauge

        picture = self._picture()
        frames = Counts("belie_frames", "frames answered, by overall status", labels=["status"])
        for status, count in picture.statuses.items():
            frames.add_metric([status], count)
        alerts = Counts("belie_alerts", "alerts raised, by type", labels=["type"])
        for kind, count in picture.raised.items():
            alerts.add_metric([kind], count)
        undecided = Counts(
            "belie_undecided", "undecided answers of single checks, by reason", labels=["reason"]
        )
        for reason, count in picture.undecided.items():
            undecided.add_metric([reason], count)
        received = Counts("belie_received", "messages received", labels=["topic"])
        drops = Counts("belie_drops", "messages dropped because belie was late", labels=["topic"])
        lost = Counts("belie_lost", "messages that the network lost, where it tells", labels=["topic"])
        age = Gauge("belie_input_age_seconds", "since the last message", labels=["topic"])
        for one in picture.inputs:
            received.add_metric([one.topic], one.received)
            drops.add_metric([one.topic], one.dropped)
            lost.add_metric([one.topic], one.lost)
            if one.age_s is not None:
                age.add_metric([one.topic], one.age_s)
        faults = Counts("belie_faults", "faults met, by input and kind", labels=["topic", "kind"])
        for fault in picture.faults:
            faults.add_metric([fault.topic, fault.kind], fault.count)
        sinks = Counts("belie_sink", "what became of answers, by sink", labels=["sink", "outcome"])
        for name, counts in picture.sinks.items():
            for outcome, count in counts.items():
                sinks.add_metric([name, outcome], count)
        watching = Gauge("belie_watching", "1 while frames are being checked", value=float(picture.watching))
        yield from (frames, alerts, undecided, received, drops, lost, age, faults, sinks, watching)
