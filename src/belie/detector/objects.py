"""Section III-C, conducted: every object is followed by its own pixels, and its detections held against them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from belie.checks.objects import ErrorTest, Habit, ObjectSettings, run_threshold
from belie.detector.alerts import Judgement
from belie.detector.association import assign
from belie.detector.covering import Covering
from belie.detector.object_track import ObjectTrack, in_view
from belie.detector.object_view import ObjectView, view_of
from belie.detector.scene_witness import Scene, SceneWitness
from belie.geometry import CameraModel, FloatArray
from belie.geometry.boxes import longer_side, projected_box_px
from belie.odometry.local_features import ImageStack
from belie.odometry.tracking import TrackingSettings
from belie.types import (
    CheckResult,
    Claim,
    Detection,
    DetectionClaim,
    Frame,
    GrayImage,
    Status,
    VisualEstimate,
)

_MOST_AHEAD_NS = 5_000_000_000
_FORGET_NS = 1_000_000_000  # an object that neither a message nor its pixels have told of for so long is gone
_LONGEST_NS = 500_000_000  # without a message: the detector itself is silent
_SILENT = 5.0  # its usual intervals
_HALF_SIGHT_PX = 24.0  # side at which a label counts half
_LEAST_VOTE = 2.0  # weight of the votes for a label before another one can be wrong
_FULL_VOTE = 2.0  # of a sure detection of a large object
_APART = 1.0  # of their sizes: distance of two objects whose ids no tracker mistakes
_STANDING = ("vehicle", "person", "barrier")  # groups of labels that stand on the ground
_HIDDEN_FOOT = 0.05  # share of its box under another: its foot may be hidden
_BY_CORNERS = (
    "too few corners",
    "occluded or gone",
)  # reasons to doubt a new name that its whole picture may refute
_RATE_SHARE = {"hiding": 1.0 / 2.0, "misclassification": 1.0 / 3.0, "injection": 1.0 / 6.0}


@dataclass(slots=True)
class ObjectStream:
    """All objects of one detector."""

    source: str
    camera: CameraModel
    settings: ObjectSettings
    tracking: TrackingSettings
    false_alarms_per_hour: float
    scene: SceneWitness
    tracks: list[ObjectTrack] = field(default_factory=list)
    waiting: list[DetectionClaim] = field(default_factory=list)
    last_ns: int | None = None
    interval_s: float = 0.0
    crowd: float = 1.0  # objects at a time
    unboxed: int = 0
    heard: bool = False  # a message was judged at the last frame
    _made: int = 0
    _missed: Habit = field(init=False)
    _misnamed: Habit = field(init=False)

    def __post_init__(self) -> None:
        s = self.settings
        self._missed = Habit(s.miss_rate, s.persistence_s, s.prior_messages, s.prior_gaps, s.half_seen_px)
        self._misnamed = Habit(
            s.confusion_rate, s.persistence_s, s.prior_messages, s.prior_gaps, s.half_seen_px
        )

    # -- images --------------------------------------------------------------------------------------

    def follow(self, previous: ImageStack, current: ImageStack, stamp_ns: int) -> None:
        """Carry every object to the new image; forget those that are lost or long gone."""
        # The structure of noise alone is half of its variance; patches must have twice that.
        least = min(self.tracking.min_eigenvalue, previous.noise**2)
        tracking = self.tracking.model_copy(update={"min_eigenvalue": least})
        for track in self.tracks:
            track.follow(previous, current, stamp_ns, tracking)
        self.tracks = [track for track in self.tracks if not self._is_lost(track, stamp_ns, current.size)]

    def _is_lost(self, track: ObjectTrack, stamp_ns: int, size: tuple[int, int]) -> bool:
        if in_view(track.box_px, size) <= 0.1 or not np.isfinite(track.box_px).all():
            return True
        known_ns = max(track.last_seen_ns, track.last_found_ns if track.hiding.accused else 0)
        silent_ns, usual_ns = stamp_ns - known_ns, int(3e9 * self.interval_s)
        if silent_ns <= max(_FORGET_NS, usual_ns):
            return False
        return bool(track.absence(size, self.settings)) or silent_ns > max(5 * _FORGET_NS, usual_ns)

    def unheard(self) -> None:
        """No message was judged at this frame."""
        self.heard = False
        for track in self.tracks:
            track.told_px = None

    # -- messages ------------------------------------------------------------------------------------

    def hear(self, frame_ns: int, half_ns: int, current: ImageStack) -> None:
        """Judge every message that belongs to this frame or an earlier one."""
        self.heard = False
        self.waiting.sort(key=lambda claim: claim.stamp_ns)
        while self.waiting and self.waiting[0].stamp_ns <= frame_ns + half_ns:
            claim = self.waiting.pop(0)
            if self.last_ns is not None and claim.stamp_ns <= self.last_ns:
                continue  # told again, or out of order
            self._judge(claim, current)
            self.heard = True

    def _judge(self, claim: DetectionClaim, current: ImageStack) -> None:
        if self.last_ns is not None:
            step_s = (claim.stamp_ns - self.last_ns) * 1e-9
            self.interval_s = min(step_s, 1.0) if not self.interval_s else self.interval_s
            self.interval_s += 0.1 * (min(step_s, 1.0) - self.interval_s)
        self.last_ns = claim.stamp_ns
        told = [(d, box) for d in claim.detections if (box := self._box(d)) is not None]
        boxes = np.array([box for _, box in told]).reshape(-1, 4)
        then = np.array([track.box_at(claim.stamp_ns) for track in self.tracks]).reshape(-1, 4)
        found = assign(
            then, [t.track_id for t in self.tracks], boxes, [d.track_id for d, _ in told],
            lambda i, box: self.tracks[i].share_in(box, then[i]),
        )  # fmt: skip
        self.crowd += 0.05 * (len(self.tracks) - self.crowd)
        stand = np.array([self.settings.classes.of(d.label) in _STANDING for d, _ in told], dtype=bool)
        lost = [i for i in range(len(self.tracks)) if i not in found]
        lost_stand = np.array([self.tracks[i].group in _STANDING for i in lost], dtype=bool)
        covering = Covering.of(then[lost], lost_stand, boxes, stand)
        for k, i in enumerate(lost):
            self._absent(
                self.tracks[i], claim.stamp_ns, boxes[covering.which[k]], float(covering.share[k]), current
            )
        owners, covering = (
            {self.tracks[i].track_id: self.tracks[i] for i in found},
            Covering.among(boxes, stand),
        )
        for i, j in found.items():
            track, detection = self.tracks[i], told[j][0]
            owner = owners.get(detection.track_id)
            self._present(
                track, detection, boxes[j], claim.stamp_ns, owner, current, boxes[covering.which[j]]
            )
            track.cover_then = float(covering.by_any[j])
            if covering.share[j] > self.settings.most_covered:
                track.cover.tell(float(covering.share[j]))
        for j in sorted(set(range(len(told))) - set(found.values()), key=lambda j: -longer_side(boxes[j])):
            self._meet(told[j][0], boxes[j], claim.stamp_ns, current, boxes[covering.which[j]])

    def habits(self) -> dict[str, float]:
        """How often this detector was seen to err, for how long, and in how many messages about objects."""
        missed, named = self._missed, self._misnamed
        interval_s = max(self.interval_s, 1e-3)
        return {
            "miss_rate": missed.share(),
            "confusion_rate": named.share(),
            "persistence_s": max(missed.memory_s(interval_s), named.memory_s(interval_s)),
            "messages": missed.stream.right + missed.stream.begun + missed.stream.lasted,
        }

    def _box(self, detection: Detection) -> FloatArray | None:
        box = detection.box_px if detection.box_px is not None else projected_box_px(detection, self.camera)
        if box is None:
            self.unboxed += 1
            return None
        left, top, right, bottom = box.tolist()
        left, right = (min(max(x, 0.0), float(self.camera.width)) for x in (left, right))
        top, bottom = (min(max(y, 0.0), float(self.camera.height)) for y in (top, bottom))
        fits = right - left >= 4.0 and bottom - top >= 4.0
        return np.array([left, top, right, bottom]) if fits else None

    def _threshold(self, check: str) -> float:
        rate = self.false_alarms_per_hour * _RATE_SHARE[check]
        return run_threshold(rate, 3600.0 / max(self.interval_s, 1e-3), self.crowd)

    def _absent(
        self, track: ObjectTrack, stamp_ns: int, covers: FloatArray, cover: float, current: ImageStack
    ) -> None:
        track.miss(current, self.settings, self.scene.frame, covers)
        miss = track.cover.miss(cover) if cover > self.settings.most_covered else 0.0
        if track.absence(current.size, self.settings, by_boxes=False):
            track.hiding.excuse()
        elif miss is not None and not track.absence(current.size, self.settings):
            # Otherwise this message tells nothing: a box that may cover it is no proof that it has gone.
            track.hiding.wrong(
                self.interval_s, self._threshold("hiding"), stamp_ns, longer_side(track.box_px), covered=miss
            )

    def _present(
        self, track: ObjectTrack, detection: Detection, box: FloatArray, stamp_ns: int, owner: ObjectTrack | None,
        current: ImageStack, covers: FloatArray,
    ) -> None:  # fmt: skip
        s = self.settings
        known = track.weight >= s.established
        fair = track.absence(current.size, s)
        soft = track.is_soft and (not fair or fair.startswith(_BY_CORNERS))
        group = s.classes.of(detection.label)
        is_anothers = bool(detection.track_id) and owner is not None and owner is not track
        swapped = known and is_anothers and owner is not None and _apart(track.box_px, owner.box_px)
        weight = _weight(detection.score)
        vote = weight * min(1.0, 0.5 * longer_side(box) / _HALF_SIGHT_PX)
        misnamed = known and group != track.group and track.votes.get(track.group, 0.0) >= _LEAST_VOTE
        track.hiding.right(self.interval_s, longer_side(track.box_px))
        if not (misnamed or swapped):
            track.naming.right(self.interval_s)
            track.called = track.called if track.naming.accused else ""
        else:
            if soft:
                track.likeness.look(current, box + track.box_px - track.box_at(stamp_ns))
                fair = "" if track.likeness.vouches else fair
            if track.likeness.denies or (fair and not soft):
                track.naming.excuse()
            else:
                track.called = detection.label if misnamed else f"id {detection.track_id}"
                threshold = self._threshold("misclassification")
                track.naming.wrong(self.interval_s, threshold, stamp_ns, vouched=not fair)
        if not swapped and detection.track_id:
            track.track_id = track.name = detection.track_id
        # Never learn from what is suspected, where the old name is as well founded as an accusation must be.
        if not track.naming.accused and not (misnamed and self._is_sure_of(track)):
            track.votes[group] = track.votes.get(group, 0.0) + vote
            track.label = track.label if misnamed else detection.label
        track.weight += weight
        track.told_px, track.told_label = box, detection.label
        track.detect(box, stamp_ns, current.size)
        self._look_behind(track, group, stamp_ns)
        track.renew(current, s, self.scene.frame, covers)
        if track.is_soft and not track.naming.errors:
            track.likeness.learn(current, track.box_px)

    def _is_sure_of(self, track: ObjectTrack) -> bool:
        """Whether the name it had till now could be the error: by the same test as the new one."""
        messages = int(track.votes[track.group] / _FULL_VOTE)
        told = sum(self._misnamed.wrong(track.naming.own, k > 0, self.interval_s) for k in range(messages))
        return told >= self._threshold("misclassification")

    def _look_behind(self, track: ObjectTrack, group: str, stamp_ns: int) -> None:
        """Add up what speaks for a box that shows the background only."""
        track.phantom.why = ""
        if group not in _STANDING:
            track.phantom.why = f"a {track.label} need not stand on the ground"
            return
        told = (None, None) if track.cover_then > _HIDDEN_FOOT else self.scene.evidence(track)
        if told == (None, None):
            track.phantom.why = self.scene.why or "its corners cannot be told from the ground"
            return
        # What a detector imagines by itself is short and unsure.
        sure = track.weight >= self.settings.established
        track.phantom.add(*told, self._threshold("injection"), stamp_ns, sure=sure)

    def _meet(
        self, detection: Detection, box: FloatArray, stamp_ns: int, current: ImageStack, covers: FloatArray
    ) -> None:
        if len(self.tracks) >= self.settings.most_objects:
            return
        self._made += 1
        track = ObjectTrack(
            name=detection.track_id or f"#{self._made}",
            track_id=detection.track_id,
            label=detection.label,
            box_px=box,
            hiding=ErrorTest(self._missed),
            naming=ErrorTest(self._misnamed),
        )
        weight = _weight(detection.score)
        track.weight = weight
        track.votes[self.settings.classes.of(detection.label)] = weight * min(
            1.0, 0.5 * longer_side(box) / _HALF_SIGHT_PX
        )
        track.told_px, track.told_label = box, detection.label
        track.detect(box, stamp_ns, current.size)
        track.renew(current, self.settings, self.scene.frame, covers)
        self.tracks.append(track)

    # -- answers -------------------------------------------------------------------------------------

    def answer(self, frame_ns: int, size: tuple[int, int]) -> list[Judgement]:
        """One result a check, and one for every object that is lied about."""
        silent_ns = max(_LONGEST_NS, int(_SILENT * self.interval_s * 1e9))
        if self.last_ns is None or frame_ns - self.last_ns > silent_ns:
            since = "yet" if self.last_ns is None else f"for {(frame_ns - self.last_ns) * 1e-9:.1f} s"
            return self.withhold(f"no message {since}")
        return [*self._answer_hiding(size), *self._answer_naming(), *self._answer_injection()]

    def withhold(self, reason: str) -> list[Judgement]:
        """UNDECIDED, for all checks."""
        return [
            Judgement(result=CheckResult(
                check=check, source=self.source, status=Status.UNDECIDED, unit="llr", reason=reason))
            for check in ("hiding", "misclassification", "injection")
        ]  # fmt: skip

    def _answer_hiding(self, size: tuple[int, int]) -> list[Judgement]:
        threshold = self._threshold("hiding")
        floor = self._floor(self._missed, threshold)
        accused: list[Judgement] = []
        doubtful: list[str] = []
        explained: list[str] = []
        worst: ObjectTrack | None = None
        for track in self.tracks:
            if track.hiding.accused:
                accused.append(Judgement(onset_ns=track.hiding.onset_ns, result=CheckResult(
                    check="hiding", source=self.source, status=Status.CONTRADICTED,
                    statistic=track.hiding.statistic, threshold=threshold, unit="llr", floor=floor,
                    reason=f"{track.label} {track.name} {_where(track.box_px)} is missing in "
                    f"{_share(track.hiding)}, but {_there(track)}; the detector's own habit explains "
                    "fewer", object=track.name)))  # fmt: skip
            elif track.last_seen_ns < (self.last_ns or 0) and track.weight >= self.settings.established:
                fair = track.absence(size, self.settings)
                if fair:
                    # Where its pixels have told that it is not there to be seen, there is no doubt.
                    undecided = fair.startswith(("too few", "fading"))
                    (doubtful if undecided else explained).append(
                        f"{track.label} {track.name} is missing: {fair}"
                    )
            if not track.hiding.accused and (
                worst is None or track.hiding.statistic > worst.hiding.statistic
            ):
                worst = track
        if accused:
            return accused
        status = Status.UNDECIDED if doubtful else Status.CONSISTENT
        usual = f"{len(self.tracks)} objects, none missing longer than usual"
        reason = [*doubtful, *explained, usual][0]
        return [Judgement(result=CheckResult(
            check="hiding", source=self.source, status=status, threshold=threshold, unit="llr", floor=floor,
            statistic=worst.hiding.statistic if worst else 0.0, reason=reason,
            object=worst.name if worst and worst.hiding.errors else None))]  # fmt: skip

    def _answer_naming(self) -> list[Judgement]:
        threshold = self._threshold("misclassification")
        floor = self._floor(self._misnamed, threshold)
        accused = [
            Judgement(onset_ns=track.naming.onset_ns, result=CheckResult(
                check="misclassification", source=self.source, status=Status.CONTRADICTED,
                statistic=track.naming.statistic, threshold=threshold, unit="llr", floor=floor,
                reason=f"{track.label} {track.name} {_where(track.box_px)} is called {track.called} in "
                f"{_share(track.naming)}, but its pixels are the same: {_there(track)}",
                object=track.name))
            for track in self.tracks if track.naming.accused
        ]  # fmt: skip
        if accused:
            return accused
        worst = max(self.tracks, key=lambda track: track.naming.statistic, default=None)
        status, reason = Status.CONSISTENT, f"{len(self.tracks)} objects keep their names"
        if worst is not None and worst.naming.is_open:
            status = Status.UNDECIDED
            reason = (
                f"{worst.label} {worst.name} is called {worst.called} in {_share(worst.naming)}: "
                "its pixels do not tell whether it is the same object"
            )
        return [Judgement(result=CheckResult(
            check="misclassification", source=self.source, status=status, threshold=threshold,
            unit="llr", floor=floor, statistic=worst.naming.statistic if worst else 0.0, reason=reason,
            object=worst.name if worst and worst.naming.errors else None))]  # fmt: skip

    def _answer_injection(self) -> list[Judgement]:
        threshold = self._threshold("injection")
        accused = [
            Judgement(onset_ns=track.phantom.since_ns, result=CheckResult(
                check="injection", source=self.source, status=Status.CONTRADICTED, statistic=track.phantom.statistic,
                threshold=threshold, unit="llr", object=track.name,
                reason=f"{track.label} {track.name} {_where(track.box_px)}: nothing stands there; the corners in its "
                "box lie on the ground or the wall behind it"))
            for track in self.tracks if track.phantom.accused
        ]  # fmt: skip
        if accused:
            return accused
        told = [track for track in self.tracks if track.last_seen_ns == self.last_ns]
        unseen = [track for track in told if track.phantom.why]
        worst = max(told, key=lambda track: track.phantom.statistic, default=None)
        status = Status.UNDECIDED if unseen and len(unseen) == len(told) else Status.CONSISTENT
        reason = f"{len(told) - len(unseen)} of {len(told)} boxes have something of their own in them"
        if status is Status.UNDECIDED:
            reason = f"no box can be told from what is behind it: {unseen[0].phantom.why}"
        return [Judgement(result=CheckResult(
            check="injection", source=self.source, status=status, threshold=threshold, unit="llr",
            statistic=worst.phantom.statistic if worst else 0.0, reason=reason))]  # fmt: skip

    def _floor(self, habit: Habit, threshold: float) -> str | None:
        """Shortest run that would be accused."""
        if not self.interval_s:
            return None
        test = ErrorTest(habit)
        while not test.wrong(self.interval_s, threshold, 0) and test.errors < 1000:
            pass
        return f"{test.errors * self.interval_s:.1f} s"


class ObjectStage:
    """The object checks of the `default` profile, for all detectors of a robot."""

    def __init__(
        self,
        camera: CameraModel,
        settings: ObjectSettings,
        tracking: TrackingSettings,
        false_alarms_per_hour: float,
    ) -> None:
        self._camera, self._settings, self._tracking = camera, settings, tracking
        self._rate = false_alarms_per_hour
        self.streams: dict[str, ObjectStream] = {}
        self._scene = SceneWitness(camera)
        self._previous: ImageStack | None = None
        self._previous_ns = 0

    @property
    def views(self) -> tuple[ObjectView, ...]:
        """All objects as they stand after the last frame."""
        return tuple(
            view_of(track, stream.source, heard=stream.heard)
            for stream in self.streams.values()
            for track in stream.tracks
        )

    def habits(self) -> dict[str, dict[str, float]]:
        """How each detector errs, by source."""
        return {source: stream.habits() for source, stream in self.streams.items()}

    def take(self, claims: tuple[Claim, ...], now_ns: int) -> None:
        """Keep the messages until their frame has come; not those of a broken clock."""
        for claim in claims:
            if isinstance(claim, DetectionClaim) and claim.stamp_ns - now_ns < _MOST_AHEAD_NS:
                if claim.source not in self.streams:
                    self.streams[claim.source] = ObjectStream(
                        claim.source, self._camera, self._settings, self._tracking, self._rate, self._scene
                    )
                self.streams[claim.source].waiting.append(claim)

    def update(
        self,
        frame: Frame,
        estimate: VisualEstimate | None = None,
        scene: Scene | None = None,
        *,
        doubted: str = "",
        half: GrayImage | None = None,
    ) -> list[Judgement]:
        """Follow all objects into a frame and judge what was told of them.

        `estimate` and `scene`: the camera's own motion since the previous frame and the depths of its corners, where
        they are known. `doubted`: why the image is not fit to judge by; objects stay where they were. `half`: the image
        at half its size, if it is there already.
        """
        if not self.streams:
            return []
        if doubted:
            for stream in self.streams.values():
                stream.unheard()
            return [j for stream in self.streams.values() for j in stream.withhold(f"not judged: {doubted}")]
        current = ImageStack(_as_gray(frame.image), half)
        self._scene.move(estimate, scene)
        half_ns = (frame.stamp_ns - self._previous_ns) // 2 if self._previous is not None else 0
        judgements: list[Judgement] = []
        for stream in self.streams.values():
            if self._previous is not None:
                stream.follow(self._previous, current, frame.stamp_ns)
            stream.hear(frame.stamp_ns, half_ns, current)
            judgements += stream.answer(frame.stamp_ns, current.size)
        self._previous, self._previous_ns = current, frame.stamp_ns
        return judgements


def _as_gray(image: GrayImage) -> GrayImage:
    return np.ascontiguousarray(image)


def _weight(score: float) -> float:
    return _FULL_VOTE * min(max((score - 0.3) / 0.6, 0.1), 1.0)


def _apart(a: FloatArray, b: FloatArray) -> bool:
    gap = float(np.linalg.norm(0.5 * (a[:2] + a[2:] - b[:2] - b[2:])))
    return gap > _APART * (longer_side(a) + longer_side(b))


def _where(box: FloatArray) -> str:
    return "at [" + ", ".join(f"{edge:.0f}" for edge in box) + "] px"


def _share(test: ErrorTest) -> str:
    return f"{test.errors} of the last {test.messages} messages"


def _there(track: ObjectTrack) -> str:
    error = track.motion.error_px2 if track.motion is not None else None
    fit = "" if error is None else f", e^L {error:.2f} px²"
    if track.is_soft and track.likeness.evidence > 0.0:
        likeness = track.likeness
        return f"the picture fits (correlation {likeness.score:.2f}, {likeness.beside:.2f} beside it)"
    return f"{track.proven} of {track.corners_then} corners on it move on as one{fit}"
