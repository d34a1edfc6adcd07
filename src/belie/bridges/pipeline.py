"""One uninterrupted watch: messages to claims and frames, joined by header stamp, to verdicts."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from typing import Any

from belie.bridges.board import Answer, Board
from belie.bridges.image_guard import claimed_pixels
from belie.bridges.introduction import Introduction
from belie.bridges.punctuality import Punctuality
from belie.bridges.settings import LiveSettings
from belie.bridges.wire import Received, now_ns
from belie.detector import Detector
from belie.recordings import JoinCounts
from belie.recordings import topics as ros
from belie.recordings.claims import stamp_ns as header_stamp_ns
from belie.recordings.first_messages import decode_message
from belie.recordings.images import GrayDecoder, UndecodableImageError
from belie.recordings.join import DecodedFrame, Joiner
from belie.recordings.rig import ClaimReader, claim_reader
from belie.types import CalibrationError, Claim, Frame, GrayImage, RecordingError, TopicError

_TRY_READER_AGAIN_NS = 1_000_000_000
# While no frame waits, claims older than this are of no use: across such a gap of the camera nothing is compared.
_CLAIMS_KEPT_NS = 5_000_000_000


class WatchBroken(Exception):  # noqa: N818 (no error: the watch begins anew)
    """The stream of time is broken, so the watch must begin anew; the text says how."""


def decode_image(decoder: GrayDecoder, message: Any, largest_px: int) -> GrayImage:
    """An image message to gray; raises `UndecodableImageError`, too, where it claims too many pixels.

    >>> from types import SimpleNamespace
    >>> decode_image(GrayDecoder("/cam"), SimpleNamespace(encoding="mono8", height=9, width=9), 80)
    Traceback (most recent call last):
        ...
    belie.recordings.images.UndecodableImageError: an image that claims 81 pixels; at most 80 are decoded
    """
    claimed = claimed_pixels(message)
    if claimed > largest_px:
        raise UndecodableImageError(
            f"an image that claims {claimed} pixels; at most {largest_px} are decoded"
        )
    return decode_message(decoder, message)


class Pipeline:
    """The state of one watch; made anew after a jump of the clock or a change of the camera.

    Raises
    ------
    CalibrationError
        If the camera's calibration or mount is missing.
    """

    def __init__(self, introduction: Introduction, settings: LiveSettings, board: Board) -> None:
        self._introduction, self._settings, self._board = introduction, settings, board
        self._choice = introduction.choice
        self._camera = ros.camera_name(self._choice.image.name)
        self.mounted = introduction.camera()
        self._rig = introduction.rig()
        self._detector = Detector({self._camera: self.mounted}, settings.detector)
        self._counts = JoinCounts()
        self._joiner = Joiner(settings.join, self._counts)
        self._punctuality = Punctuality(round(settings.join.patience_ms * 1e6))
        parts = {role: getattr(self._choice, role) for role in ("odometry", "position", "imu", "detections")}
        self._never_awaited = {
            topic.name
            for role, topic in parts.items()
            if topic is not None and role not in settings.intake.awaited
        }
        self._decoder = GrayDecoder(self._camera)
        self._topics = {topic.name: topic for topic in self._choice.claims}
        self._readers: dict[str, ClaimReader] = {}
        self._reader_failed_ns: dict[str, int] = {}
        self._early: deque[Claim] = deque(
            maxlen=settings.intake.claims
        )  # before any frame tells the images' clock
        self._indices: dict[str, int] = {}
        self._last_frame: tuple[int, int] | None = None

    @property
    def body(self) -> str:
        """The frame that claims are about."""
        return self._rig.body

    @property
    def waiting(self) -> int:
        """How many frames wait for claims."""
        return len(self._joiner.frames)

    def add(self, received: Received, message: Any) -> None:
        """File a message.

        Raises
        ------
        WatchBroken
            Where stamps jump, so that nothing before them can be compared with anything after.
        """
        topic = received.topic
        index = self._indices[topic] = self._indices.get(topic, -1) + 1
        if topic == self._choice.image.name:
            self._add_image(received, message, index)
        elif topic in self._topics:
            for claim in self._claims(received, message, index):
                self._add_claim(claim)

    def _add_image(self, received: Received, message: Any, index: int) -> None:
        began = time.perf_counter()
        try:
            image = decode_image(self._decoder, message, self._settings.intake.largest_image_px)
        except UndecodableImageError as error:
            self._board.fault(received.topic, "undecodable image", str(error))
            return
        except TopicError as error:
            self._board.fault(received.topic, "unknown encoding", str(error))
            return
        model = self.mounted.model
        size = (image.shape[1], image.shape[0])
        if size != (model.width, model.height):
            self._board.fault(
                received.topic,
                "image of another size",
                f"{size[0]}x{size[1]} pixels; the calibration is for {model.width}x{model.height}",
            )
            self._introduction.image_size = size
            return
        stamp_ns = header_stamp_ns(message)
        self._watch_clock(stamp_ns, received.received_ns)
        frame = Frame(camera=self._camera, stamp_ns=stamp_ns, received_ns=received.received_ns, image=image)
        decode_ms = (time.perf_counter() - began) * 1e3
        try:
            self._joiner.add_frame(DecodedFrame(frame=frame, index=index, decode_ms=decode_ms))
        except RecordingError as error:
            back_s = ((self._joiner.newest_frame_ns or 0) - stamp_ns) * 1e-9
            if 0.0 < back_s < self._settings.join.clock_jump_s:
                self._board.fault(
                    received.topic, "image out of order", f"stamped {back_s:.4f} s before the newest one"
                )
                return
            raise WatchBroken(f"clock jump: {error}") from error
        self._last_frame = (stamp_ns, received.received_ns)
        self._punctuality.frame(
            stamp_ns=stamp_ns, received_ns=received.received_ns, streams=list(self._joiner.streams)
        )
        while self._early:
            self._add_claim(self._early.popleft())

    def _watch_clock(self, stamp_ns: int, received_ns: int) -> None:
        if self._last_frame is not None:
            step_ns = stamp_ns - self._last_frame[0]
            ahead_s = (step_ns - (received_ns - self._last_frame[1])) * 1e-9
            if ahead_s > self._settings.join.clock_jump_s and step_ns > 0:
                raise WatchBroken(f"clock jump: image stamps ran {ahead_s:.1f} s ahead between two frames")

    def _claims(self, received: Received, message: Any, index: int) -> tuple[Claim, ...]:
        topic = received.topic
        try:
            reader = self._reader(topic, received.received_ns, message)
            if reader is None:
                return ()
            return reader(message, received.received_ns, index)
        except CalibrationError as error:
            self._reader_failed_ns[topic] = received.received_ns
            self._board.fault(topic, "missing transform", str(error))
        except (RecordingError, ValueError, OverflowError) as error:
            self._board.fault(topic, "unusable value", str(error))
        return ()

    def _reader(self, topic: str, received_ns: int, message: Any) -> ClaimReader | None:
        reader = self._readers.get(topic)
        if reader is None:
            failed_ns = self._reader_failed_ns.get(topic)
            if failed_ns is not None and received_ns - failed_ns < _TRY_READER_AGAIN_NS:
                return None
            chosen = self._topics[topic]
            reader = claim_reader(
                self._rig, chosen, as_odometry=chosen is self._choice.odometry, first=message
            )
            if reader is not None:
                self._readers[topic] = reader
        return reader

    def _add_claim(self, claim: Claim) -> None:
        if self._joiner.clock_ahead_ns is None:
            self._early.append(claim)
            while self._early[0].received_ns < claim.received_ns - _CLAIMS_KEPT_NS:
                self._early.popleft()
            return
        offset_s = self._joiner.foreign_clock_s(claim)
        if offset_s is not None:  # must neither reach the detector nor blind the checks of all other streams
            self._board.fault(
                claim.source,
                "foreign clock",
                f"stamps {offset_s:+.1f} s off those of the images received with them; let both use one clock",
            )
            return
        jumps = self._counts.clock_jumps[claim.source]
        self._punctuality.claim(claim.source, stamp_ns=claim.stamp_ns, received_ns=claim.received_ns)
        try:
            self._joiner.add_claim(claim)
        except RecordingError as error:
            self._joiner.drop_stream(claim.source)
            self._board.fault(claim.source, "too many claims", str(error))
            return
        if not self._joiner.frames:  # a camera that died takes no claims away
            self._joiner.forget(claim.source, claim.received_ns - _CLAIMS_KEPT_NS)
        if self._counts.clock_jumps[claim.source] > jumps:
            self._board.fault(claim.source, "clock jump", "its stamps ran back by more than a second")

    def release(self, clock_ns: int) -> Iterator[Answer]:
        """The answers for the frames that need wait no longer at `clock_ns`."""
        if not self._joiner.frames:
            return
        self._joiner.unawaited = self._never_awaited | self._punctuality.unpunctual()
        for step in self._joiner.release(clock_ns):
            verdict = self._detector.update(step.frame, step.claims)
            yield Answer(verdict=verdict, frame=step.frame, decode_ms=step.decode_ms, answered_ns=now_ns())

    def look(self) -> None:
        """Look at the frame that is answered next while it waits for its claims."""
        frame = self._joiner.next_frame()
        if frame is not None:
            self._detector.look(frame)
