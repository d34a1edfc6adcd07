"""The film strip of an accused object: a few pictures of it from before the lie until after the alert."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import cv2
import numpy as np

from belie.geometry import FloatArray
from belie.types import Alert, AlertType, Frame, GrayImage, Verdict

if TYPE_CHECKING:
    from belie.detector.object_view import ObjectView

Role = Literal["before", "lie begins", "during", "alert", "after"]

OBJECT_ALERTS = (
    AlertType.OBSTACLE_HIDING,
    AlertType.OBJECT_MISCLASSIFICATION,
    AlertType.OBSTACLE_INJECTION,
)
SIDE_PX = 168  # of a picture
_SURROUND = 1.7  # side of a picture relative to the object's longer side
_BEFORE = 30  # frames kept of every object, 0.8 MB
_AFTER = 12  # frames that a film goes on after the alert
_EARLIER = 4  # frames from the first picture to the last one before the lie
_MOST_FILMS = 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shot:
    """One object in one frame; all coordinates are those of its picture, edges from 0 to `SIDE_PX`."""

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

    def placed(self, edges_px: FloatArray) -> FloatArray:
        """A box of the image, in the coordinates of the picture."""
        return np.asarray((edges_px - np.tile(self.centre_px, 2)) * self.scale + 0.5 * SIDE_PX)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Film:
    """All shots of one object around one alert, in order."""

    alert: Alert
    raised_ns: int
    label: str
    told_label: str
    shots: tuple[Shot, ...]

    def strip(self) -> list[tuple[Role, Shot]]:
        """About six shots: two before the lie, where it begins, during it, at the alert, and after it.

        >>> dark = np.zeros((2, 2), np.uint8)
        >>> shots = tuple(Shot(number=k, stamp_ns=k, picture=dark, box=np.zeros(4), detected=None,
        ...     predicted=np.zeros((0, 2)), observed=np.zeros((0, 2)), error_px2=None, status="missing",
        ...     told_label="", misnamed=False, centre_px=np.zeros(2), scale=1.0) for k in range(30))
        >>> alert = Alert(type=AlertType.OBSTACLE_HIDING, source="/d", onset_ns=15, object="7")
        >>> film = Film(alert=alert, raised_ns=19, label="car", told_label="", shots=shots)
        >>> [(role, shot.number) for role, shot in film.strip()]
        [('before', 10), ('before', 14), ('lie begins', 15), ('during', 17), ('alert', 19), ('after', 29)]
        """
        stamps = np.array([shot.stamp_ns for shot in self.shots])
        last = len(stamps) - 1
        onset = min(int(np.searchsorted(stamps, self.alert.onset_ns)), last)
        raised = min(int(np.searchsorted(stamps, self.raised_ns)), last)
        first: Role = "lie begins" if self.alert.onset_ns >= stamps[0] else "during"
        wanted: list[tuple[int, Role]] = [
            (raised, "alert"), (onset, first), (onset - 1, "before"), (onset - 1 - _EARLIER, "before"),
            ((onset + raised) // 2, "during"), (last, "after"),
        ]  # fmt: skip
        chosen: dict[int, Role] = {}
        for index, role in wanted:
            if 0 <= index <= last:
                chosen.setdefault(index, role)
        return [(chosen[index], self.shots[index]) for index in sorted(chosen)]


@dataclass(slots=True)
class _Open:
    """A film that is still being taken."""

    film: Film
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

    _past: dict[tuple[str, str], deque[Shot]] = field(default_factory=dict)
    _open: dict[tuple[str, str, AlertType], _Open] = field(default_factory=dict)
    _done: list[Film] = field(default_factory=list)

    def add(self, frame: Frame, views: Iterable[ObjectView], verdict: Verdict) -> None:
        """Take in a frame, the objects in it, and what is said of them."""
        seen = {(view.source, view.name): view for view in views}
        self._past = {key: shots for key, shots in self._past.items() if key in seen}
        for key, view in seen.items():
            shots = self._past.setdefault(key, deque(maxlen=_BEFORE))
            shots.append(_shot(frame, view, verdict.frame))
            _place_late(shots, view)
        for where in list(self._open):
            self._continue(where)
        for alert in verdict.alerts:
            key = (alert.source, alert.object or "")
            if (
                alert.type in OBJECT_ALERTS
                and key in seen
                and len(self._open) + len(self._done) < _MOST_FILMS
            ):
                film = Film(
                    alert=alert, raised_ns=verdict.stamp_ns, label=seen[key].label,
                    told_label=seen[key].told_label, shots=(),
                )  # fmt: skip
                self._open[*key, alert.type] = _Open(film, list(self._past[key]))

    def _continue(self, where: tuple[str, str, AlertType]) -> None:
        taken, past = self._open[where], self._past.get(where[:2])
        taken.left -= 1
        if past is not None:
            known = {shot.stamp_ns: shot for shot in past}
            taken.shots = [known.pop(shot.stamp_ns, shot) for shot in taken.shots]
            taken.shots += [shot for shot in known.values() if shot.stamp_ns > taken.shots[-1].stamp_ns]
        if past is None or taken.left <= 0:
            self._end(where)

    def _end(self, where: tuple[str, str, AlertType]) -> None:
        taken = self._open.pop(where)
        self._done.append(replace(taken.film, shots=tuple(taken.shots)))

    def finish(self) -> tuple[Film, ...]:
        """The films so far, in the order of their alerts."""
        for where in list(self._open):
            self._end(where)
        return tuple(sorted(self._done, key=lambda film: film.raised_ns))


def _shot(frame: Frame, view: ObjectView, number: int) -> Shot:
    box = view.box_px
    centre = 0.5 * (box[:2] + box[2:])
    scale = SIDE_PX / (_SURROUND * max(float((box[2:] - box[:2]).max()), 8.0))
    shift = 0.5 * SIDE_PX - 0.5 + (0.5 - centre) * scale
    picture = cv2.warpAffine(
        frame.image, np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]]]), (SIDE_PX, SIDE_PX),
        flags=cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR, borderValue=235.0,
    )  # fmt: skip
    shot = Shot(
        number=number,
        stamp_ns=frame.stamp_ns,
        picture=np.asarray(picture, dtype=np.uint8),
        box=box,
        detected=None,
        predicted=(view.predicted_px + 0.5 - centre) * scale + 0.5 * SIDE_PX,
        observed=(view.observed_px + 0.5 - centre) * scale + 0.5 * SIDE_PX,
        error_px2=view.error_px2,
        status=view.status,
        told_label=view.told_label,
        misnamed=view.misnamed,
        centre_px=centre,
        scale=scale,
    )
    return replace(shot, box=shot.placed(box))


def _place_late(shots: deque[Shot], view: ObjectView) -> None:
    """Draw a detected box where its message says: in an earlier picture, if it came late."""
    if view.detected_px is None:
        return
    nearest = min(range(len(shots)), key=lambda i: abs(shots[i].stamp_ns - view.told_ns))
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
