"""Between the middleware's threads and ours: the newest images, the last claims, nothing that grows."""

from __future__ import annotations

import threading
from collections import Counter, deque

from belie.bridges.wire import Received


class Intake:
    """Messages waiting for the worker. `receive` never blocks for long; what finds no place is dropped and counted.

    Parameters
    ----------
    image : str
        The image topic: `frames` of its messages wait, the newest win.
    frames, claims : int
        How many messages wait at most: images, and those of each other topic.

    Examples
    --------
    >>> intake = Intake("/image", frames=1, claims=10)
    >>> for stamp in (1, 2):
    ...     intake.receive(Received(topic="/image", message_type="", data=b"", received_ns=stamp))
    >>> [message.received_ns for message in intake.take(0.0)], intake.dropped["/image"]
    ([2], 1)
    """

    def __init__(self, image: str, *, frames: int, claims: int) -> None:
        self.image = image
        self.dropped: Counter[str] = Counter()
        self.overflows: Counter[str] = Counter()  # those of `dropped` that found no place here
        self.received: Counter[str] = Counter()
        self.last_ns: dict[str, int] = {}
        self.period_ns: dict[str, float] = {}
        self._frames, self._claims = frames, claims
        self._waiting: dict[str, deque[Received]] = {}
        self._ready = threading.Condition()

    def hold_frames(self, frames: int) -> None:
        """Let so many images wait from now on."""
        with self._ready:
            self._frames = frames

    def receive(self, message: Received) -> None:
        """Take a message; called by the middleware."""
        topic = message.topic
        with self._ready:
            waiting = self._waiting.setdefault(topic, deque())
            waiting.append(message)
            most = self._frames if topic == self.image else self._claims
            while len(waiting) > most:
                waiting.popleft()
                self.dropped[topic] += 1
                self.overflows[topic] += 1
            self.received[topic] += 1
            self._note_period(topic, message.received_ns)
            self._ready.notify()

    def _note_period(self, topic: str, received_ns: int) -> None:
        last_ns = self.last_ns.get(topic)
        self.last_ns[topic] = received_ns
        if last_ns is not None:
            step = float(received_ns - last_ns)
            period = self.period_ns.get(topic, step)
            # A pause is no period: it must not teach us to be patient with the next one.
            self.period_ns[topic] = period + 0.1 * (min(step, 3.0 * period) - period)

    def take(self, timeout_s: float) -> list[Received]:
        """All that waits, in order of receipt; waits up to `timeout_s` for a first message."""
        with self._ready:
            if not any(self._waiting.values()):
                self._ready.wait(timeout_s)
            taken = [message for waiting in self._waiting.values() for message in waiting]
            for waiting in self._waiting.values():
                waiting.clear()
        taken.sort(key=lambda message: message.received_ns)
        return taken

    def wake(self) -> None:
        """Let a waiting `take` return."""
        with self._ready:
            self._ready.notify_all()
