"""VDA 5050 over MQTT: a ``state`` at every alert, at every change of what is wrong, and once a period."""

from __future__ import annotations

import json
import os
from typing import Any

from belie.bridges.board import Answer, Board, Picture
from belie.bridges.settings import MqttSettings, RetrySettings
from belie.bridges.sinks.outlet import Outlet
from belie.bridges.sinks.sink import SinkBase
from belie.bridges.sinks.vda5050 import state_of, topic_of
from belie.bridges.wire import now_ns
from belie.types import MissingExtraError

PASSWORD = "BELIE_MQTT_PASSWORD"
_SEND_S = 2.0


class MqttSink(SinkBase):
    """Publishes with QoS 1, and comes back by itself when the broker does.

    Raises
    ------
    MissingExtraError
        Without ``paho-mqtt``.
    """

    def __init__(self, settings: MqttSettings, retry: RetrySettings, board: Board) -> None:
        try:
            import paho.mqtt.client as mqtt
        except ImportError:
            raise MissingExtraError("paho-mqtt", "live") from None
        self._settings = settings
        self._client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, client_id=f"belie-{settings.serial}")
        if settings.username:
            self._client.username_pw_set(settings.username, os.environ.get(PASSWORD))
        if settings.tls:
            self._client.tls_set()
        self._client.reconnect_delay_set(min_delay=1, max_delay=max(1, int(retry.longest_s)))
        self._client.connect_async(settings.host, settings.port)
        self._client.loop_start()
        self._outlet: Outlet[dict[str, Any]] = Outlet("mqtt", self._send, retry, board.sink("mqtt"))
        self._header_id = 0
        self._last_ns = 0
        self._last: str | None = None
        self._urgent = False

    def answer(self, answer: Answer) -> None:
        """Send soon where an alert was raised."""
        self._urgent = self._urgent or bool(answer.verdict.alerts)

    def tick(self, picture: Picture) -> None:
        """Send where there is reason to."""
        state = state_of(picture, self._settings, self._header_id)
        errors = json.dumps([(e["errorType"], e["errorReferences"]) for e in state["errors"]])
        due = now_ns() - self._last_ns >= self._settings.period_s * 1e9
        if self._urgent or due or errors != self._last:
            self._urgent, self._last, self._last_ns = False, errors, now_ns()
            self._header_id += 1
            self._outlet.give(state)

    def _send(self, state: dict[str, Any]) -> None:
        if not self._client.is_connected():
            raise ConnectionError(f"no connection to {self._settings.host}:{self._settings.port}")
        sent = self._client.publish(topic_of(self._settings), json.dumps(state), qos=1)
        sent.wait_for_publish(_SEND_S)
        if not sent.is_published():
            raise TimeoutError("the broker did not acknowledge")

    def close(self, timeout_s: float) -> None:
        """Send what waits, and leave."""
        self._outlet.close(timeout_s)
        self._client.disconnect()
        self._client.loop_stop()
