"""What was received around an alert, kept: a ring in memory before it, a bag on disk from then on."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from belie.bridges.board import Answer, Board, Picture
from belie.bridges.settings import EvidenceSettings
from belie.bridges.sinks.diagnostics import DIAGNOSTICS, alert_status, array_bytes
from belie.bridges.sinks.evidence_bag import PREFIX, EvidenceBag, clear_unfinished, keep_quota
from belie.bridges.sinks.sink import SinkBase
from belie.bridges.wire import Received, now_ns

_LASTING_KEPT = 100  # distinct transforms


class EvidenceSink(SinkBase):
    """Keeps the last seconds of every input; on an alert they and the next seconds become a bag.

    The bag is written while it grows, so that little is left to do when belie is stopped. A further alert
    prolongs it, up to ``longest_s``.

    Parameters
    ----------
    settings : EvidenceSettings
        Folder, seconds, limits.
    lasting : tuple of str
        Topics whose last messages every bag needs, however old: transforms, camera info.
    board : Board
        Where troubles go.
    on_event : callable
        Is told of every bag.
    """

    def __init__(
        self,
        settings: EvidenceSettings,
        lasting: tuple[str, ...],
        board: Board,
        on_event: Callable[[str], None],
    ) -> None:
        self._settings, self._lasting_topics = settings, lasting
        self._board, self._on_event = board, on_event
        self._folder = Path(settings.folder)
        self._counts = board.sink("evidence")
        self._lasting: dict[str, deque[Received]] = {}
        self._ring: deque[Received] = deque()
        self._ring_bytes = 0
        self._queue: deque[Received | str | None] = deque()  # a bag's name, its messages, None where it ends
        self._queue_bytes = 0
        self._open_ns: int | None = None
        self._until_ns = 0
        self._ready = threading.Condition()
        self._stopping = False
        clear_unfinished(self._folder)
        self._thread = threading.Thread(target=self._run, name="belie-evidence", daemon=True)
        self._thread.start()

    # -- what comes in -------------------------------------------------------------------------------

    def received(self, message: Received) -> None:
        """Keep a message."""
        with self._ready:
            if message.topic in self._lasting_topics:
                kept = self._lasting.setdefault(
                    message.topic, deque(maxlen=_LASTING_KEPT if message.topic == "/tf_static" else 1)
                )
                if all(message.data != old.data for old in kept):
                    kept.append(message)
            if self._open_ns is not None:
                self._enqueue(message)
                return
            self._ring.append(message)
            self._ring_bytes += len(message.data)
            oldest_ns = message.received_ns - self._settings.before_s * 1e9
            most = self._settings.memory_mb * 1e6
            while self._ring and (self._ring[0].received_ns < oldest_ns or self._ring_bytes > most):
                self._ring_bytes -= len(self._ring.popleft().data)

    def _enqueue(self, message: Received) -> None:
        if self._queue_bytes > self._settings.memory_mb * 1e6:
            self._counts["dropped"] += 1  # the disk is too slow
            return
        self._queue.append(message)
        self._queue_bytes += len(message.data)
        self._ready.notify()

    def answer(self, answer: Answer) -> None:
        """On an alert, open a bag or prolong the open one."""
        if not answer.verdict.alerts:
            return
        told = [alert_status(answer.verdict.frame, alert) for alert in answer.verdict.alerts]
        now = now_ns()
        with self._ready:
            if self._open_ns is None:
                self._open_ns = now
                moment = datetime.fromtimestamp(now * 1e-9, tz=UTC).strftime("%Y%m%dT%H%M%S.%f")[:-3]
                self._queue.append(f"{PREFIX}{moment}Z-{answer.verdict.alerts[0].type.value}")
                start_ns = self._ring[0].received_ns if self._ring else now
                in_ring = set(map(id, self._ring))
                for kept in self._lasting.values():
                    for message in kept:
                        if id(message) not in in_ring:
                            self._enqueue(_at(message, start_ns))
                for message in self._ring:
                    self._enqueue(message)
                self._ring.clear()
                self._ring_bytes = 0
            longest_ns = self._open_ns + round(self._settings.longest_s * 1e9)
            self._until_ns = min(now + round(self._settings.after_s * 1e9), longest_ns)
            note = array_bytes(answer.verdict.stamp_ns, told)
            self._enqueue(
                Received(topic="/belie/alerts", message_type=DIAGNOSTICS, data=note, received_ns=now)
            )

    def tick(self, picture: Picture) -> None:
        """Close the bag when its time has come."""
        with self._ready:
            if self._open_ns is not None and now_ns() >= self._until_ns:
                self._finish()

    def _finish(self) -> None:
        self._open_ns = None
        self._queue.append(None)
        self._ready.notify()

    def close(self, timeout_s: float) -> None:
        """Finish an open bag with what there is."""
        with self._ready:
            if self._open_ns is not None:
                self._finish()
            self._stopping = True
            self._ready.notify()
        self._thread.join(timeout_s)

    # -- the thread that writes ----------------------------------------------------------------------

    def _run(self) -> None:
        bag: EvidenceBag | None = None
        while True:
            with self._ready:
                while not self._queue and not self._stopping:
                    self._ready.wait()
                if not self._queue:
                    return
                batch = list(self._queue)
                self._queue.clear()
                self._queue_bytes = 0
            for entry in batch:
                try:
                    bag = self._write(bag, entry)
                except Exception as error:  # a full or missing disk must not end the watch
                    self._counts["failed"] += 1
                    self._board.fault("", "evidence not written", f"{type(error).__name__}: {error}")
                    if bag is not None:
                        bag.abandon()
                    bag = None

    def _write(self, bag: EvidenceBag | None, entry: Received | str | None) -> EvidenceBag | None:
        """Begin, continue or end a bag; without one (it failed), messages pass until the next begins."""
        if isinstance(entry, str):
            return EvidenceBag(self._folder, entry)
        if bag is None:
            return None
        if entry is not None:
            bag.write(entry)
            return bag
        path = bag.close()
        self._counts["sent"] += 1
        removed = keep_quota(self._folder, self._settings.quota_mb * 1e6)
        gone = f"; removed {', '.join(old.name for old in removed)} (quota)" if removed else ""
        self._on_event(f"evidence: {path}{gone}")
        return None


def _at(message: Received, received_ns: int) -> Received:
    """A lasting message as if it had come with the first of the ring, so that a reader finds it at once."""
    return Received(
        topic=message.topic,
        message_type=message.message_type,
        data=message.data,
        received_ns=received_ns,
    )
