"""One object: where it is by its own pixels, what it was called, and what speaks for its being there."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from belie.checks.objects import CoverHabit, ErrorTest, ObjectSettings, PhantomTest
from belie.detector.covering import LEAST_CORNERS, shown_through
from belie.detector.edge_noise import BoxSteps, EdgeNoise
from belie.detector.looks import Looks
from belie.detector.object_corners import ObjectCorners, riding
from belie.detector.places import in_view, places_in
from belie.geometry import FloatArray
from belie.geometry.boxes import inside, longer_side
from belie.odometry.local_features import ImageStack, View, local_corners, window_of
from belie.odometry.local_motion import LocalMotion, follow_object, moved_box
from belie.odometry.tracking import TrackingSettings
from belie.types import Detection

_HISTORY = 16  # frames that a late message may refer to
_TRUST = 0.5  # of a detected box against the predicted one: both are uncertain by a few per cent
_SPREAD = 0.9
_LOST = 2  # corners
_RESTS = 4  # frames
_EDGE = 0.1  # of the side: two standard deviations of a detected edge
_LEAD = 0.3


@dataclass(slots=True)
class ObjectTrack:
    """An object that a detector has told of.

    `box_px` may reach beyond the image: an object that is leaving is not shrinking.
    """

    name: str
    track_id: str
    label: str
    box_px: FloatArray
    hiding: ErrorTest
    naming: ErrorTest
    number: int = 0  # in the order in which its detector's objects were met
    met_ns: int = 0  # stamp of the message that first told of it
    born_id: str = ""  # its track id in that message
    corners: ObjectCorners = field(default_factory=ObjectCorners)
    phantom: PhantomTest = field(default_factory=PhantomTest)  # whether the box shows the background
    edges: EdgeNoise = field(default_factory=EdgeNoise)  # of its detector
    steps: BoxSteps = field(default_factory=BoxSteps)
    detections: int = 0
    weight: float = 0.0  # of all detections
    votes: dict[str, float] = field(default_factory=dict)  # weight by group of labels
    growth: float = 1.0
    shift_px: FloatArray = field(default_factory=lambda: np.zeros(2))
    corners_then: int = 0  # when it was last detected
    contrast: float = 0.0
    contrast_then: float = 0.0
    last_seen_ns: int = 0
    last_found_ns: int = 0
    placed_by_looks_ns: int = 0  # last message that did not tell of it, in which its figure was found
    # Last message in which its pixels bore out that it is hidden, if that is alleged.
    accused_ns: int | None = None
    looked_frame: int = -1  # frame count when the scene last told what is in its box
    motion: LocalMotion | None = None
    view: View | None = None
    history: deque[tuple[int, FloatArray]] = field(default_factory=lambda: deque(maxlen=_HISTORY))
    cover_then: float = 0.0  # share of its box under another detection, when it was last detected
    hidden_then: float = 0.0  # the same, under one that may hide it
    searched: tuple[int, int] = (
        0,
        0,
    )  # corners after the last search, and the frame count when another may find more
    # That may hide it, at the last message.
    covers: FloatArray = field(default_factory=lambda: np.empty((0, 4)))
    cover: CoverHabit = field(default_factory=CoverHabit)
    # Corners and box when it was last told of with no corner in a box that may cover it.
    open_then: tuple[ObjectCorners, FloatArray] | None = None
    called: str = ""  # its last label or id, where that is not its own
    is_swapped: bool = False  # that is an id
    told_px: FloatArray | None = None  # its detected box, if a message came since the last image
    carried_px: FloatArray | None = None  # the same, carried to that image; None if it cannot be
    placed_ns: int = 0  # stamp from which on it is known where it was
    cut_off: int = 0  # messages in a row that missed it while the image's border cut it off
    told_frame: int = -1  # frame count when it was last told of
    retold: int = 0  # messages since then in which a box under a new id may be it
    told_area_px2: float = 0.0  # of the last detected box
    told_label: str = ""
    told_id: str = ""
    told_middle: FloatArray | None = None  # of the last detected box
    speed_px_s: FloatArray | None = None  # of the detected boxes
    looks: Looks = field(default_factory=Looks)
    # Its shift by the camera's rotation: up to each frame of its history, and to that of the last detected box.
    turns_px: deque[FloatArray] = field(default_factory=lambda: deque(maxlen=_HISTORY))
    told_turn_px: FloatArray = field(default_factory=lambda: np.zeros(2))
    # Frame count and (carried) box of the message before the last one.
    told_before: tuple[int, FloatArray] | None = None

    def follow(
        self,
        previous: ImageStack,
        current: ImageStack,
        stamp_ns: int,
        settings: TrackingSettings,
        turn_px: FloatArray,
    ) -> None:
        """Carry the object from the previous image to this one by its own pixels.

        `turn_px`: how the camera's rotation shifts it, shape (2,); its own motion goes on beside it.
        """
        view = self.view
        if view is None or not view.fits(self.box_px):
            view = View.of(previous, window_of(self.box_px))
        step_s = (stamp_ns - self.history[-1][0]) * 1e-9 if self.history else 0.0
        if self.speed_px_s is not None and self.is_soft:
            self.growth, self.shift_px = 1.0, self.speed_px_s * step_s
        leads = self._leads() if self.hiding.length else None
        motion = follow_object(
            view, current, self.box_px, self.corners.px, self.growth, self.shift_px + turn_px, settings, leads
        )
        self.turns_px.append(turn_px + (self.turns_px[-1] if self.turns_px else 0.0))
        self.motion, self.view = motion, motion.view
        self.told_px = self.carried_px = None
        # Where few corners agree, and none has proved to be the object's, they may as well be the background's.
        is_led = (
            self.speed_px_s is None or not self.is_soft or 2 * motion.agreeing.sum() >= len(motion.agreeing)
        )
        if motion.error_px2 is not None and is_led:
            self.last_found_ns = stamp_ns
            self.growth = min(max(motion.growth, 0.8), 1.25)
            self.shift_px = motion.shift_px - turn_px
        else:
            self.growth = 1.0  # what is not seen to grow may be covered: it must not fill the image
        self.box_px = motion.box_px if is_led else motion.predicted_box_px
        self.corners.px = motion.found_px
        self.corners.keep(motion.agreeing)
        self.contrast = motion.view.contrast
        self.history.append((stamp_ns, self.box_px))

    def box_at(self, stamp_ns: int) -> FloatArray:
        """Its box in the frame nearest to a stamp."""
        return self.history[self._nearest(stamp_ns)][1] if self.history else self.box_px

    def frame_at(self, stamp_ns: int) -> int:
        """Stamp of that frame."""
        return self.history[self._nearest(stamp_ns)][0]

    def _nearest(self, stamp_ns: int) -> int:
        newest = len(self.history) - 1
        if newest < 0 or self.history[newest][0] <= stamp_ns:
            return newest
        return min(range(newest + 1), key=lambda k: abs(self.history[k][0] - stamp_ns))

    def carried(self, box_px: FloatArray, stamp_ns: int, size: tuple[int, int]) -> FloatArray | None:
        """A detected box of an earlier or this frame as it would be in this one; None where that is not known.

        An edge at the image's border stays there.
        """
        is_forgotten = len(self.history) == _HISTORY and stamp_ns < self.history[0][0]
        if is_forgotten or stamp_ns < self.placed_ns:
            return None
        then = self._nearest(stamp_ns)
        if then == len(self.history) - 1:
            return box_px
        borders = np.array([0.0, 0.0, *size])
        moved = np.clip(box_px + (self.box_px - self.history[then][1]), 0.0, np.tile(size, 2))
        moved = np.where(np.abs(box_px - borders) < 2.0, box_px, moved)
        return moved if bool((moved[2:] - moved[:2] >= 2.0).all()) else None

    def meet(
        self, box_px: FloatArray, stamp_ns: int, frame_ns: int, half_ns: int, size: tuple[int, int]
    ) -> None:
        """Take over its first detected box, told at a frame that may be a later one."""
        self.placed_ns = frame_ns - half_ns
        self.history.append((frame_ns, box_px))
        self.turns_px.append(np.zeros(2))
        self.carried_px = self.carried(box_px, stamp_ns, size)
        self.detect(box_px, stamp_ns, size)

    def share_in(self, box_px: FloatArray, own_px: FloatArray) -> float:
        """Share of its proven corners in a box that was told when its own was `own_px`; 1 if there are too few."""
        places = self.corners.places[self.corners.proven]
        if len(places) < LEAST_CORNERS or self.motion is None or self.motion.error_px2 is None:
            return 1.0
        px = own_px[:2] - 0.5 + places * (own_px[2:] - own_px[:2])
        return float((np.abs(places_in(box_px, px) - 0.5) < 0.5 + _EDGE).all(axis=1).mean())

    def shows_through(self, boxes: FloatArray, own_px: FloatArray) -> npt.NDArray[np.bool_]:
        """Of boxes of others (M, 4), told when its own was `own_px`: whether it shows through, where they overlap.

        Corners that were its own before anything covered it, and keep their places in it, are no other's: who comes
        before it takes them away. So a box that nothing stands in hides nobody.
        """
        if self.open_then is None:
            return np.zeros(len(boxes), dtype=bool)
        before, box_px = self.open_then
        then = places_in(box_px, before.px[before.proven])
        newest = before.births[before.proven].max(initial=-1)
        own = self.corners.proven & (self.corners.births <= newest)
        now = places_in(self.box_px, self.corners.px[own])
        return np.asarray(shown_through(boxes, own_px, then, now, self.corners.places[own]))

    @property
    def group(self) -> str:
        """What it is: the group of labels that most detections, by weight, gave it."""
        return max(self.votes, key=lambda group: self.votes[group], default="")

    @property
    def proven(self) -> int:
        """How many corners have ridden with the detected box long enough to be the object's, not the background's."""
        return int(np.count_nonzero(self._leads()))

    def _leads(self) -> npt.NDArray[np.bool_]:
        return np.asarray(self.corners.proven & ~inside(self.corners.px, self.covers))

    def keeps_place(self, settings: ObjectSettings) -> bool:
        """Whether it is known where it is though nobody tells of it: by corners that were its own when it was told of.

        Not where others may hide some of it: what is followed may be theirs.
        """
        if self.is_soft or self.hidden_then > _EDGE:
            return False
        then = self._leads() & (self.corners.births < self.told_frame)
        return int(np.count_nonzero(then)) >= settings.least_present * self.corners_then

    @property
    def is_soft(self) -> bool:
        """Whether its corners do not last: then its picture as a whole must speak for it."""
        return self.corners_then < 2 * LEAST_CORNERS

    def take_over(self, detection: Detection, box_px: FloatArray) -> None:
        """Keep what a message says of it."""
        self.told_px, self.told_label, self.told_id = box_px, detection.label, detection.track_id
        left, top, right, bottom = box_px.tolist()
        self.told_area_px2 = (right - left) * (bottom - top)

    def detect(self, box_then_px: FloatArray, stamp_ns: int, size: tuple[int, int]) -> None:
        """Take over a detected box of an earlier or this frame: edges at the image's border tell nothing."""
        own, told, now = self.box_at(stamp_ns).tolist(), box_then_px.tolist(), self.box_px.tolist()
        growth = [(now[k + 2] - now[k]) / max(own[k + 2] - own[k], 1.0) for k in (0, 1)]
        correction = []
        for k, border in enumerate((0.0, 0.0, *size)):
            is_cut = abs(told[k] - border) < 2.0 and (own[k] < border if k < 2 else own[k] > border)
            correction.append(0.0 if is_cut else growth[k % 2] * (told[k] - own[k]))
        off_px = 0.5 * math.hypot(*(told[k] + told[k + 2] - own[k] - own[k + 2] for k in (0, 1)))
        self.looks.figure.meet(off_px, longer_side(box_then_px))
        weight = _TRUST if self.detections > 1 and not self.is_soft else 1.0
        self._learn_speed(box_then_px, stamp_ns)
        left, top, right, bottom = (edge + weight * c for edge, c in zip(now, correction, strict=True))
        # Of what is cut at the border, at most as much again is believed to lie outside: else it grows for ever.
        width, height = told[2] - told[0], told[3] - told[1]
        left, top = max(left, -width), max(top, -height)
        right, bottom = min(right, size[0] + width), min(bottom, size[1] + height)
        if right - left >= 2.0 and bottom - top >= 2.0:
            self._correct(np.array([left, top, right, bottom]) - self.box_px, stamp_ns)
            # Where the box goes on ahead of the pixels, those are not its own: expect it there next time.
            if self.detections > 1:
                lead = 0.5 * _LEAD * weight
                drift = (lead * (correction[0] + correction[2]), lead * (correction[1] + correction[3]))
                self.shift_px = self.shift_px + np.array(drift)
        self.last_seen_ns = max(self.last_seen_ns, stamp_ns)
        self.detections += 1

    def _correct(self, change_px: FloatArray, stamp_ns: int) -> None:
        """Move its box, from the frame of a message on: else the next message would find the same error again.

        A correction that works only when its messages are over adds up with all that are under way: from three on
        (a detector that is 0.1 s late at 30 Hz), or with four messages to one image, the box swings ever farther.
        """
        self.box_px = self.box_px + change_px
        for k in range(max(self._nearest(stamp_ns), 0), len(self.history)):
            frame_ns, box_px = self.history[k]
            self.history[k] = frame_ns, box_px + change_px

    def _learn_speed(self, box_px: FloatArray, stamp_ns: int) -> None:
        """How its detections move: the guide where its own corners do not last."""
        middle = 0.5 * (box_px[:2] + box_px[2:])
        turn_px = self.turns_px[self._nearest(stamp_ns)] if self.turns_px else np.zeros(2)
        if self.told_middle is not None and stamp_ns > self.last_seen_ns:
            own_px = middle - self.told_middle - (turn_px - self.told_turn_px)
            speed = own_px / ((stamp_ns - self.last_seen_ns) * 1e-9)
            last = self.speed_px_s
            self.speed_px_s = speed if last is None else last + _TRUST * (speed - last)
        self.told_middle, self.told_turn_px = middle, turn_px

    def renew(self, current: ImageStack, settings: ObjectSettings, frame: int, covers: FloatArray) -> None:
        """It was told of: drop corners that do not ride with the box, and find new ones.

        `covers`: boxes (N, 4) of others that may cover it; corners in them are those of the nearer object.
        """
        self.corners.ages = self.corners.ages + 1
        self.corners.keep(riding(self.box_px, self.corners.px, self.corners.places))
        if self.carried_px is not None:
            self.corners.bear_again(self.carried_px, frame)
        self.covers, self.told_frame, self.retold = covers, frame, 0
        self._search(current, settings, frame)
        covered = inside(self.corners.px, covers)
        self.corners.ages[covered] = 0
        if not covered.any():
            self.open_then = replace(self.corners), self.box_px
        self.told_before = None if self.carried_px is None else (frame, self.carried_px)
        self.corners_then = self.proven
        self.contrast_then = self.contrast

    def miss(
        self, current: ImageStack, settings: ObjectSettings, frame: int, covers: FloatArray, cover: float
    ) -> None:
        """It was not told of: corners that move as those that spoke for it till now speak for it, too.

        Corners are lost as their object turns, comes nearer or fades; without new ones it would be lost with them. Not
        where most are lost at once, or where `cover`, the share of its box that others may hide, is large, or was:
        most of its box shows other things.
        """
        self.covers = covers
        least = max(LEAST_CORNERS, settings.least_present * self.corners_then)
        if self.proven >= least and max(cover, self.hidden_then) <= settings.most_covered:
            self.corners.ages = self.corners.ages + 1
            self._search(current, settings, frame)

    def look_for(self, untold: ImageStack | None, stamp_ns: int, frame: int) -> None:
        """Find what was not told of and differs from the background as the object did; and go where it fits."""
        self.looks.keep()
        speed = self.speed_px_s if self.is_soft else None
        gone_px = None if speed is None else speed * ((stamp_ns - self.last_seen_ns) * 1e-9)
        found = self.looks.figure.look_for(untold, self.box_px, gone_px, frame)
        if found is None or speed is None:
            return
        self._correct(np.tile(found[0], 2), stamp_ns)
        image_ns = self.history[-1][0] - self.history[-2][0] if len(self.history) > 1 else 0
        since_ns = max(stamp_ns - max(self.last_seen_ns, self.placed_by_looks_ns), image_ns, 1)
        self.speed_px_s = speed + found[1] / (since_ns * 1e-9)
        self.placed_by_looks_ns = stamp_ns
        self.last_found_ns = max(self.last_found_ns, stamp_ns)

    def _search(self, current: ImageStack, settings: ObjectSettings, frame: int) -> None:
        missing = settings.corners - len(self.corners)
        # Where the last search found all there is, another one does so only when some are lost, or after a while.
        again = len(self.corners) < self.searched[0] - _LOST or frame >= self.searched[1]
        if missing > settings.corners // 4 and again:
            if self.view is None or not self.view.fits(self.box_px):
                self.view = View.of(current, window_of(self.box_px))
            inner = moved_box(self.box_px, _SPREAD, np.zeros(2))
            fresh = local_corners(self.view, inner, missing, self.corners.px, current.noise)
            fresh = fresh[~inside(fresh, self.covers)]
            self.searched = len(self.corners) + len(fresh), frame + (1 if len(fresh) else _RESTS)
            # A message that is late tells of a box, and nobody knows (yet) where that is in this image.
            born_in_px = self.box_px if self.told_px is None else self.carried_px
            self.corners.add(fresh, self.box_px, born_in_px, frame)
            if self.contrast == 0.0:
                self.contrast = self.view.contrast

    def absence(self, size: tuple[int, int], settings: ObjectSettings, *, by_boxes: bool = True) -> str:
        """Why its absence from a message may be fair; empty where its pixels say that it is there.

        `by_boxes`: do not believe corners in boxes of others that may cover it.
        """
        if self.weight < settings.established:
            return "not yet established"
        side = longer_side(self.box_px)
        if side < settings.least_side_px:
            return f"too small: {side:.0f} px"
        if in_view(self.box_px, size) < settings.least_in_view:
            return "leaving the view"
        if self.looks.figure.is_there:
            return ""
        if self.is_soft and self.looks.figure.denies:  # its few corners may be the background's
            return "occluded or gone: before the background, nothing like it is seen"
        if self.corners_then < LEAST_CORNERS:
            return f"too few corners on it: {self.corners_then}"
        proven = self.proven if by_boxes else int(np.count_nonzero(self.corners.proven))
        there = proven / self.corners_then
        if there < settings.least_present or proven < LEAST_CORNERS:
            if self.is_soft:  # some are lost in every image: that tells nothing
                return f"too few corners on it: {proven} of {self.corners_then} are found again"
            return f"occluded or gone: {100 * there:.0f} % of its corners are found again"
        if self.contrast < settings.least_contrast * self.contrast_then:
            return f"fading: {100 * self.contrast / self.contrast_then:.0f} % of its contrast is left"
        return ""
