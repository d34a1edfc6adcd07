"""The worker between intake and sinks: waits for the robot to introduce itself, then watches; survives what comes."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from belie.bridges.board import Answer, Board
from belie.bridges.intake import Intake
from belie.bridges.introduction import TF_STATIC, Introduction
from belie.bridges.pipeline import Pipeline, WatchBroken, decode_image
from belie.bridges.settings import LiveSettings
from belie.bridges.wire import Received, now_ns
from belie.detector import Config, Detector
from belie.geometry import SE3, CameraModel
from belie.recordings.images import GrayDecoder, UndecodableImageError
from belie.recordings.messages import STORE
from belie.recordings.vision_messages import VISION_TYPES
from belie.types import BelieError, MountedCamera, TopicError

_IDLE_S = 0.05
_WAITING_S = 0.002  # while a frame waits for its claims

assert VISION_TYPES  # importing registers them with STORE


def warm_up(config: Config) -> None:
    """Compile every kernel, so that the robot's first frame need not wait for it.

    >>> warm_up(Config())
    """
    model = CameraModel(width=64, height=48, fx=60.0, fy=60.0, cx=31.5, cy=23.5)
    Detector({"": MountedCamera(model=model, T_body_cam=SE3.identity())}, config)


class Monitor:
    """Reads messages from the intake, and hands every answer to `on_answer`; runs in a thread of its own.

    Parameters
    ----------
    introduction : Introduction
        Of the robot, as far as it is known.
    settings : LiveSettings
        All settings.
    intake : Intake
        Where messages come from.
    board : Board
        Where faults go.
    on_answer : callable
        Must not block.
    """

    def __init__(
        self,
        introduction: Introduction,
        settings: LiveSettings,
        intake: Intake,
        board: Board,
        on_answer: Callable[[Answer], None],
        on_event: Callable[[str], None],
    ) -> None:
        self._introduction, self._settings = introduction, settings
        self._intake, self._board = intake, board
        self._on_answer, self._on_event = on_answer, on_event
        self._pipeline: Pipeline | None = None
        self._decoder = GrayDecoder(introduction.choice.image.name)
        self._backlog: dict[str, deque[Received]] = {}
        self._camera_known_ns: int | None = None
        self._body_unproven = False  # no odometry was heard when the watch began
        self._tf_seen: set[bytes] = set()
        self._info_seen = b""

    def run(self, stop: threading.Event) -> None:
        """Work until `stop` is set; what waits then is not answered."""
        self._intake.hold_frames(self._settings.intake.start_frames)
        while not stop.is_set():
            waits = self._pipeline is not None and self._pipeline.waiting > 0
            batch = self._intake.take(_WAITING_S if waits else _IDLE_S)
            clock_ns = now_ns()
            for received in batch:
                if stop.is_set():
                    return
                if not self._guarded(self._hear, received):
                    self._guarded(self._hear, received)  # the first message of the new watch
            self._guarded(self._release, clock_ns)
            if self._pipeline is None:
                self._guarded(self._try_to_begin, clock_ns)
            else:
                self._guarded(Pipeline.look, self._pipeline)

    def _guarded(self, act: Callable[[Any], None], argument: Any) -> bool:
        """Nothing that a message holds may end the monitor; False where the watch broke."""
        try:
            act(argument)
        except WatchBroken as broken:
            self._begin_anew(str(broken))
            return False
        except Exception as error:
            self._begin_anew(f"a fault of belie itself: {type(error).__name__}: {error}")
            return False
        return True

    def _begin_anew(self, why: str) -> None:
        self._board.fault("", why.partition(":")[0], why)
        self._on_event(f"watch begins anew: {why}")
        if self._pipeline is not None:
            self._intake.dropped[self._intake.image] += self._pipeline.waiting
        self._pipeline = None
        for topic, kept in self._backlog.items():
            self._intake.dropped[topic] += len(kept)
        self._backlog.clear()

    # -- one message ---------------------------------------------------------------------------------

    def _hear(self, received: Received) -> None:
        if self._pipeline is not None:
            self._release(received.received_ns)
        message = self._read(received)
        if message is None:
            return
        topic, choice = received.topic, self._introduction.choice
        if topic == TF_STATIC:
            self._hear_frames(received, message)
        elif topic == choice.camera_info.name:
            self._hear_info(received, message)
        elif self._pipeline is not None:
            if self._body_unproven:
                self._prove_body(self._pipeline, topic, message)
            self._pipeline.add(received, message)
        else:
            self._hear_stranger(received, message)

    def _read(self, received: Received) -> Any | None:
        try:
            return STORE.deserialize_cdr(received.data, received.message_type)
        except Exception as error:  # the list of what a parser raises on damaged bytes is open-ended
            said = " ".join(str(error).split())[:160]
            self._board.fault(
                received.topic,
                "malformed message",
                f"{len(received.data)} bytes of {received.message_type}: {said}",
            )
            return None

    def _hear_frames(self, received: Received, message: Any) -> None:
        if received.data in self._tf_seen:
            return  # some publishers repeat the tree every second
        if len(self._tf_seen) < 1000:
            self._tf_seen.add(received.data)
        try:
            self._introduction.frames.add_message(message)
        except BelieError as error:
            self._board.fault(TF_STATIC, "unusable transform", str(error))
            return
        if self._pipeline is not None:
            try:
                mounted = self._introduction.camera()
            except BelieError as error:
                self._board.fault(TF_STATIC, "unusable transform", str(error))
                return
            before, after = self._pipeline.mounted.T_body_cam, mounted.T_body_cam
            if not (np.allclose(before.R, after.R, atol=1e-6) and np.allclose(before.t, after.t, atol=1e-6)):
                raise WatchBroken("camera mount changed: /tf_static tells another place of the camera")

    def _hear_info(self, received: Received, message: Any) -> None:
        if received.data[12:] == self._info_seen:
            return  # the same but for its stamp
        self._info_seen = received.data[12:]
        if self._introduction.hear_info(message) and self._pipeline is not None:
            raise WatchBroken(f"camera info changed: {received.topic} describes another camera than before")

    def _prove_body(self, pipeline: Pipeline, topic: str, message: Any) -> None:
        """Odometry that first speaks within the watch must tell of the body that the watch was begun for."""
        child = self._introduction.child_frame(topic, message)
        if not child:
            return
        self._body_unproven = False
        if child != pipeline.body:
            self._introduction.hear_claim(topic, message)
            raise WatchBroken(f"odometry frame: {topic} tells of {child}, not of {pipeline.body}")

    # -- before the watch ----------------------------------------------------------------------------

    def _hear_stranger(self, received: Received, message: Any) -> None:
        topic, choice = received.topic, self._introduction.choice
        if topic == choice.image.name:
            try:
                image = decode_image(self._decoder, message, self._settings.intake.largest_image_px)
            except (UndecodableImageError, TopicError) as error:
                self._board.fault(topic, "undecodable image", str(error))
                return
            self._introduction.hear_image(message.header.frame_id, (image.shape[1], image.shape[0]))
            most = self._settings.intake.start_frames
        else:
            self._introduction.hear_claim(topic, message)
            most = self._settings.intake.claims
        kept = self._backlog.setdefault(topic, deque())
        kept.append(received)
        while len(kept) > most:
            kept.popleft()
            self._intake.dropped[topic] += 1

    def _try_to_begin(self, clock_ns: int) -> None:
        introduction = self._introduction
        if not introduction.knows_camera:
            self._board.state, self._board.watching = (
                f"waiting for {', '.join(introduction.lacking())}",
                False,
            )
            return
        self._camera_known_ns = self._camera_known_ns or clock_ns
        lacking = introduction.lacking()
        patience_ns = self._settings.intake.first_message_s * 1e9
        if lacking and clock_ns - self._camera_known_ns < patience_ns:
            self._board.state = f"waiting for {', '.join(lacking)}"
            return
        try:
            self._pipeline = Pipeline(introduction, self._settings, self._board)
        except BelieError as error:
            self._board.state, self._board.watching = f"waiting: {error}", False
            self._board.fault("", "camera not usable yet", str(error))
            return
        self._board.state, self._board.watching = "watching", True
        self._on_event("ready: watching" + (f" (silent so far: {', '.join(lacking)})" if lacking else ""))
        odometry = introduction.choice.odometry
        self._body_unproven = odometry is not None and odometry.name not in self._backlog
        waiting = sorted((m for kept in self._backlog.values() for m in kept), key=lambda m: m.received_ns)
        self._backlog.clear()
        for received in waiting:
            self._hear(received)
        self._intake.hold_frames(self._settings.intake.frames)

    def _release(self, clock_ns: int) -> None:
        if self._pipeline is not None:
            for answer in self._pipeline.release(clock_ns):
                self._board.note(answer)
                self._on_answer(answer)
