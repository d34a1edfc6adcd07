"""How long the objects of a detector are kept, and what those that are gone have shown of it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from belie.checks.objects import Counts, Habit, ObjectSettings
from belie.detector.object_habits import ObjectHabits
from belie.detector.object_shares import ObjectShares
from belie.detector.object_track import ObjectTrack
from belie.detector.places import in_view
from belie.geometry.boxes import root_area

_REMEMBERED = 1000  # objects that are gone
_FORGET_NS = 1_000_000_000  # an object that neither a message nor its pixels have told of for so long is gone
_MOST_MESSAGES = 1000  # for which an object is kept that is not told of
_BY_ITS_PLACE = ("leaving the view", "too small")
_WHOLE = 0.95  # share in view: edges are known to some hundredths


@dataclass(slots=True)
class ObjectMemory:
    """Which objects of one stream are kept, and the counts of misses of the others."""

    settings: ObjectSettings
    shares: ObjectShares
    _gone: deque[Counts] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))

    def kept(
        self, tracks: Iterable[ObjectTrack], stamp_ns: int, interval_s: float, size: tuple[int, int]
    ) -> list[ObjectTrack]:
        """The objects but for those that are lost or long gone; what their last misses teach is learned."""
        kept = []
        for track in tracks:
            if not self._is_lost(track, stamp_ns, interval_s, size):
                kept.append(track)
                continue
            end_misses(track, track.absence(size, self.settings))
            self._gone.append(track.hiding.own)
        return kept

    def drop(self, tracks: Iterable[ObjectTrack]) -> None:
        """These are no objects (any more), so nobody missed them: only what was known before is kept."""
        for track in tracks:
            self._gone.append(track.hiding.own)

    def _is_lost(self, track: ObjectTrack, stamp_ns: int, interval_s: float, size: tuple[int, int]) -> bool:
        if in_view(track.box_px, size) <= 0.1 or not np.isfinite(track.box_px).all():
            return True
        untold_ns, least_ns = stamp_ns - track.last_seen_ns, max(_FORGET_NS, int(3e9 * interval_s))
        if untold_ns <= least_ns:
            return False
        # A slow detector needs as long to be accused of it.
        first, each = track.hiding.steps(max(interval_s, 1e-3), root_area(track.box_px))
        further = max(self.shares.threshold("hiding", track) - first, 0.0) / each
        messages = min(2.0 + further, _MOST_MESSAGES)
        longest_ns = max(5 * _FORGET_NS, int(1e9 * messages * interval_s))
        is_suspected = track.hiding.accused or (track.hiding.errors > 0 and untold_ns <= longest_ns)
        # Before a standing camera something can always be followed: an accusation ends that rests on nothing any more.
        is_suspected |= track.accused_ns is not None and stamp_ns - track.accused_ns <= longest_ns
        silent_ns = min(untold_ns, stamp_ns - track.last_found_ns) if is_suspected else untold_ns
        if silent_ns <= least_ns:
            return False
        return bool(track.absence(size, self.settings)) or silent_ns > longest_ns

    def habits(
        self, interval_s: float, missed: Habit, misnamed: Habit, tracks: Iterable[ObjectTrack]
    ) -> ObjectHabits:
        """How often the detector was seen to err, and for how long; errors that go on lasted at least so long."""
        every, objects, steps = replace(missed.stream), list(self._gone), list(missed.steps)
        for track in tracks:
            seen, went_on = track.hiding.unlearned(track.cut_off)
            own = replace(track.hiding.own)
            own.add(seen)
            every.add(seen)
            objects.append(own)
            steps += went_on
        return ObjectHabits(
            interval_s=max(interval_s, 1e-3), missed=every, misnamed=replace(misnamed.stream), objects=tuple(objects),
            steps=tuple(steps),
        )  # fmt: skip


def end_misses(track: ObjectTrack, fair: str) -> None:
    """No further message can miss it, for a `fair` reason or because it is given up: learn what is sure.

    It is known from when on the image's border cut it off, and before, that was no reason to miss it. Where it is
    covered, or fades, that may have begun before it was seen.
    """
    if fair and not fair.startswith(_BY_ITS_PLACE):
        track.hiding.excuse()
    else:
        track.hiding.conclude(track.cut_off)


def note_cut_off(track: ObjectTrack, size: tuple[int, int]) -> None:
    """It was missed once more: count for how many messages the image's border has cut it off."""
    track.cut_off = track.cut_off + 1 if in_view(track.box_px, size) < _WHOLE else 0
