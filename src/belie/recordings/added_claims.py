"""A recording with one more stream of claims: from a file beside it, or made from its own images."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from belie.recordings.recording import Recording, StreamInfo
from belie.types import DetectionClaim, Frame, MountedCamera, Step

ClaimsOfFrame = Callable[[Frame], Sequence[DetectionClaim]]
"""The claims that go with a frame; called with every frame in order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AddedStream:
    """A stream of detections that a recording does not hold.

    Parameters
    ----------
    topic, kind : str
        Its source, and what it is, for the list of streams.
    stamps_ns : array (N,)
        When there will be a claim.
    start : callable
        Begins a pass over the recording.
    outside, repeated : int
        Detections that were left out: no image holds them, or they had been told already.
    warnings : tuple of str
        What a user should know of the stream, a line each.
    """

    topic: str
    kind: str
    stamps_ns: npt.NDArray[np.int64]
    start: Callable[[], ClaimsOfFrame]
    outside: int = 0
    repeated: int = 0
    warnings: tuple[str, ...] = ()


class ExtendedRecording:
    """A recording and one more stream; see `Recording` for the attributes.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> frame = Frame(camera="/image", stamp_ns=5, received_ns=7, image=np.zeros((4, 6), np.uint8))
    >>> bare = SimpleNamespace(path="x", format="made", cameras={}, body_axes="flu", join_counts=None, streams=(),
    ...                        geodetic_origin=None, steps=lambda: (Step(frame=f) for f in [frame]))
    >>> empty = DetectionClaim(source="/detections", stamp_ns=5, received_ns=5, detections=())
    >>> added = AddedStream(topic="/detections", kind="CSV", stamps_ns=np.array([5]), start=lambda: lambda f: [empty])
    >>> [claim.source for step in ExtendedRecording(bare, added).steps() for claim in step.claims]
    ['/detections']
    """

    def __init__(self, recording: Recording, added: AddedStream) -> None:
        self._recording, self._added = recording, added
        self.path = recording.path
        self.format = recording.format
        self.cameras: Mapping[str, MountedCamera] = recording.cameras
        self.body_axes = recording.body_axes
        self.join_counts = recording.join_counts
        self.geodetic_origin = recording.geodetic_origin

    def __getattr__(self, name: str) -> Any:
        if name == "_recording":
            raise AttributeError(name)
        return getattr(self._recording, name)

    @property
    def streams(self) -> tuple[StreamInfo, ...]:
        """All streams of the recording, and the added one."""
        added = self._added
        info = StreamInfo.from_times(added.topic, "detections", added.kind, added.stamps_ns, used=True)
        return (*self._recording.streams, info)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should know of the added stream, and of those added before it."""
        return (*getattr(self._recording, "warnings", ()), *self._added.warnings)

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Header stamps of all frames, shape (N,), ascending."""
        return self._recording.frame_stamps_ns()

    def steps(self) -> Iterator[Step]:
        """The frames with their claims; see `Recording.steps`."""
        steps = self._recording.steps()
        self.join_counts = self._recording.join_counts
        if self._added.outside:
            self.join_counts.outside[self._added.topic] += self._added.outside
        if self._added.repeated:
            self.join_counts.repeated[self._added.topic] += self._added.repeated
        return self._with_added(steps)

    def _with_added(self, steps: Iterator[Step]) -> Iterator[Step]:
        claims_of = self._added.start()
        with closing(steps):  # type: ignore[type-var]
            for step in steps:
                claims = sorted((*step.claims, *claims_of(step.frame)), key=lambda claim: claim.stamp_ns)
                yield replace(step, claims=tuple(claims))


def in_order(claims: Sequence[DetectionClaim]) -> Callable[[], ClaimsOfFrame]:
    """Hands out claims with their frames as `Step` promises it: all up to the frame, and the first after it.

    Each is received with its frame: a file does not tell when.

    >>> claims = [DetectionClaim(source="/d", stamp_ns=t, received_ns=t, detections=()) for t in (1, 5, 8)]
    >>> claims_of = in_order(claims)()
    >>> frame = Frame(camera="/image", stamp_ns=4, received_ns=9, image=np.zeros((4, 6), np.uint8))
    >>> [(claim.stamp_ns, claim.received_ns) for claim in claims_of(frame)]
    [(1, 9), (5, 9)]
    >>> claims_of(replace(frame, stamp_ns=5))
    []
    """
    stamps = [claim.stamp_ns for claim in claims]

    def start() -> ClaimsOfFrame:
        given = 0

        def claims_of(frame: Frame) -> Sequence[DetectionClaim]:
            nonlocal given
            end = bisect_right(stamps, frame.stamp_ns)
            is_next_wanted = end >= given and (end == 0 or stamps[end - 1] < frame.stamp_ns)
            end = max(given, min(end + is_next_wanted, len(stamps)))
            taken, given = claims[given:end], end
            return [replace(claim, received_ns=frame.received_ns) for claim in taken]

        return claims_of

    return start
