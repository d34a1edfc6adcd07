"""Streams of different rates and delays, joined by header stamp into `Step`s.

Claims arrive 1 to 60 ms late, each stream by its own delay, and out of order. A frame is therefore held
back for a short window of receive time, and then a little longer for streams that have nothing stamped
after it yet, so that what belongs to the frame travels with it. All decisions follow from receive times
and stamps, never from the speed of the machine: the same recording gives the same steps.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from belie.recordings.join_counts import JoinCounts
from belie.recordings.join_settings import JoinSettings
from belie.types import Claim, Frame, MotionClaim, RecordingError, Step

_ENOUGH_CLAIMS = 10  # a single claim with a wild stamp is no reason to refuse its stream


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DecodedFrame:
    """A frame, the index of its message, and what its decoding took."""

    frame: Frame
    index: int
    decode_ms: float = 0.0


@dataclass(slots=True)
class _Stream:
    """The claims of one source that wait for their frame; a pose and its twist stay together."""

    source: str
    count: int = 0
    waiting: list[tuple[int, int, Claim]] = field(default_factory=list)
    previous_ns: int | None = None
    newest_ns: int | None = None
    handed_ns: int | None = None
    before_ns: int | None = None

    def take(self, frame_ns: int) -> list[tuple[int, int, Claim]]:
        """Every waiting claim up to the frame, and the first after it where none is at its very stamp."""
        taken = []
        while self.waiting and self.waiting[0][0] <= frame_ns:
            taken.append(heapq.heappop(self.waiting))
        if taken:
            newest_ns = taken[-1][0]
            self.handed_ns = newest_ns if self.handed_ns is None else max(newest_ns, self.handed_ns)
            self.before_ns = newest_ns if self.before_ns is None else max(newest_ns, self.before_ns)
        if self.handed_ns is not None and self.handed_ns <= frame_ns:
            self.before_ns = self.handed_ns
        if self.waiting and (self.handed_ns is None or self.handed_ns < frame_ns):
            self.handed_ns = self.waiting[0][0]
            while self.waiting and self.waiting[0][0] == self.handed_ns:
                taken.append(heapq.heappop(self.waiting))
        return taken

    def is_near(self, frame_ns: int, within_ns: float) -> bool:
        """Whether a claim was handed out that is stamped near the frame, before or after it."""
        return any(
            stamp_ns is not None and abs(stamp_ns - frame_ns) <= within_ns
            for stamp_ns in (self.before_ns, self.handed_ns)
        )

    def reaches(self, frame_ns: int) -> bool:
        """Whether a claim at or after the frame has come."""
        return self.newest_ns is not None and self.newest_ns >= frame_ns


class Joiner:
    """The state of one pass over a recording, or of one session on a robot.

    Attributes
    ----------
    unawaited : set of str
        Sources that no frame waits for; their claims travel with the frames that find them.

    Examples
    --------
    >>> import numpy as np
    >>> joiner = Joiner(JoinSettings(reorder_window_ms=0.0), JoinCounts())
    >>> joiner.add_frame(DecodedFrame(index=0, frame=Frame(
    ...     camera="/cam", stamp_ns=5, received_ns=5, image=np.zeros((4, 4), np.uint8))))
    >>> [step.frame.stamp_ns for step in joiner.release(6)]
    [5]
    """

    def __init__(
        self, settings: JoinSettings, counts: JoinCounts, periods_ns: Mapping[str, float] | None = None
    ) -> None:
        self.settings, self.counts, self.periods_ns = settings, counts, periods_ns or {}
        self.unawaited: set[str] = set()
        self.window_ns = round(settings.reorder_window_ms * 1e6)
        self.patience_ns = max(round(settings.patience_ms * 1e6), self.window_ns)
        self.streams: dict[str, _Stream] = {}
        self.frames: list[tuple[int, DecodedFrame]] = []
        self.newest_frame_ns: int | None = None
        self.emitted_ns: int | None = None
        self.clock_ahead_ns: int | None = None  # stamp minus receive time of the newest frame
        self.order = 0

    @property
    def is_full(self) -> bool:
        """Whether as many frames wait as may."""
        return len(self.frames) > self.settings.max_waiting_frames

    def add_claim(self, claim: Claim) -> None:
        """File a claim with its stream."""
        stream = self.streams.setdefault(claim.source, _Stream(claim.source))
        stamp_ns = claim.stamp_ns
        # A twist comes in the message of its pose: what befalls the message is counted once.
        if not (isinstance(claim, MotionClaim) and claim.kind == "twist"):
            self._count(claim, stream)
            stream.previous_ns = stamp_ns
        stream.newest_ns = stamp_ns if stream.newest_ns is None else max(stamp_ns, stream.newest_ns)
        self.order += 1
        stream.count += 1
        if stream.count == _ENOUGH_CLAIMS:
            self._require_common_clock(claim)
        heapq.heappush(stream.waiting, (stamp_ns, self.order, claim))
        if len(stream.waiting) > self.settings.max_waiting_claims:
            raise RecordingError(
                f"more than {self.settings.max_waiting_claims} claims of {claim.source} wait for their "
                "images; its stamps run far ahead: synchronise the clocks and record again"
            )

    def foreign_clock_s(self, claim: Claim) -> float | None:
        """How far [s] a claim's stamp is off the images' clock, where that is too far; None where it is not."""
        if self.clock_ahead_ns is None:
            return None
        offset_s = (claim.stamp_ns - claim.received_ns - self.clock_ahead_ns) / 1e9
        return offset_s if abs(offset_s) > self.settings.max_clock_offset_s else None

    def drop_stream(self, source: str) -> None:
        """Forget a stream and its waiting claims; no frame waits for it any longer."""
        stream = self.streams.pop(source, None)
        if stream is not None:
            self.counts.dropped_late[source] += len(stream.waiting)

    def forget(self, source: str, before_ns: int) -> None:
        """Drop a stream's waiting claims that were received before a time, the oldest stamps first."""
        waiting = self.streams[source].waiting
        while waiting and waiting[0][2].received_ns < before_ns:
            heapq.heappop(waiting)
            self.counts.dropped_late[source] += 1

    def _require_common_clock(self, claim: Claim) -> None:
        """Refuse a stream that is stamped by another clock: nothing of it would ever meet its frame."""
        offset_s = self.foreign_clock_s(claim)
        if offset_s is not None:
            raise RecordingError(
                f"stamps of {claim.source} are {offset_s:+.1f} s off those of the images that were received "
                "with them; let both use one clock (simulated time or wall time) and record again"
            )

    def _count(self, claim: Claim, stream: _Stream) -> None:
        stamp_ns, previous_ns, counts = claim.stamp_ns, stream.previous_ns, self.counts
        if previous_ns is not None and stamp_ns < previous_ns:
            jumped = previous_ns - stamp_ns > self.settings.clock_jump_s * 1e9
            (counts.clock_jumps if jumped else counts.out_of_order)[claim.source] += 1
        elif stamp_ns == previous_ns:
            counts.duplicates[claim.source] += 1
        if self.emitted_ns is not None and stamp_ns <= self.emitted_ns:
            counts.late[claim.source] += 1

    def add_frame(self, decoded: DecodedFrame) -> None:
        """File a frame; refuse one that belongs before what has gone out."""
        frame = decoded.frame
        stamp_ns, newest_ns = frame.stamp_ns, self.newest_frame_ns
        if newest_ns is not None and stamp_ns <= newest_ns:
            if stamp_ns == self.emitted_ns or any(stamp_ns == waiting for waiting, _ in self.frames):
                if stamp_ns == 0:
                    raise RecordingError(
                        f"images of {frame.camera} carry no time (header.stamp is 0 at message "
                        f"{decoded.index}); let the camera driver stamp them and record again"
                    )
                self.counts.duplicates[frame.camera] += 1
                return
            # Older than a frame that the window has already let go, or older by more than the window.
            gone = [
                waiting
                for waiting, other in self.frames
                if other.frame.received_ns + self.window_ns < frame.received_ns
            ]
            if self.emitted_ns is not None:
                gone.append(self.emitted_ns)
            if stamp_ns < max([newest_ns - self.window_ns, *gone]):
                raise RecordingError(
                    f"image stamps run backwards at message {decoded.index} of {frame.camera}: "
                    f"{stamp_ns / 1e9:.6f} s after {newest_ns / 1e9:.6f} s; "
                    "record again, or sort the messages by header stamp"
                )
            self.counts.out_of_order[frame.camera] += 1
        heapq.heappush(self.frames, (stamp_ns, decoded))
        self.clock_ahead_ns = stamp_ns - frame.received_ns
        self.newest_frame_ns = stamp_ns if newest_ns is None else max(stamp_ns, newest_ns)

    def release(self, clock_ns: int | None) -> Iterator[Step]:
        """Steps of the frames that need wait no longer at receive time `clock_ns`; None: all of them."""
        while self.frames and (
            clock_ns is None or self.is_full or self._is_due(self.frames[0][1].frame, clock_ns)
        ):
            yield self._step(heapq.heappop(self.frames)[1])

    def next_frame(self) -> Frame | None:
        """The frame that comes out next, where that is certain: with a window, an older one may yet come in."""
        return self.frames[0][1].frame if self.frames and self.window_ns == 0 else None

    def _is_due(self, frame: Frame, clock_ns: int) -> bool:
        waited_ns = clock_ns - frame.received_ns
        if waited_ns <= self.window_ns:
            return False
        return waited_ns > self.patience_ns or all(
            stream.reaches(frame.stamp_ns) or stream.source in self.unawaited
            for stream in self.streams.values()
        )

    def _step(self, decoded: DecodedFrame) -> Step:
        frame = decoded.frame
        claims = sorted(
            (entry for stream in self.streams.values() for entry in stream.take(frame.stamp_ns)),
            key=lambda entry: entry[:2],
        )
        self._count_missing(frame)
        self.emitted_ns = frame.stamp_ns
        return Step(frame=frame, claims=tuple(entry[2] for entry in claims), decode_ms=decoded.decode_ms)

    def _count_missing(self, frame: Frame) -> None:
        for source, period_ns in self.periods_ns.items():
            if source == frame.camera:
                if self.emitted_ns is not None:
                    periods = round((frame.stamp_ns - self.emitted_ns) / period_ns)
                    if periods > 1:
                        self.counts.missing[source] += periods - 1
                continue
            stream = self.streams.get(source)
            if stream is None or not stream.is_near(frame.stamp_ns, 2.0 * period_ns):
                self.counts.missing[source] += 1

    def close(self) -> None:
        """Count the claims that no frame is left for."""
        for stream in self.streams.values():
            if stream.waiting:
                self.counts.dropped_late[stream.source] += len(stream.waiting)


