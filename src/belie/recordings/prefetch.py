"""Reading ahead in a thread, with a bound on what waits."""

from __future__ import annotations

import queue
import threading
from collections.abc import Generator
from typing import TypeVar

from belie.recordings.join import DecodedFrame

T = TypeVar("T")

_POLL_S = 0.05
_BATCH = 256


def prefetch(items: Generator[T, None, None], *, depth: int = 4) -> Generator[T, None, None]:
    """Run `items` in a thread that stays at most `depth` frames ahead of the consumer.

    Reading and decoding release the GIL for most of their time, so the check runs beside them. What
    `items` raises is raised here; closing this iterator stops the thread and closes `items`.

    >>> list(prefetch(number * number for number in range(4)))
    [0, 1, 4, 9]
    """
    ready: queue.Queue[list[T] | BaseException | None] = queue.Queue(maxsize=depth)
    stop = threading.Event()

    def offer(entry: list[T] | BaseException | None) -> bool:
        while not stop.is_set():
            try:
                ready.put(entry, timeout=_POLL_S)
            except queue.Full:
                continue
            return True
        return False

    def run() -> None:
        batch: list[T] = []
        try:
            for item in items:
                batch.append(item)
                # Frames are what is large, so a batch ends with one; the bound is for streams without.
                if isinstance(item, DecodedFrame) or len(batch) >= _BATCH:
                    if not offer(batch):
                        return
                    batch = []
            offer(batch)
            offer(None)
        except BaseException as error:  # handed to the consumer, whatever it is
            offer(error)
        finally:
            items.close()

    thread = threading.Thread(target=run, name="belie-prefetch", daemon=True)
    thread.start()
    try:
        while (entry := ready.get()) is not None:
            if isinstance(entry, BaseException):
                raise entry
            yield from entry
    finally:
        stop.set()
        thread.join()
