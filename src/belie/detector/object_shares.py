"""What each object must reach before its detector is accused: its share of the false alarms of all together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from belie.checks.objects import ErrorTest, ObjectSettings, run_threshold, shared_thresholds
from belie.detector.object_track import ObjectTrack
from belie.geometry.boxes import longer_side, root_area

RATE_SHARE = {"hiding": 1.0 / 2.0, "misclassification": 1.0 / 3.0, "injection": 1.0 / 6.0}
_TESTS = ("hiding", "misclassification")
# Messages. For how long misses last is known from the few gaps that a stream has shown: after ten single ones, four in
# a row still have a probability (beta-binomial) of some 3e-6 a message, more than is stated for all objects together.
_FEWEST_MISSED, _FEWEST_MISNAMED = 5, 4


@dataclass(slots=True)
class ObjectShares:
    """The shares of one stream's objects: what is twice as near is reached in half the time, so it weighs twice."""

    false_alarms_per_hour: float
    width_px: int
    settings: ObjectSettings
    messages_per_hour: float = 3600.0
    _sides_px: float = 0.0  # of all objects together
    _given: dict[str, dict[int, float]] = field(default_factory=dict)  # nats, by number of the object

    def weigh(self, tracks: Sequence[ObjectTrack]) -> None:
        """Take over the sizes of all objects."""
        self._sides_px = sum(self._side(track) for track in tracks)

    def share_out(self, tracks: Sequence[ObjectTrack], interval_s: float) -> None:
        """Give every object its share, before a message is judged; what is left over of names pays for hiding."""
        self.messages_per_hour = 3600.0 / max(interval_s, 1e-3)
        may = [track for track in tracks if self._may_be_accused(track)]
        steps = [track.hiding.steps(interval_s, root_area(track.box_px)) for track in may]
        steps += [track.naming.steps(interval_s) for track in may]
        first, each = np.array(steps).reshape(-1, 2).T
        rate = sum(RATE_SHARE[check] for check in _TESTS) * self.false_alarms_per_hour
        worth = np.tile([self._side(track) for track in may], len(_TESTS))
        fewest = np.repeat([_FEWEST_MISSED, _FEWEST_MISNAMED], len(may))
        given = shared_thresholds(first, each, worth, fewest, rate / self.messages_per_hour).tolist()
        numbers = [track.number for track in may]
        self._given = {
            check: dict(zip(numbers, given[k * len(may) :], strict=False)) for k, check in enumerate(_TESTS)
        }

    def threshold(self, check: str, track: ObjectTrack | None) -> float:
        """Of a test about an object, nats; about an only one, where it is None.

        An excursion that has begun keeps what it was asked for then: shares that follow it would let others' errors
        decide about it, and its own.
        """
        if track is not None and check != "injection":
            test, given = _test(track, check), self._given.get(check, {})
            if test.errors:
                return test.threshold
            if track.number in given:
                return given[track.number]
        rate = self.false_alarms_per_hour * RATE_SHARE[check]
        side_px = 0.0 if track is None else self._side(track)
        share = side_px / max(self._sides_px, side_px) if side_px else 1.0
        return run_threshold(rate, self.messages_per_hour, share)

    def worst(self, check: str, tracks: Sequence[ObjectTrack]) -> tuple[ObjectTrack | None, float]:
        """Of some objects the one that is closest to an accusation, and its threshold."""
        suspected = [track for track in tracks if _statistic(track, check) > 0.0] or tracks[:1]
        pairs = [(track, self.threshold(check, track)) for track in suspected]
        if not pairs:
            return None, self.threshold(check, None)
        return max(pairs, key=lambda pair: _statistic(pair[0], check) / pair[1])

    def largest(self, tracks: Sequence[ObjectTrack]) -> ObjectTrack | None:
        """The object that is accused the soonest."""
        return max(tracks, key=self._side, default=None)

    def _may_be_accused(self, track: ObjectTrack) -> bool:
        s = self.settings
        return track.weight >= s.established and longer_side(track.box_px) >= s.least_side_px

    def _side(self, track: ObjectTrack) -> float:
        return min(longer_side(track.box_px), float(self.width_px))


def _statistic(track: ObjectTrack, check: str) -> float:
    if check == "injection":
        return track.phantom.statistic
    return _test(track, check).statistic


def _test(track: ObjectTrack, check: str) -> ErrorTest:
    return track.hiding if check == "hiding" else track.naming
