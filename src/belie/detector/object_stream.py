"""All objects of one detector: followed by their own pixels, and its messages held against them."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from belie.checks.objects import ErrorTest, Habit, ObjectSettings
from belie.detector.association import LEAST_OVERLAP, own_overlap
from belie.detector.covering import Covering
from belie.detector.edge_noise import EdgeNoise
from belie.detector.object_habits import ObjectHabits
from belie.detector.object_identity import (
    FULL_VOTE,
    call_by_ids,
    make_room,
    new_name,
    stand_ins,
    vote_of,
    without_doubles,
)
from belie.detector.object_memory import ObjectMemory, end_misses, note_cut_off
from belie.detector.object_message import STANDING, ObjectMessage, has_no_box
from belie.detector.object_shares import ObjectShares
from belie.detector.object_track import ObjectTrack
from belie.detector.places import in_view
from belie.detector.scene_witness import SceneWitness
from belie.detector.told_before import ToldBefore
from belie.geometry import CameraModel, FloatArray
from belie.geometry.boxes import are_apart, longer_side, overlaps, root_area
from belie.odometry.local_features import ImageStack
from belie.odometry.still_background import StillBackground, without_boxes
from belie.odometry.tracking import TrackingSettings
from belie.types import Detection, DetectionClaim

_SLOWEST_S = 5.0  # between messages; beyond, the detector has been silent
_STEPS = 9  # messages from which their rate is told
_LEAST_VOTE = 2.0  # weight of the votes for a label before another one can be wrong
_HALF_HELD = 0.5  # of an object's corners
_PART = 0.9  # share of a box within an object's own: edges err by a tenth of the side, two deviations
_RETOLD = 2  # messages under another id, after which that is its own
_HIDDEN_FOOT = 0.05  # share of its box under another: its foot may be hidden
_BY_CORNERS = (
    "too few corners",
    "occluded or gone",
)  # reasons to doubt a new name that its whole picture may refute


@dataclass(slots=True)
class ObjectStream:
    """All objects of one detector."""

    source: str
    camera: CameraModel
    settings: ObjectSettings
    tracking: TrackingSettings
    false_alarms_per_hour: float
    scene: SceneWitness
    background: StillBackground
    tracks: list[ObjectTrack] = field(default_factory=list)
    waiting: list[DetectionClaim] = field(default_factory=list)
    last_ns: int | None = None
    interval_s: float = 0.0
    unboxed: int = 0  # detections of the last message that tell neither an image box nor a size
    unfollowed: int = 0  # the same, that are smaller than all that are followed
    heard: bool = False  # a message was judged at the last frame
    unseen_ns: int = -1  # messages up to this stamp are about images that were not fit to judge by
    missed: Habit = field(init=False)
    misnamed: Habit = field(init=False)
    shares: ObjectShares = field(init=False)
    memory: ObjectMemory = field(init=False)
    edges: EdgeNoise = field(default_factory=EdgeNoise)
    told_before: ToldBefore = field(default_factory=ToldBefore)
    _made: int = 0
    _stand_ins: set[int] = field(default_factory=set)  # numbers of objects
    _steps_s: deque[float] = field(default_factory=lambda: deque(maxlen=_STEPS))  # between messages

    def __post_init__(self) -> None:
        s = self.settings
        self.missed, self.misnamed = (
            Habit(
                rate,
                s.persistence_s,
                s.prior_messages,
                s.prior_gaps,
                s.half_seen_px,
                s.object_messages,
                s.object_gaps,
            )
            for rate in (s.miss_rate, s.confusion_rate)
        )
        self.shares = ObjectShares(self.false_alarms_per_hour, self.camera.width, s)
        self.memory = ObjectMemory(s, self.shares)

    # -- images --------------------------------------------------------------------------------------

    def follow(
        self, previous: ImageStack, current: ImageStack, stamp_ns: int, R_cur_prev: FloatArray | None = None
    ) -> None:
        """Carry every object to the new image; forget those that are lost or long gone.

        `R_cur_prev`: the camera's rotation between the images, where it is known.
        """
        turns_px = self._turns_px(R_cur_prev)
        for track, turn_px in zip(self.tracks, turns_px, strict=True):
            track.follow(previous, current, stamp_ns, self.tracking, turn_px)
        self.tracks = self.memory.kept(self.tracks, stamp_ns, self.interval_s, current.size)
        self.shares.weigh(self.tracks)

    def _turns_px(self, R_cur_prev: FloatArray | None) -> FloatArray:
        """How the camera's rotation shifts the middle of each object, shape (N, 2)."""
        boxes = np.array([track.box_px for track in self.tracks]).reshape(-1, 4)
        if R_cur_prev is None or not len(boxes):
            return np.zeros((len(boxes), 2))
        middles = 0.5 * (boxes[:, :2] + boxes[:, 2:]) - 0.5
        if self.camera.is_distorted:  # beyond the image, its model may come back somewhere else
            middles = np.clip(middles, 0.0, np.array([self.camera.width, self.camera.height]) - 1.0)
        rays = np.column_stack([self.camera.normalize(middles), np.ones(len(middles))])
        turned = rays @ R_cur_prev.T
        shifts = self.camera.project(turned) - middles
        known = np.linalg.norm(self.camera.project(rays) - middles, axis=1) < 1.0
        known &= (turned[:, 2] > 0.0) & np.isfinite(shifts).all(axis=1)
        return np.where(known[:, None], shifts, 0.0)

    def pass_over(self, until_ns: int) -> None:
        """The image is not fit to judge by: what is told of it, now or later, tells nothing."""
        self.heard = False
        self.unseen_ns = until_ns
        for track in self.tracks:
            track.told_px = track.carried_px = None
        told = [claim.stamp_ns for claim in self.waiting if claim.stamp_ns <= until_ns]
        self.waiting = [claim for claim in self.waiting if claim.stamp_ns > until_ns]
        if told:
            self.last_ns = max(*told, self.last_ns or 0)

    # -- messages ------------------------------------------------------------------------------------

    def hear(self, frame_ns: int, half_ns: int, current: ImageStack) -> None:
        """Judge every message that belongs to this frame or an earlier one."""
        self.heard = False
        self.waiting.sort(key=lambda claim: claim.stamp_ns)
        while self.waiting and self.waiting[0].stamp_ns <= frame_ns + half_ns:
            claim = self.waiting.pop(0)
            if claim.stamp_ns <= max(self.unseen_ns, -1 if self.last_ns is None else self.last_ns):
                continue  # told again, out of order, or of an image that nobody could judge by
            self._judge(claim, current, frame_ns, half_ns)
            self.heard = True

    def _judge(self, claim: DetectionClaim, current: ImageStack, frame_ns: int, half_ns: int) -> None:
        if self.last_ns is not None:
            self._steps_s.append(min((claim.stamp_ns - self.last_ns) * 1e-9, _SLOWEST_S))
            # The (lower) median: a pause is no slower rate, and two messages at once are no faster one.
            self.interval_s = sorted(self._steps_s)[(len(self._steps_s) - 1) // 2]
        self.last_ns = claim.stamp_ns
        if claim.detections:
            self.unboxed = sum(has_no_box(d) for d in claim.detections)
        message = ObjectMessage.of(claim, self.tracks, self.camera, self.settings.classes)
        before = list(self.tracks)
        self.shares.share_out(self.tracks, self.interval_s)
        self._judge_missing(message, current)
        hiders = self._judge_told(message, current)
        self._forget_doubles(message)
        self._meet_unknown(message, hiders, current, frame_ns, half_ns)
        self._stand_ins = (self._stand_ins | stand_ins(self.tracks)) & {track.number for track in self.tracks}
        kept = {id(track) for track in self.tracks}
        self.memory.drop(track for track in before if id(track) not in kept)
        self.told_before.keep(message.boxes, claim.stamp_ns)
        self.shares.weigh(self.tracks)

    def _judge_missing(self, message: ObjectMessage, current: ImageStack) -> None:
        """Objects that it does not tell of."""
        missing, boxes, own = message.missing, message.boxes, message.own
        stand = np.array([self.tracks[i].group in STANDING for i in missing], dtype=bool)
        covering = Covering.of(own[missing], stand, boxes, message.stand)
        self._look_through(covering, message, dict(enumerate(missing)), np.ones(len(boxes), dtype=bool))
        hiders = covering.which & message.stand  # a box that need not stand there takes nobody's corners away
        untold = self.background.difference() if any(self.tracks[i].is_soft for i in missing) else None
        untold = None if untold is None else without_boxes(untold, message.carried)
        for k, i in enumerate(missing):
            track = self.tracks[i]
            is_told = self._may_be_told(track, own[i], message)
            track.retold += is_told
            track.look_for(untold, message.stamp_ns, self.scene.frame)
            share = float(covering.share[k])
            self._absent(track, message.stamp_ns, boxes[hiders[k]], share, current, is_told=is_told)

    def _judge_told(self, message: ObjectMessage, current: ImageStack) -> npt.NDArray[np.bool_]:
        """Objects that it tells of; the answer, (M, M): which of its boxes may hide which."""
        found, boxes = message.found, message.boxes
        owners = {self.tracks[i].track_id: self.tracks[i] for i in found}
        covering = Covering.among(boxes, message.stand)
        known = np.zeros(len(boxes), dtype=bool)
        known[[j for i, j in found.items() if self.tracks[i].weight >= self.settings.established]] = True
        self._look_through(covering, message, {j: i for i, j in found.items()}, known)
        hiders = covering.which & message.stand
        for i, j in found.items():
            track, owner = self.tracks[i], owners.get(message.detections[j].track_id)
            track.cover_then = float(covering.by_any[j])
            track.hidden_then = float(covering.share[j])
            self._present(track, message, j, owner, current, boxes[hiders[j]])
            if track.hidden_then > self.settings.most_covered:
                track.cover.tell(track.hidden_then)
        return hiders

    def _forget_doubles(self, message: ObjectMessage) -> None:
        """Call objects by their ids, and forget those that were told of under another one, or were none."""
        told = [self.tracks[i] for i in message.found]
        call_by_ids(told, {self.tracks[i].name for i in message.missing})
        self.tracks = without_doubles([track for track in self.tracks if track.retold < _RETOLD], told)

    def _meet_unknown(
        self, message: ObjectMessage, hiders: npt.NDArray[np.bool_], current: ImageStack, frame_ns: int, half_ns: int
    ) -> None:  # fmt: skip
        """Follow what it tells of for the first time, the largest first."""
        boxes, self.unfollowed = message.boxes, 0
        unknown = sorted(message.unknown, key=lambda j: -longer_side(boxes[j]))
        for n, j in enumerate(unknown):
            if not make_room(self.tracks, longer_side(boxes[j]), self.settings):
                self.unfollowed = len(unknown) - n
                break
            track = self._meet(message.detections[j], boxes[j], message.stamp_ns)
            track.meet(boxes[j], message.stamp_ns, frame_ns, half_ns, current.size)
            track.renew(current, self.settings, self.scene.frame, boxes[hiders[j]])

    def _may_be_told(self, track: ObjectTrack, own_px: FloatArray, message: ObjectMessage) -> bool:
        """Whether a box of a message, under an id that just came up, may be an object that it does not tell of."""
        boxes, new = message.boxes, np.ones(len(message.boxes), dtype=bool)
        for m, j in message.found.items():
            other = self.tracks[m]
            new[j] = other.met_ns > track.last_seen_ns and other.detections <= _RETOLD
        if not new.any():
            return False
        boxes = boxes[new]
        iou, within = (each[:, 0] for each in overlaps(boxes, own_px[None]))
        is_part = within >= _PART  # it may be told of; what stands behind the object and is seen sticks out
        keeps = track.keeps_place(self.settings)
        least = np.where(is_part | (not keeps), LEAST_OVERLAP, own_overlap(self.edges.deviation))
        return any(track.share_in(box, own_px) >= _HALF_HELD for box in boxes[iou >= least])

    def _look_through(
        self, covering: Covering, message: ObjectMessage, tracks: dict[int, int], known: npt.NDArray[np.bool_]
    ) -> None:
        """Believe no box that it hides an object whose corners stay.

        `tracks`: by row of the covering; `known`, (M,): boxes that may be taken for the same object all the same.
        """
        crowded = np.flatnonzero(covering.shares.sum(axis=1) > self.settings.most_covered)
        for k in crowded.tolist():
            if k in tracks:
                i, others = tracks[k], np.flatnonzero(covering.which[k])
                shown = self.tracks[i].shows_through(message.boxes[others], message.own[i])
                covering.besides(k, others[shown], known)

    def habits(self) -> ObjectHabits:
        """How often this detector was seen to err, and for how long."""
        return self.memory.habits(self.interval_s, self.missed, self.misnamed, self.tracks)

    def _absent(
        self,
        track: ObjectTrack,
        stamp_ns: int,
        covers: FloatArray,
        cover: float,
        current: ImageStack,
        *,
        is_told: bool,
    ) -> None:
        track.miss(current, self.settings, self.scene.frame, covers, cover)
        miss = track.cover.miss(cover) if cover > self.settings.most_covered else 0.0
        # A box with nothing in it, or told in another's stead, was no object: nobody hides it. And one under a new id
        # may be it.
        if track.phantom.accused or is_told or track.number in self._stand_ins:
            track.hiding.excuse()
        elif track.looks.figure.may_be_there:
            pass  # such a message tells nothing
        elif fair := track.absence(current.size, self.settings, by_boxes=False):
            end_misses(track, fair)
        elif miss is not None and not track.absence(current.size, self.settings):
            # Otherwise this message tells nothing: a box that may cover it is no proof that it has gone.
            note_cut_off(track, current.size)
            track.hiding.wrong(
                self.interval_s,
                self.shares.threshold("hiding", track),
                stamp_ns,
                root_area(track.box_px),
                covered=miss,
                vouched=track.looks.figure.vouches or not track.looks.figure.is_there,
            )
            if track.hiding.accused or track.accused_ns is not None:
                track.accused_ns = stamp_ns

    def _present(
        self, track: ObjectTrack, message: ObjectMessage, j: int, owner: ObjectTrack | None, current: ImageStack,
        covers: FloatArray,
    ) -> None:  # fmt: skip
        detection, box, stamp_ns = message.detections[j], message.boxes[j], message.stamp_ns
        s = self.settings
        known = track.weight >= s.established
        group = s.classes.of(detection.label)
        is_anothers = bool(detection.track_id) and owner is not None and owner is not track
        swapped = known and is_anothers and owner is not None and are_apart(track.box_px, owner.box_px)
        vote = vote_of(detection.score, box)
        misnamed = known and group != track.group and track.votes.get(track.group, 0.0) >= _LEAST_VOTE
        track.hiding.right(self.interval_s, root_area(track.box_px))
        track.accused_ns = None
        track.looks.figure.told = 0.0  # by the last message, which may have missed it
        if not (misnamed or swapped):
            track.naming.right(self.interval_s)
            track.called = track.called if track.naming.accused else ""
        else:
            fair = track.absence(current.size, s)
            soft = track.is_soft and (not fair or fair.startswith(_BY_CORNERS))
            if soft:
                where = box + track.box_px - track.box_at(stamp_ns)
                track.looks.look_at(current, self.background.difference(), where)
                fair = "" if track.looks.are_the_same else fair
            if track.looks.differ or (fair and not soft):
                track.naming.excuse()
            else:
                track.is_swapped = not misnamed
                track.called = f"id {detection.track_id}" if track.is_swapped else detection.label
                threshold = self.shares.threshold("misclassification", track)
                track.naming.wrong(self.interval_s, threshold, stamp_ns, vouched=not fair)
        if not swapped and detection.track_id:
            track.track_id = detection.track_id
        # Never learn from what is suspected, where the old name is as well founded as an accusation must be.
        if not track.naming.accused and not (misnamed and self._is_sure_of(track)):
            track.votes[group] = track.votes.get(group, 0.0) + vote
            track.label = track.label if misnamed else detection.label
        track.weight += vote
        track.take_over(detection, box)
        track.carried_px = track.carried(box, stamp_ns, current.size)
        track.detect(box, stamp_ns, current.size)
        self._look_behind(track, group, stamp_ns)
        track.renew(current, s, self.scene.frame, covers)
        if track.naming.errors:
            return
        if track.is_soft:
            told_ns, image_ns = track.frame_at(stamp_ns), track.history[-1][0]
            track.looks.learn(current, self.background.difference(), track.box_px, told_ns, image_ns)
        else:
            track.looks.forget()

    def _is_sure_of(self, track: ObjectTrack) -> bool:
        """Whether the name it had till now could be the error: by the same test as the new one."""
        messages = int(track.votes[track.group] / FULL_VOTE)
        first, each = (
            self.misnamed.wrong(track.naming.own, after, self.interval_s) for after in (False, True)
        )
        told = first + (messages - 1) * each if messages else 0.0
        return told >= self.shares.threshold("misclassification", track)

    def _look_behind(self, track: ObjectTrack, group: str, stamp_ns: int) -> None:
        """Add up what speaks for a box that shows the background only."""
        if track.looked_frame == self.scene.frame:
            return  # a faster detector tells of the same image again: no new evidence
        track.looked_frame = self.scene.frame
        track.phantom.why = ""
        if group not in STANDING:
            track.phantom.why = f"a {track.label} need not stand on the ground"
            return
        if in_view(track.box_px, (self.camera.width, self.camera.height)) < self.settings.least_in_view:
            track.phantom.why = "it is leaving the view"
            return
        told = self.scene.evidence(track, sees_foot=track.cover_then <= _HIDDEN_FOOT)
        if told == (None, None):
            track.phantom.why = self.scene.why or "its corners cannot be told from the ground"
            return
        # What a detector imagines by itself is short and unsure.
        sure = track.weight >= self.settings.established
        track.phantom.add(*told, self.shares.threshold("injection", track), stamp_ns, sure=sure)

    def _meet(self, detection: Detection, box: FloatArray, stamp_ns: int) -> ObjectTrack:
        self._made += 1
        track = ObjectTrack(
            name=new_name(self.tracks, detection.track_id, self._made),
            track_id=detection.track_id,
            label=detection.label,
            box_px=box,
            hiding=ErrorTest(self.missed),
            naming=ErrorTest(self.misnamed),
            edges=self.edges,
            number=self._made,
            met_ns=stamp_ns,
            born_id=detection.track_id,
        )
        vote = vote_of(detection.score, box)
        track.votes[self.settings.classes.of(detection.label)] = vote
        # What stood there all the time is as likely no object, or one that the detector cannot see.
        track.weight = vote - FULL_VOTE * self.told_before.missed(box, self.background, stamp_ns)
        track.take_over(detection, box)
        self.tracks.append(track)
        return track
