"""``belie live``: one session from the choice of topics to the last answer."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from belie.bridges.board import Answer, Board, Input, Picture
from belie.bridges.discovery import discover
from belie.bridges.intake import Intake
from belie.bridges.introduction import TF_STATIC, Introduction
from belie.bridges.monitor import Monitor
from belie.bridges.settings import LiveSettings
from belie.bridges.sinks.opening import open_all, sinks_for
from belie.bridges.sinks.sink import Sink
from belie.bridges.wire import Received, Transport, now_ns
from belie.recordings import topics as ros

Outcome = Literal["stop", "reload"]

_TICK_S = 0.1
_LOOK_S = 1.0  # between two looks at what others publish
_STOP_S = 1.5  # for the sinks; with the worker's last frame, less than the promised 2 s
# What waits in the middleware while our threads get no processor: a second, so that drops happen where we count them.
_IMAGE_DEPTH, _CLAIM_DEPTH, _LATCHED_DEPTH = 30, 1000, 100


class LiveSession:
    """One session on an open transport.

    Parameters
    ----------
    transport : Transport
        Open; stays open.
    settings : LiveSettings
        All settings.
    json : Path, optional
        Where the lines of ``belie check --json`` go.
    dashboard : bool
        Draw the state on the terminal.
    on_event : callable
        Is told what happens, a line at a time.
    """

    def __init__(
        self,
        transport: Transport,
        settings: LiveSettings,
        *,
        json: Path | None = None,
        dashboard: bool = False,
        on_event: Callable[[str], None],
    ) -> None:
        self._transport, self._settings, self._json = transport, settings, json
        self._dashboard = dashboard
        self._on_event = on_event
        self._requested: Outcome | None = None
        self._choice: ros.Choice | None = None
        self._intake: Intake | None = None
        self._sinks: list[Sink] = []
        self._told_late: set[str] = set()
        self._overflows: Counter[str] = Counter()
        self.board = Board(alerts_kept=settings.answers.alerts_kept)

    def request(self, outcome: Outcome) -> None:
        """Ask the session to end; may be called from a signal handler."""
        self._requested = outcome

    def run(self) -> Outcome:
        """Watch until asked to end.

        Raises
        ------
        AmbiguousTopicError
            If several topics would do.
        """
        choice = discover(
            self._transport,
            self._settings.topics,
            self._settings.intake,
            stopped=lambda: self._requested is not None,
            on_waiting=self._wait,
        )
        if choice is not None:
            self._watch(choice)
        return self._requested or "stop"

    def _wait(self, why: str) -> None:
        self.board.state = f"waiting: {why}"
        self._on_event(self.board.state)

    def _watch(self, choice: ros.Choice) -> None:
        self._on_event("topics: " + ", ".join(f"{topic.role} {topic.name}" for topic in choice.all))
        self._choice = choice
        limits = self._settings.intake
        self._intake = intake = Intake(choice.image.name, frames=limits.start_frames, claims=limits.claims)
        self._sinks = open_all(
            sinks_for(
                self._settings,
                transport=self._transport,
                board=self.board,
                picture=self.picture,
                choice=choice,
                json=self._json,
                dashboard=self._dashboard,
                on_event=self._on_event,
            )
        )
        introduction = Introduction(choice, info_by_name=self._settings.topics.camera_info is not None)
        monitor = Monitor(introduction, self._settings, intake, self.board, self._answer, self._on_event)
        stop = threading.Event()
        worker = threading.Thread(target=monitor.run, args=(stop,), name="belie-monitor", daemon=True)
        worker.start()
        try:
            self._subscribe(choice)
            self._tick_until_requested()
        finally:  # a topic that cannot be subscribed must leave nothing behind for the next session
            stop.set()
            intake.wake()
            worker.join(_STOP_S)
            self._close_sinks()
            self._transport.reset()

    def _subscribe(self, choice: ros.Choice) -> None:
        subscribe = self._transport.subscribe
        subscribe(TF_STATIC, ros.TRANSFORMS, self._receive, latched=True, depth=_LATCHED_DEPTH)
        # Images last: who sees that we listen to them may begin.
        for topic in reversed(choice.all):
            depth = _IMAGE_DEPTH if topic is choice.image else _CLAIM_DEPTH
            subscribe(topic.name, topic.message_type, self._receive, latched=False, depth=depth)

    def _receive(self, message: Received) -> None:
        """In the middleware's thread."""
        if self._intake is not None and self._requested is None:
            self._intake.receive(message)
            for sink in self._sinks:
                sink.received(message)

    def _answer(self, answer: Answer) -> None:
        for sink in self._sinks:
            sink.answer(answer)

    def _tick_until_requested(self) -> None:
        looked_s = 0.0
        while self._requested is None:
            if time.monotonic() - looked_s > _LOOK_S:
                looked_s = time.monotonic()
                self._look_around()
            picture = self.picture()
            for sink in self._sinks:
                sink.tick(picture)
            time.sleep(_TICK_S)

    def _close_sinks(self) -> None:
        deadline_s = time.monotonic() + _STOP_S
        closing = [threading.Thread(target=sink.close, args=(_STOP_S,), daemon=True) for sink in self._sinks]
        for thread in closing:
            thread.start()
        for thread in closing:
            thread.join(max(0.0, deadline_s - time.monotonic()))

    def _look_around(self) -> None:
        """Name what is wrong with the links: types, QoS, topics that came too late to be chosen."""
        if self._choice is None:
            return
        for topic, text in self._transport.faults().items():
            self.board.fault(topic, "QoS mismatch", text)
        self._name_floods(self._choice)
        used = {topic.name: topic.message_type for topic in self._choice.all}
        roles = {topic.role for topic in self._choice.all}
        for offer in self._transport.offers():
            if offer.topic in used and offer.message_type != used[offer.topic]:
                self.board.fault(
                    offer.topic,
                    "type mismatch",
                    f"published as {offer.message_type}; subscribed as {used[offer.topic]}",
                )
            role = ros.Topic(name=offer.topic, message_type=offer.message_type, count=1).role
            missing = role in ("odometry", "position", "imu", "detections") and role not in roles
            named = getattr(self._settings.topics, role, None) if missing else None
            if missing and named is None and offer.topic not in self._told_late:
                self._told_late.add(offer.topic)
                self._on_event(f"{offer.topic} ({role}) appeared after the start; SIGHUP takes it in")

    def _name_floods(self, choice: ros.Choice) -> None:
        """Images are dropped by design where belie is slow; of other topics as much waits as any robot should send."""
        if self._intake is None:
            return
        overflows = Counter(self._intake.overflows)
        for topic in choice.all:
            more = overflows[topic.name] - self._overflows[topic.name]
            if more > 0 and topic is not choice.image:
                text = (
                    f"{more} messages dropped since the last look, for belie had not read those before them"
                )
                self.board.fault(topic.name, "flood", text)
        self._overflows = overflows

    def picture(self) -> Picture:
        """What is known now."""
        return self.board.picture(self._inputs())

    def _inputs(self) -> tuple[Input, ...]:
        intake, choice = self._intake, self._choice
        if intake is None or choice is None:
            return ()
        now = now_ns()
        lost = self._transport.lost()
        inputs = []
        for topic in choice.all:
            last_ns, period_ns = intake.last_ns.get(topic.name), intake.period_ns.get(topic.name)
            age_s = None if last_ns is None else (now - last_ns) * 1e-9
            # Camera info may be latched, and then comes once.
            patience_s = max(self._settings.answers.stale_after_s, 5e-9 * (period_ns or 0.0))
            silent = topic is not choice.camera_info and (age_s is None or age_s > patience_s)
            inputs.append(
                Input(
                    topic=topic.name,
                    message_type=topic.message_type,
                    received=intake.received[topic.name],
                    dropped=intake.dropped[topic.name],
                    lost=lost.get(topic.name, 0),
                    age_s=age_s,
                    rate_hz=1e9 / period_ns if period_ns else None,
                    silent=silent,
                )
            )
        return tuple(inputs)
