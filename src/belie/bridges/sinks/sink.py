"""What a sink is to the session."""

from __future__ import annotations

from typing import Protocol

from belie.bridges.board import Answer, Picture
from belie.bridges.wire import Received


class Sink(Protocol):
    """Takes answers; none of its methods may block or raise."""

    def answer(self, answer: Answer) -> None:
        """A frame was answered."""
        ...

    def received(self, message: Received) -> None:
        """A message came in; called in the middleware's thread."""
        ...

    def tick(self, picture: Picture) -> None:
        """Some tenths of a second have passed."""
        ...

    def close(self, timeout_s: float) -> None:
        """Deliver what waits, within `timeout_s`."""
        ...


class SinkBase:
    """A sink that does nothing: what most of them do with most of it."""

    def answer(self, answer: Answer) -> None:
        """Ignore it."""

    def received(self, message: Received) -> None:
        """Ignore it."""

    def tick(self, picture: Picture) -> None:
        """Ignore it."""

    def close(self, timeout_s: float) -> None:
        """Nothing waits."""
