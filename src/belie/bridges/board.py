"""What is known of the running monitor, for every sink alike: inputs, faults, the last answer, counts."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from belie.bridges.wire import now_ns
from belie.types import Alert, Frame, Status, Verdict

FAULT_SHOWN_NS = 10_000_000_000
_MOST_REASONS = 200  # distinct ones: objects may have names that never come again


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """A verdict and its way through belie.

    Parameters
    ----------
    verdict : Verdict
        The answer.
    frame : Frame
        The image that it is about.
    decode_ms : float
        What decoding it took.
    answered_ns : int
        When the verdict was there; `frame.received_ns` says when the image was.
    """

    verdict: Verdict
    frame: Frame
    decode_ms: float
    answered_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Something wrong with an input, or with belie's surroundings.

    Parameters
    ----------
    topic : str
        Which input; empty for the monitor itself.
    kind : str
        A name that stays the same: ``malformed message``, ``clock jump`` …
    text : str
        What exactly was last seen.
    count : int
        How often, since the start.
    last_ns : int
        When, last.
    """

    topic: str
    kind: str
    text: str
    count: int
    last_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """One input as it stands; times in seconds, None where nothing has come yet.

    `dropped` messages came and found belie late, `lost` ones never came.
    """

    topic: str
    message_type: str
    received: int
    dropped: int
    lost: int
    age_s: float | None
    rate_hz: float | None
    silent: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Picture:
    """All of it at one moment."""

    state: str
    watching: bool
    inputs: tuple[Input, ...]
    faults: tuple[Fault, ...]
    answer: Answer | None
    alerts: tuple[tuple[int, Alert], ...]
    statuses: Mapping[str, int]
    undecided: Mapping[str, int]
    raised: Mapping[str, int]
    sinks: Mapping[str, Mapping[str, int]]

    def recent_faults(self) -> tuple[Fault, ...]:
        """Those of the last ten seconds."""
        since_ns = now_ns() - FAULT_SHOWN_NS
        return tuple(fault for fault in self.faults if fault.last_ns >= since_ns)


@dataclass(slots=True)
class Board:
    """Where worker, transport and sinks note what they met; safe between threads, and bounded.

    Examples
    --------
    >>> board = Board()
    >>> board.fault("/odom", "malformed message", "12 bytes")
    >>> board.fault("/odom", "malformed message", "13 bytes")
    >>> [(fault.count, fault.text) for fault in board.faults()]
    [(2, '13 bytes')]
    """

    alerts_kept: int = 50
    state: str = "starting"
    watching: bool = False
    answer: Answer | None = None
    statuses: Counter[str] = field(default_factory=Counter)
    undecided: Counter[str] = field(default_factory=Counter)
    raised: Counter[str] = field(default_factory=Counter)
    sinks: dict[str, Counter[str]] = field(default_factory=dict)
    alerts: deque[tuple[int, Alert]] = field(default_factory=deque)
    _faults: dict[tuple[str, str], Fault] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def fault(self, topic: str, kind: str, text: str) -> None:
        """Note a fault; one of the same topic and kind is counted, and its text renewed."""
        with self._lock:
            known = self._faults.get((topic, kind))
            count = 1 if known is None else known.count + 1
            fault = Fault(topic=topic, kind=kind, text=text, count=count, last_ns=now_ns())
            self._faults[topic, kind] = fault

    def faults(self) -> tuple[Fault, ...]:
        """All faults so far, one for each topic and kind."""
        with self._lock:
            return tuple(self._faults.values())

    def note(self, answer: Answer) -> None:
        """Note an answer."""
        verdict = answer.verdict
        with self._lock:
            self.answer = answer
            self.statuses[verdict.status.value] += 1
            for check in verdict.checks:
                if check.status is Status.UNDECIDED:
                    reason = _without_numbers(check.reason)
                    full = len(self.undecided) >= _MOST_REASONS and reason not in self.undecided
                    self.undecided["other" if full else reason] += 1
            for alert in verdict.alerts:
                self.raised[alert.type.value] += 1
                self.alerts.append((verdict.frame, alert))
            while len(self.alerts) > self.alerts_kept:
                self.alerts.popleft()

    def sink(self, name: str) -> Counter[str]:
        """The counts of one sink: ``sent``, ``dropped``, ``failed``."""
        with self._lock:
            return self.sinks.setdefault(name, Counter())

    def picture(self, inputs: tuple[Input, ...]) -> Picture:
        """All of it, with the inputs as the intake knows them."""
        with self._lock:
            return Picture(
                state=self.state,
                watching=self.watching,
                inputs=inputs,
                faults=tuple(self._faults.values()),
                answer=self.answer,
                alerts=tuple(self.alerts),
                statuses=dict(self.statuses),
                undecided=dict(self.undecided),
                raised=dict(self.raised),
                sinks={name: dict(counts) for name, counts in self.sinks.items()},
            )


def _without_numbers(reason: str) -> str:
    """A reason as a label: its numbers differ with every frame."""
    return "".join("#" if c.isdigit() else c for c in reason).replace("##", "#").replace("##", "#")[:120]
