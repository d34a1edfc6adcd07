"""Alerts as JSON by HTTP POST, tried again until they are taken."""

from __future__ import annotations

import json
import os
import urllib.request
from typing import Any

from belie.bridges.board import Answer, Board
from belie.bridges.settings import RetrySettings, WebhookSettings
from belie.bridges.sinks.outlet import Outlet
from belie.bridges.sinks.sink import SinkBase
from belie.types import ConfigError

TOKEN = "BELIE_WEBHOOK_TOKEN"


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """A redirected POST would become a GET without its alerts, and take the token to another host: it fails instead."""

    def redirect_request(self, *_: Any) -> None:
        return None


class WebhookSink(SinkBase):
    """Posts ``{"frame", "stamp_ns", "alerts": [...]}`` for every frame that raises an alert.

    Raises
    ------
    ConfigError
        If the URL is not http or https.
    """

    def __init__(self, settings: WebhookSettings, retry: RetrySettings, board: Board) -> None:
        if not settings.url.startswith(("http://", "https://")):
            raise ConfigError(f"webhook.url {settings.url!r}: expected http:// or https://")
        self._settings = settings
        self._opener = urllib.request.build_opener(_NoRedirect)
        self._outlet: Outlet[dict[str, Any]] = Outlet("webhook", self._post, retry, board.sink("webhook"))

    def answer(self, answer: Answer) -> None:
        """Queue the alerts."""
        verdict = answer.verdict
        if verdict.alerts:
            told = verdict.to_json()
            self._outlet.give({name: told[name] for name in ("frame", "stamp_ns", "alerts")})

    def _post(self, content: dict[str, Any]) -> None:
        headers = {"Content-Type": "application/json", "User-Agent": "belie"}
        if token := os.environ.get(TOKEN):
            headers["Authorization"] = f"Bearer {token}"
        request = urllib.request.Request(
            self._settings.url, data=json.dumps(content).encode(), headers=headers, method="POST"
        )
        with self._opener.open(request, timeout=self._settings.timeout_s):
            pass

    def close(self, timeout_s: float) -> None:
        """Post what waits, once more at most."""
        self._outlet.close(timeout_s)
