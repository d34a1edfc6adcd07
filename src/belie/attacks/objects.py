"""Which object an attack is aimed at, and where it is from message to message."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np

from belie.attacks.timing import NS_PER_S
from belie.geometry import CameraModel, FloatArray, box_iou, projected_box_px
from belie.types import Detection, DetectionClaim

_HELD_NS = NS_PER_S
_HELD_SHARE = 0.5  # detectors flicker: an object is held if so many messages of that second have it
_SAME_OBJECT = 0.3  # overlap
_SAME_PLACE_M = 3.0
_MEMORY_NS = 2 * NS_PER_S  # a box older than this says nothing about where its object is


def image_box_px(detection: Detection, model: CameraModel | None) -> FloatArray | None:
    """The box of an object, or that of its dimensions in space, shape (4,); None where it has neither.

    >>> image_box_px(Detection(label="car", score=1.0, box_px=[0, 0, 4, 3]), None)
    array([0., 0., 4., 3.])
    """
    if detection.box_px is not None:
        return detection.box_px
    return None if model is None else projected_box_px(detection, model)


def overlap(a: Detection, b: Detection, model: CameraModel | None) -> float:
    """How well two detections agree in place, 0 to 1: IoU of their boxes; without boxes, by their distance.

    >>> near, far = (Detection(label="car", score=1.0, position_m=[0, 0, z]) for z in (9.0, 30.0))
    >>> overlap(near, near, None), overlap(near, far, None)
    (1.0, 0.0)
    """
    a_px, b_px = image_box_px(a, model), image_box_px(b, model)
    if a_px is not None and b_px is not None:
        return box_iou(a_px, b_px)
    if a.position_m is None or b.position_m is None:
        return 0.0
    return max(0.0, 1.0 - float(np.linalg.norm(a.position_m - b.position_m)) / _SAME_PLACE_M)


def best_overlap(
    wanted: Detection, found: Iterable[tuple[int, Detection]], model: CameraModel | None
) -> int | None:
    """Index of the detection that is most likely `wanted`; None where none overlaps enough."""
    scored = [(overlap(wanted, detection, model), -index) for index, detection in found]
    best, index = max(scored, default=(0.0, 0))
    return -index if best >= _SAME_OBJECT else None


class Sightings:
    """What one stream showed up to now: the ids that it named, and the last messages.

    Examples
    --------
    >>> car, van = (Detection(label="car", score=1.0, track_id=i, box_px=[0, 0, w, w]) for i, w in (("1", 9), ("2", 8)))
    >>> seen = Sightings(None)
    >>> for k in range(12):
    ...     seen.add(DetectionClaim(source="/d", stamp_ns=k * NS_PER_S // 10, received_ns=0, detections=(van,)))
    >>> now = DetectionClaim(source="/d", stamp_ns=12 * NS_PER_S // 10, received_ns=0, detections=(car, van))
    >>> seen.ranked(now)  # the car is larger, but only the van is held
    [1, 0]
    """

    def __init__(self, model: CameraModel | None) -> None:
        self.labels: dict[str, str] = {}
        self.nameless = 0
        self._model = model
        self._recent: deque[DetectionClaim] = deque()

    def add(self, claim: DetectionClaim) -> None:
        """Remember a message."""
        for detection in claim.detections:
            if detection.track_id:
                self.labels.setdefault(detection.track_id, detection.label)
            else:
                self.nameless += 1
        self._recent.append(claim)
        while len(self._recent) > 1 and self._recent[1].stamp_ns <= claim.stamp_ns - _HELD_NS:
            self._recent.popleft()

    def ranked(self, claim: DetectionClaim) -> list[int]:
        """Indices of the objects of a message: those held for a second first, then the larger before the smaller."""
        order = range(len(claim.detections))
        return sorted(order, key=lambda i: (not self._is_held(claim, i), -self._size(claim.detections[i]), i))

    def _is_held(self, claim: DetectionClaim, index: int) -> bool:
        recent = [old for old in self._recent if old.stamp_ns < claim.stamp_ns]
        if not recent or recent[0].stamp_ns > claim.stamp_ns - _HELD_NS:
            return False
        current, missed = claim.detections[index], 0
        last_ns = claim.stamp_ns
        for old in reversed(recent):
            match = same_object(current, old.detections, self._model)
            missed += match is None
            if match is not None:
                current, last_ns = old.detections[match], old.stamp_ns
        long = claim.stamp_ns - last_ns >= 0.9 * _HELD_NS
        return long and missed <= (1.0 - _HELD_SHARE) * len(recent)

    def _size(self, detection: Detection) -> float:
        """Area of the box, px²; of what has no box at all the nearest counts as the largest."""
        box_px = image_box_px(detection, self._model)
        if box_px is not None:
            return float(np.prod(box_px[2:] - box_px[:2]))
        return 0.0 if detection.position_m is None else -float(np.linalg.norm(detection.position_m))


def same_object(wanted: Detection, found: Sequence[Detection], model: CameraModel | None) -> int | None:
    """Index of the detection of the same id, or where there are no ids of the best overlap; None if there is none."""
    if wanted.track_id:
        return next((i for i, other in enumerate(found) if other.track_id == wanted.track_id), None)
    return best_overlap(wanted, enumerate(found), model)


class Follower:
    """Finds one object in the messages of one stream: by its track id; without ids by where it was last.

    A tracker that loses an object gives it a new id: an id never seen before is taken for it where it overlaps.

    Parameters
    ----------
    name : str
        Its track id; empty where it has none.
    last : Detection or None
        Its last sighting, in this stream or another.
    last_ns : int
        When that was.
    """

    def __init__(self, name: str, last: Detection | None, last_ns: int, model: CameraModel | None) -> None:
        self.name, self.last, self.last_ns = name, last, last_ns
        self._ids = {name} - {""}
        self._model = model

    def find(self, claim: DetectionClaim, seen: Sightings) -> int | None:
        """Its index in a message of which `seen` knows nothing yet; None where it is missed."""
        found = list(enumerate(claim.detections))
        index = next((i for i, detection in found if detection.track_id in self._ids), None)
        if index is None and self.last is not None and claim.stamp_ns - self.last_ns <= _MEMORY_NS:
            unknown = [(i, d) for i, d in found if not d.track_id or d.track_id not in seen.labels]
            index = best_overlap(self.last, unknown, self._model)
        if index is not None:
            self.last, self.last_ns = claim.detections[index], claim.stamp_ns
            self._ids |= {self.last.track_id} - {""}
        return index
