"""The film strip of an accused object: a few pictures of it from before the lie until after the alert."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import cv2
import numpy as np

from belie.attacks import AttackLabel
from belie.evaluation.followed import FollowedObject, accused, elsewhere_px
from belie.geometry import FloatArray
from belie.types import Alert, AlertType, Frame, GrayImage, Verdict

Role = Literal["before", "lie begins", "during", "alert", "after", "attack begins", "attacked", "attack over"]

OBJECT_ALERTS = (
    AlertType.OBSTACLE_HIDING,
    AlertType.OBJECT_MISCLASSIFICATION,
    AlertType.OBSTACLE_INJECTION,
)
SIDE_PX = 168  # of a picture
LOST = "no longer followed"  # status of a shot
_SURROUND = 1.7  # side of a picture relative to the object's longer side
_BEFORE = 30  # frames kept of every object, 0.8 MB
_AFTER = 12  # frames that a film goes on after the alert
_EARLIER = 4  # frames from the first picture to the last one before the lie
_MOST_FILMS = 6
_CLEAR = 0.5  # share of its box in the image: the last picture of one that leaves shows little of it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shot:
    """One object in one frame; coordinates are those of its picture, edges from 0 to `SIDE_PX`.

    `box_px`, `centre_px` and `told_px` (all boxes of the message, by track id) are in pixels of the camera's image.
    """

    number: int
    stamp_ns: int
    picture: GrayImage
    box: FloatArray
    detected: FloatArray | None
    predicted: FloatArray
    observed: FloatArray
    error_px2: float | None
    status: str
    told_label: str
    misnamed: bool
    centre_px: FloatArray
    scale: float
    box_px: FloatArray
    in_view: float = 1.0  # share of the box
    told_id: str = ""
    told_px: Mapping[str, FloatArray] = field(default_factory=dict)

    def placed(self, edges_px: FloatArray) -> FloatArray:
        """A box of the image, in the coordinates of the picture."""
        return np.asarray((edges_px - np.tile(self.centre_px, 2)) * self.scale + 0.5 * SIDE_PX)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Film:
    """All shots of one object around one alert, or around an attack on it that raised none, in order.

    Of an attack, `alert` is the one that should have been raised, `raised_ns` is None, and `why` says why it was not.
    """

    alert: Alert
    raised_ns: int | None
    label: str
    told_label: str
    shots: tuple[Shot, ...]
    since_ns: int = 0  # when the object was first seen
    told_id: str = ""
    is_swapped: bool = False  # it had another object's track id when the alert was raised
    attack: AttackLabel | None = None
    why: str = ""

    def elsewhere_px(self, shot: Shot) -> FloatArray | None:
        """Where the message of a shot tells of the track id that is at issue, if not on this object: shape (4,)."""
        return elsewhere_px(self.alert.object, shot.told_id, shot.told_px, shot.box_px)

    @property
    def alert_shot(self) -> Shot:
        """The frame of the alert; where no message tells of that one (it came late), the last before that one does."""
        return self.shots[self._alerted]

    @property
    def _alerted(self) -> int:
        stamps, last = [shot.stamp_ns for shot in self.shots], len(self.shots) - 1
        onset, raised = np.searchsorted(stamps, [self.alert.onset_ns, self.raised_ns or 0]).tolist()
        return self._with_message(min(raised, last), onset, min(raised, last))

    def strip(self) -> list[tuple[Role, Shot]]:
        """About six shots: two before the lie, where it begins, during it, at the alert, and after it.

        Where the detector does not look at every frame, they are frames that it told of.

        >>> dark = np.zeros((2, 2), np.uint8)
        >>> shots = tuple(Shot(number=k, stamp_ns=k, picture=dark, box=np.zeros(4), detected=None,
        ...     predicted=np.zeros((0, 2)), observed=np.zeros((0, 2)), error_px2=None, status="missing",
        ...     told_label="", misnamed=False, centre_px=np.zeros(2), scale=1.0, box_px=np.zeros(4)) for k in range(30))
        >>> alert = Alert(type=AlertType.OBSTACLE_HIDING, source="/d", onset_ns=15, object="7")
        >>> film = Film(alert=alert, raised_ns=19, label="car", told_label="", shots=shots)
        >>> [(role, shot.number) for role, shot in film.strip()]
        [('before', 10), ('before', 14), ('lie begins', 15), ('during', 17), ('alert', 19), ('after', 29)]
        """
        stamps = np.array([shot.stamp_ns for shot in self.shots])
        last = len(stamps) - 1
        after = max((k for k, shot in enumerate(self.shots) if shot.in_view >= _CLEAR), default=last)
        onset = min(int(np.searchsorted(stamps, self.alert.onset_ns)), last)
        near = self._with_message
        before: list[tuple[int, Role]] = [
            (near(onset - 1, 0, onset - 1), "before"),
            (near(onset - 1 - _EARLIER, 0, onset - 1 - _EARLIER), "before"),
        ]
        if self.attack is not None:
            over = min(int(np.searchsorted(stamps, self.attack.end_ns)), last + 1)
            return self._chosen(
                [
                    (near(onset, onset, over - 1), "attack begins"), *before,
                    (near(over - 1, onset, over - 1), "attacked"),
                    (near((onset + over) // 2, onset, over - 1), "attacked"),
                    (near(last, over, last) if over <= last else -1, "attack over"),
                ]
            )  # fmt: skip
        raised = self._alerted
        first: Role = "lie begins" if self.alert.onset_ns >= stamps[0] else "during"
        wanted: list[tuple[int, Role]] = [
            (raised, "alert"), (near(onset, onset, raised), first), *before,
            (near((onset + raised) // 2, onset, raised), "during"),
            (near(max(after, raised), raised + 1, max(after, raised)), "after"),
        ]  # fmt: skip
        return self._chosen(wanted)

    def _with_message(self, wanted: int, first: int, last: int) -> int:
        """Index of the shot from `first` to `last` nearest to the wanted one that has a message; itself if none has."""
        told = [k for k in range(max(first, 0), last + 1) if self.shots[k].status != "not told"]
        return min(told, key=lambda k: abs(k - wanted), default=wanted)

    def _chosen(self, wanted: list[tuple[int, Role]]) -> list[tuple[Role, Shot]]:
        chosen: dict[int, Role] = {}
        for index, role in wanted:
            if 0 <= index < len(self.shots):
                chosen.setdefault(index, role)
        return [(chosen[index], self.shots[index]) for index in sorted(chosen)]


@dataclass(slots=True)
class _Open:
    """A film that is still being taken."""

    film: Film
    key: tuple[str, int]
    shots: list[Shot]
    left: int = _AFTER


@dataclass(slots=True)
class FilmRecorder:
    """Keeps the last pictures of every object, and a film of those that are accused (the first six).

    Examples
    --------
    >>> FilmRecorder().finish()
    ()
    """

    _past: dict[tuple[str, int], deque[Shot]] = field(default_factory=dict)
    _open: list[_Open] = field(default_factory=list)
    _done: list[Film] = field(default_factory=list)

    @property
    def past(self) -> Mapping[tuple[str, int], Sequence[Shot]]:
        """The last shots of every object of the last frame, by its key."""
        return self._past

    def add(self, frame: Frame, objects: Iterable[FollowedObject], verdict: Verdict) -> None:
        """Take in a frame, the objects in it, and what is said of them."""
        seen = {one.key: one for one in objects}
        self._past = {key: shots for key, shots in self._past.items() if key in seen}
        for key, one in seen.items():
            shots = self._past.setdefault(key, deque(maxlen=_BEFORE))
            shots.append(_shot(frame, one, verdict.frame))
            _place_late(shots, one)
        for taken in list(self._open):
            self._continue(taken)
        for alert in verdict.alerts:
            found = accused(seen.values(), alert) if alert.type in OBJECT_ALERTS else None
            if found is not None and len(self._open) + len(self._done) < _MOST_FILMS:
                film = Film(
                    alert=alert, raised_ns=verdict.stamp_ns, label=found.view.label,
                    told_label=found.view.told_label, told_id=found.view.told_id, is_swapped=found.view.is_swapped,
                    since_ns=found.view.met_ns, shots=(),
                )  # fmt: skip
                self._open.append(_Open(film, found.key, list(self._past[found.key])))

    def _continue(self, taken: _Open) -> None:
        past = self._past.get(taken.key)
        taken.left -= 1
        if past is not None:
            known = {shot.stamp_ns: shot for shot in past}
            taken.shots = [known.pop(shot.stamp_ns, shot) for shot in taken.shots]
            taken.shots += [shot for shot in known.values() if shot.stamp_ns > taken.shots[-1].stamp_ns]
        if past is None or taken.left <= 0:
            self._end(taken)

    def _end(self, taken: _Open) -> None:
        self._open.remove(taken)
        self._done.append(replace(taken.film, shots=tuple(taken.shots)))

    def finish(self) -> tuple[Film, ...]:
        """The films so far, in the order of their alerts."""
        for taken in list(self._open):
            self._end(taken)
        return tuple(sorted(self._done, key=lambda film: film.raised_ns or 0))


def _shot(frame: Frame, one: FollowedObject, number: int) -> Shot:
    view = one.view
    shot = bare_shot(frame, view.box_px, number)
    centre, scale = shot.centre_px, shot.scale
    return replace(
        shot,
        predicted=(view.predicted_px + 0.5 - centre) * scale + 0.5 * SIDE_PX,
        observed=(view.observed_px + 0.5 - centre) * scale + 0.5 * SIDE_PX,
        error_px2=view.error_px2,
        status=view.status,
        told_label=view.told_label,
        misnamed=view.misnamed,
    )


def bare_shot(frame: Frame, box_px: FloatArray, number: int) -> Shot:
    """A picture of a place, of whose object nothing is known; `box_px` is of shape (4,)."""
    size = np.array(frame.image.shape[::-1], dtype=np.float64)
    centre, side = _window(box_px, size)
    scale = SIDE_PX / side
    shift = 0.5 * SIDE_PX - 0.5 + (0.5 - centre) * scale
    picture = cv2.warpAffine(
        frame.image, np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]]]), (SIDE_PX, SIDE_PX),
        flags=cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR, borderValue=235.0,
    )  # fmt: skip
    none = np.empty((0, 2))
    shown = np.prod(np.clip(box_px[2:], 0.0, size) - np.clip(box_px[:2], 0.0, size))
    shot = Shot(
        number=number,
        stamp_ns=frame.stamp_ns,
        picture=np.asarray(picture, dtype=np.uint8),
        box=box_px,
        detected=None,
        predicted=none,
        observed=none,
        error_px2=None,
        status=LOST,
        told_label="",
        misnamed=False,
        centre_px=centre,
        scale=scale,
        box_px=box_px,
        in_view=float(shown / np.prod(box_px[2:] - box_px[:2])),
    )
    return replace(shot, box=shot.placed(box_px))


def _window(box_px: FloatArray, size_px: FloatArray) -> tuple[FloatArray, float]:
    """Middle (2,) and side of a square around what the image shows of a box; within the image, if it fits."""
    left_top, right_bottom = (np.clip(edge, 0.0, size_px) for edge in (box_px[:2], box_px[2:]))
    longer = max(float((right_bottom - left_top).max()), 8.0)
    side = min(_SURROUND * longer, max(1.05 * longer, float(size_px.min())))
    half = np.minimum(0.5 * side, 0.5 * size_px)
    return np.clip(0.5 * (left_top + right_bottom), half, size_px - half), side


def _place_late(shots: deque[Shot], one: FollowedObject) -> None:
    """Draw boxes where their message says: in an earlier picture, if it came late."""
    view = one.view
    if one.told_px:
        nearest = _nearest(shots, one.message_ns)
        shots[nearest] = replace(shots[nearest], told_px=one.told_px, told_id=one.view.told_id)
    if view.detected_px is None:
        return
    nearest = _nearest(shots, view.told_ns)
    shot = shots[nearest]
    shots[nearest] = replace(
        shot,
        detected=shot.placed(view.detected_px),
        status="reported",
        told_label=view.told_label,
        misnamed=view.misnamed,
    )
    if nearest != len(shots) - 1:
        shots[-1] = replace(shots[-1], status="not told")


def _nearest(shots: deque[Shot], stamp_ns: int) -> int:
    return min(range(len(shots)), key=lambda i: abs(shots[i].stamp_ns - stamp_ns))
