"""What the detectors under attack tell, and when: by this an attack that finds nothing to forge says why."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from belie.attacks.objects import image_box_px
from belie.attacks.plan import Plan
from belie.types import Detection, DetectionClaim

_MOST_NAMED = 10


@dataclass(slots=True)
class _Told:
    """One object: when it was told of, and in the span its name and its largest box, px²."""

    first_ns: int
    last_ns: int
    label: str = ""
    area_px2: float = -1.0


@dataclass(slots=True)
class _Detector:
    first_ns: int
    last_ns: int
    attacked: int = 0  # messages in the span
    nameless: int = 0  # detections without an id, in the span
    objects: dict[str, _Told] = field(default_factory=dict)


class Telling:
    """What detectors tell inside the span of an attack, and when they tell of what outside of it.

    Parameters
    ----------
    plan : Plan
        The attack.

    Examples
    --------
    >>> from belie.attacks.spec import parse_attack
    >>> from belie.attacks.timing import FrameClock
    >>> plan = Plan.of(parse_attack("detections-hide:start=5"), FrameClock(np.arange(9)), "flu")
    >>> telling = Telling(plan)
    >>> car = Detection(label="car", score=0.9, track_id="7", box_px=[0, 0, 4, 3])
    >>> telling.hear(DetectionClaim(source="/d", stamp_ns=1, received_ns=1, detections=(car,)))
    >>> telling.silence()
    '/d has messages in frames 1 to 1 alone; set start to 1 or less'
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._model = plan.camera.model if plan.camera is not None else None
        self._detectors: dict[str, _Detector] = {}

    def hear(self, claim: DetectionClaim) -> None:
        """Take in a message as the attack finds it."""
        now_ns = claim.stamp_ns
        detector = self._detectors.setdefault(claim.source, _Detector(now_ns, now_ns))
        detector.first_ns, detector.last_ns = min(detector.first_ns, now_ns), max(detector.last_ns, now_ns)
        is_attacked = self._plan.span.holds(now_ns)
        detector.attacked += is_attacked
        for detection in claim.detections:
            if not detection.track_id:
                detector.nameless += is_attacked
                continue
            told = detector.objects.setdefault(detection.track_id, _Told(now_ns, now_ns))
            told.first_ns, told.last_ns = min(told.first_ns, now_ns), max(told.last_ns, now_ns)
            if is_attacked:
                told.label = told.label or detection.label
                told.area_px2 = max(told.area_px2, self._area_px2(detection))

    def first_frame(self, track_id: str) -> int:
        """In which frame an object is first told of."""
        return self._frame(min(each.objects[track_id].first_ns for each in self._objects(track_id)))

    def silence(self) -> str:
        """When there are messages at all, and what to do; empty where some come in the span."""
        if any(detector.attacked for detector in self._detectors.values()):
            return ""
        first = min(self._frame(detector.first_ns) for detector in self._detectors.values())
        last = max(self._frame(detector.last_ns) for detector in self._detectors.values())
        has = f"{' and '.join(self._detectors)} has messages in frames {first} to {last}"
        if last <= self._plan.span.start_frame:
            return f"{has} alone; set start to {last} or less"
        return f"{has}; set start and stop so that some lie between"

    def elsewhere(self, track_id: str) -> str:
        """When an object is told of, in words; empty where it never is."""
        told = [each.objects[track_id] for each in self._objects(track_id)]
        if not told:
            return ""
        first, last = min(one.first_ns for one in told), max(one.last_ns for one in told)
        return f"it is told of in frames {self._frame(first)} to {self._frame(last)}"

    def present(self) -> str:
        """The objects that are told of in the span, of each detector the ten largest."""
        return "; ".join(f"there {source} has {_named(each)}" for source, each in self._detectors.items())

    def _objects(self, track_id: str) -> list[_Detector]:
        return [each for each in self._detectors.values() if track_id in each.objects]

    def _frame(self, stamp_ns: int) -> int:
        return self._plan.clock.nearest(stamp_ns)

    def _area_px2(self, detection: Detection) -> float:
        box_px = image_box_px(detection, self._model)
        return 0.0 if box_px is None else float(np.prod(box_px[2:] - box_px[:2]))


def _named(detector: _Detector) -> str:
    told = [(name, one) for name, one in detector.objects.items() if one.label]
    told.sort(key=lambda item: -item[1].area_px2)
    names = [f"{name} ({one.label})" for name, one in told[:_MOST_NAMED]]
    if len(told) > _MOST_NAMED:
        names.append(f"{len(told) - _MOST_NAMED} smaller ones")
    if detector.nameless:
        names.append("others without track ids" if names else "objects without track ids")
    return ", ".join(names) or "no objects"
