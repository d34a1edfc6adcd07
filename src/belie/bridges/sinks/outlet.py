"""One sink's thread: a bounded queue, retries with a growing pause, and counts of what was lost."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable
from typing import Generic, TypeVar

from belie.bridges.settings import RetrySettings

T = TypeVar("T")


class Outlet(Generic[T]):
    """Delivers what it is given, in order, in its own thread; `give` never blocks.

    A delivery that raises is tried again after a pause that doubles. Meanwhile later items wait, and where
    too many do, the oldest go and are counted.

    Parameters
    ----------
    name : str
        For the counts and the thread.
    deliver : callable
        Delivers one item; raises where that failed.
    retry : RetrySettings
        Pauses, and how much waits.
    counts : Counter
        ``sent``, ``failed`` and ``dropped`` are counted here.
    tries : int or None
        Give an item up after so many; None: never.

    Examples
    --------
    >>> delivered, counts = [], Counter()
    >>> outlet = Outlet("list", delivered.append, RetrySettings(), counts)
    >>> outlet.give(1); outlet.give(2); outlet.close(1.0)
    >>> delivered, counts["sent"]
    ([1, 2], 2)
    """

    def __init__(
        self,
        name: str,
        deliver: Callable[[T], None],
        retry: RetrySettings,
        counts: Counter[str],
        *,
        tries: int | None = None,
    ) -> None:
        self.last_error = ""
        self._deliver, self._retry, self._counts, self._tries = deliver, retry, counts, tries
        self._waiting: deque[T] = deque()
        self._ready = threading.Condition()
        self._closing = False
        self._busy = False
        self._thread = threading.Thread(target=self._run, name=f"belie-{name}", daemon=True)
        self._thread.start()

    def give(self, item: T) -> None:
        """Queue an item."""
        with self._ready:
            self._waiting.append(item)
            while len(self._waiting) > self._retry.waiting:
                self._waiting.popleft()
                self._counts["dropped"] += 1
            self._ready.notify()

    def close(self, timeout_s: float) -> None:
        """Deliver what waits, for `timeout_s` at most; what is left then is dropped and counted."""
        with self._ready:
            self._closing = True
            self._ready.notify_all()
        self._thread.join(timeout_s)
        with self._ready:
            self._counts["dropped"] += len(self._waiting) + int(self._busy)
            self._waiting.clear()

    def _run(self) -> None:
        while True:
            with self._ready:
                while not self._waiting and not self._closing:
                    self._ready.wait()
                if not self._waiting:
                    return
                item, self._busy = self._waiting.popleft(), True
            delivered = self._try(item)
            self._busy = False
            self._counts["sent" if delivered else "dropped"] += 1

    def _try(self, item: T) -> bool:
        pause_s, tries = self._retry.first_s, 0
        while True:
            try:
                self._deliver(item)
            except Exception as error:  # a sink may fail in any way that its library knows
                self.last_error = f"{type(error).__name__}: {error}"
                self._counts["failed"] += 1
                tries += 1
            else:
                return True
            if self._tries is not None and tries >= self._tries:
                return False
            with self._ready:
                if self._closing:
                    return False
                self._ready.wait_for(lambda: self._closing, pause_s)
            pause_s = min(2.0 * pause_s, self._retry.longest_s)