def join(
    arrivals: Iterable[Claim | DecodedFrame],
    *,
    settings: JoinSettings,
    counts: JoinCounts,
    periods_ns: Mapping[str, float] | None = None,
) -> Iterator[Step]:
    """Join claims and frames, given in the order of their receive times, into steps.

    Parameters
    ----------
    arrivals : iterable of claims and frames
        In order of ``received_ns``.
    settings : JoinSettings
        How long to wait.
    counts : JoinCounts
        Is filled.
    periods_ns : mapping, optional
        Usual period of each stream, to count what is missing.

    Raises
    ------
    RecordingError
        If image stamps run backwards by more than the window, are all zero, or a claim stream's clock
        is so far ahead that it cannot be joined.

    Examples
    --------
    >>> import numpy as np
    >>> from belie.types import PositionClaim
    >>> def frame(t): return DecodedFrame(index=0, frame=Frame(
    ...     camera="/cam", stamp_ns=t, received_ns=t, image=np.zeros((4, 4), np.uint8)))
    >>> def fix(t, received): return PositionClaim(source="/fix", frame_id="enu", kind="gnss",
    ...     stamp_ns=t, received_ns=received, position_m=np.zeros(3))
    >>> late_but_joined = [frame(10), frame(20), fix(10, 60), fix(20, 70)]
    >>> [[c.stamp_ns for c in step.claims]
    ...  for step in join(late_but_joined, settings=JoinSettings(), counts=JoinCounts())]
    [[10], [20]]
    """
    joiner = Joiner(settings, counts, periods_ns)
    clock_ns: int | None = None
    for arrival in arrivals:
        received_ns = arrival.frame.received_ns if isinstance(arrival, DecodedFrame) else arrival.received_ns
        # Before the arrival is filed: those that share a receive time are then in, whatever their order.
        if clock_ns is None or received_ns > clock_ns or joiner.is_full:
            clock_ns = received_ns if clock_ns is None else max(received_ns, clock_ns)
            yield from joiner.release(clock_ns)
        if isinstance(arrival, DecodedFrame):
            joiner.add_frame(arrival)
        else:
            joiner.add_claim(arrival)
    yield from joiner.release(None)
    joiner.close()
