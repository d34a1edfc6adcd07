"""Section III-C in the `paper` profile, conducted: which objects there are, and what becomes of each at a frame.

A message belongs to the last frame that is not more than half an interval older than it. An object lives from its
first detection; missing, it lives on at constant velocity while ``e^L < T4`` and its middle is in view.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from belie.checks import PaperThresholds
from belie.checks.paper_objects import hiding_check, misclassification_check, unchanged, withheld
from belie.detector.alerts import Judgement
from belie.detector.association import assign
from belie.geometry import SE3, CameraModel, FloatArray
from belie.geometry.boxes import edges_px, projected_box_px, where_px
from belie.odometry import LocalConsistency, LocalError, LocalMapPoints, motion_over, moved_box_px
from belie.types import AccusedObject, CheckResult, Detection, DetectionClaim, Status

_LEAST_SIDE_PX = 4.0
_NEW = LocalError(reason="it was seen in one frame only, two are needed")
_STILL_UNKNOWN = LocalError(reason="no motion to be had from its corners in the last two frames")


@dataclass(slots=True, eq=False)
class PaperObject:
    """One object; `box_px` is where it is in the last frame, `local` what the last two frames show of it."""

    name: str
    track_id: str
    label: str  # the last one that was not accused
    box_px: FloatArray
    seen: Detection
    seen_ns: int
    local: LocalMapPoints | None = None
    before_px: FloatArray | None = None  # its box one frame earlier
    expected: LocalMapPoints | None = None  # moved on to this frame
    error: LocalError = _NEW
    onset_ns: dict[str, int] = field(default_factory=dict)  # of what it is accused, by check

    def predict(self, local: LocalConsistency, camera: CameraModel, time_ratio: float) -> None:
        """Equations (4) to (6): the box in the new frame, and ``e^L`` over it."""
        self.error = _NEW if self.before_px is None else _STILL_UNKNOWN
        self.before_px, self.expected = self.box_px, None
        if self.local is None:
            return
        T_next_cur = motion_over(self.local.T_cur_prev, time_ratio)
        box = moved_box_px(camera, self.box_px, self.local.depth, T_next_cur)
        if box is None:
            self.error = LocalError(reason="its motion takes it behind the camera")
            return
        self.box_px = box
        self.error = local.error(self.local, T_next_cur, box)
        self.expected = self.local.moved(T_next_cur)

    def renew(self, local: LocalConsistency, told: tuple[SE3, float] | None, *, held: bool) -> None:
        """``M^L`` and ``T^L`` from the last two frames; at constant velocity where they show nothing."""
        if self.before_px is None:
            return
        kept = None if self.expected is None else (self.expected.T_cur_prev, self.expected.depth)
        fresh = local.map_points(self.before_px, self.box_px, told=told, kept=kept, held=held)
        self.local = fresh if fresh is not None else self.expected


@dataclass(slots=True, eq=False)
class PaperObjects:
    """All objects of one detector.

    Examples
    --------
    >>> camera = CameraModel(width=320, height=240, fx=200, fy=200, cx=159.5, cy=119.5)
    >>> objects = PaperObjects("/detections", camera, PaperThresholds())
    >>> car = Detection(label="car", score=0.9, track_id="7", box_px=[100, 100, 150, 150])
    >>> objects.take(DetectionClaim(source="/detections", stamp_ns=0, received_ns=0, detections=[car]))
    >>> from belie.odometry import PaperOdometrySettings
    >>> local = LocalConsistency(camera, PaperOdometrySettings())
    >>> [(j.result.check, j.result.status.value) for j in objects.update(0, local)]
    [('hiding', 'consistent'), ('misclassification', 'consistent')]
    """

    source: str
    camera: CameraModel
    thresholds: PaperThresholds
    objects: list[PaperObject] = field(default_factory=list)
    _waiting: list[DetectionClaim] = field(default_factory=list)
    _frame_ns: int | None = None
    _interval_ns: int = 0
    _message_ns: int | None = None
    _made: int = 0

    def take(self, claim: DetectionClaim) -> None:
        """Keep a message until its frame has come."""
        self._waiting.append(claim)

    def update(self, frame_ns: int, local: LocalConsistency) -> list[Judgement]:
        """Judge the message of this frame; `local` has observed it."""
        interval = 0 if self._frame_ns is None else frame_ns - self._frame_ns
        ratio = interval / self._interval_ns if self._interval_ns else 1.0
        for one in self.objects:
            one.predict(local, self.camera, ratio)
        self._frame_ns, self._interval_ns = frame_ns, interval
        claim = self._due(frame_ns + interval // 2)
        if claim is None:
            for one in self.objects:
                one.renew(local, None, held=True)
            self.objects = [one for one in self.objects if self._in_view(one)]
            reason = "no message for this frame"
            return [
                Judgement(result=withheld(check, self.source, reason, self.thresholds))
                for check in ("hiding", "misclassification")
            ]
        return self._judge(claim, frame_ns, local)

    def _due(self, until_ns: int) -> DetectionClaim | None:
        due = [claim for claim in self._waiting if claim.stamp_ns <= until_ns]
        self._waiting = [claim for claim in self._waiting if claim.stamp_ns > until_ns]
        newest = max(due, key=lambda claim: claim.stamp_ns, default=None)
        if newest is None or (self._message_ns is not None and newest.stamp_ns <= self._message_ns):
            return None  # none, or told again
        self._message_ns = newest.stamp_ns
        return newest

    def _judge(self, claim: DetectionClaim, frame_ns: int, local: LocalConsistency) -> list[Judgement]:
        told = [(d, box) for d in claim.detections if (box := self._box(d)) is not None]
        boxes = np.array([box for _, box in told]).reshape(-1, 4)
        expected = np.array([one.box_px for one in self.objects]).reshape(-1, 4)
        found = assign(expected, [o.track_id for o in self.objects], boxes, [d.track_id for d, _ in told])
        results: list[Judgement] = []
        kept: list[PaperObject] = []
        for i, one in enumerate(self.objects):
            if i in found:
                detection, box = told[found[i]]
                results += self._present(one, detection, box, claim.stamp_ns, frame_ns, local)
                kept.append(one)
            elif self._in_view(one):
                result = hiding_check(
                    self.source, one.name, one.label, one.error.error_px2, one.error.reason, self.thresholds
                )
                results.append(_judgement(one, result, frame_ns))
                if result.status is Status.CONTRADICTED:
                    one.renew(local, None, held=True)
                    kept.append(one)
        self.objects = kept
        for j in sorted(set(range(len(told))) - set(found.values())):
            self._meet(told[j][0], told[j][1], claim.stamp_ns)
        return [*self._worst("hiding", results), *self._worst("misclassification", results)]

    def _present(
        self, one: PaperObject, detection: Detection, box: FloatArray, stamp_ns: int, frame_ns: int,
        local: LocalConsistency,
    ) -> list[Judgement]:  # fmt: skip
        one.onset_ns.pop("hiding", None)
        results = []
        if detection.label == one.label:
            one.onset_ns.pop("misclassification", None)
        else:
            result = misclassification_check(
                self.source, one.name, one.label, detection.label, one.error.error_px2, one.error.reason,
                self.thresholds,
            )  # fmt: skip
            results.append(_judgement(one, result, frame_ns, detection))
            if result.status is Status.CONSISTENT:
                one.label = detection.label  # other pixels: another object
        motion = _told_motion(one.seen, detection, stamp_ns - one.seen_ns, self._interval_ns)
        one.box_px, one.seen, one.seen_ns = box, detection, stamp_ns
        if detection.track_id:
            one.track_id = one.name = detection.track_id
        one.renew(local, motion, held=False)
        return results

    def _meet(self, detection: Detection, box: FloatArray, stamp_ns: int) -> None:
        self._made += 1
        self.objects.append(
            PaperObject(
                name=detection.track_id or f"#{self._made}", track_id=detection.track_id, label=detection.label,
                box_px=box, seen=detection, seen_ns=stamp_ns,
            )
        )  # fmt: skip

    def _worst(self, check: str, judgements: list[Judgement]) -> list[Judgement]:
        """Every accusation; else what is undecided; else one answer that all is well."""
        of_check = [j for j in judgements if j.result.check == check]
        for status in (Status.CONTRADICTED, Status.UNDECIDED):
            if chosen := [j for j in of_check if j.result.status is status]:
                return chosen if status is Status.CONTRADICTED else chosen[:1]
        if of_check:
            return of_check[:1]
        what = "all detected" if check == "hiding" else "none renamed"
        reason = f"{len(self.objects)} objects, {what}"
        return [Judgement(result=unchanged(check, self.source, reason, self.thresholds))]

    def _box(self, detection: Detection) -> FloatArray | None:
        box = detection.box_px if detection.box_px is not None else projected_box_px(detection, self.camera)
        if box is None:
            return None
        clipped = np.clip(box, 0.0, [self.camera.width, self.camera.height] * 2)
        return clipped if (clipped[2:] - clipped[:2] >= _LEAST_SIDE_PX).all() else None

    def _in_view(self, one: PaperObject) -> bool:
        middle = 0.5 * (one.box_px[:2] + one.box_px[2:])
        return bool(((middle >= 0.0) & (middle <= (self.camera.width, self.camera.height))).all())


class PaperObjectStage:
    """The object checks of the `paper` profile, for all detectors of a robot."""

    def __init__(self, camera: CameraModel, thresholds: PaperThresholds) -> None:
        self._camera, self._thresholds = camera, thresholds
        self.streams: dict[str, PaperObjects] = {}

    def take(self, claims: Iterable[DetectionClaim]) -> None:
        """Hand every message to its stream."""
        for claim in claims:
            fresh = PaperObjects(claim.source, self._camera, self._thresholds)
            self.streams.setdefault(claim.source, fresh).take(claim)

    def update(self, frame_ns: int, local: LocalConsistency) -> list[Judgement]:
        """Judge what was told of this frame; `local` has observed it."""
        return [j for stream in self.streams.values() for j in stream.update(frame_ns, local)]


def _judgement(
    one: PaperObject, result: CheckResult, frame_ns: int, told: Detection | None = None
) -> Judgement:
    if result.status is not Status.CONTRADICTED:
        return Judgement(result=result)
    return Judgement(
        result=replace(result, reason=f"{result.reason}, {where_px(one.box_px)}"),
        onset_ns=one.onset_ns.setdefault(result.check, frame_ns),
        accused=AccusedObject(
            label_before=one.label,
            label_after=None if told is None else told.label,
            id_after=None if told is None else told.track_id or None,
            box_px=edges_px(one.box_px),
        ),
    )


def _told_motion(
    before: Detection, now: Detection, elapsed_ns: int, interval_ns: int
) -> tuple[SE3, float] | None:
    """``T^L`` over a frame's interval as two detections give it, and the depth now; None where they do not."""
    if before.position_m is None or now.position_m is None or elapsed_ns <= 0 or now.position_m[2] <= 0.0:
        return None
    if before.T_cam_obj is not None and now.T_cam_obj is not None:
        motion = now.T_cam_obj @ before.T_cam_obj.inverse()
    else:
        motion = SE3.from_translation(now.position_m - before.position_m)
    return motion_over(motion, interval_ns / elapsed_ns), float(now.position_m[2])
