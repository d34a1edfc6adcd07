"""Which object of a frame is which of the frame before, and what the detector's message told of each.

A track id is what the detector tells, so it may lie: shifted boxes and exchanged ids give one name to two objects.
Here an object is known by where its pixels went.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

from belie.geometry import FloatArray
from belie.geometry.boxes import box_iou, clipped_box_px, longer_side, overlaps, projected_box_px
from belie.types import Alert, AlertType, Claim, Detection, DetectionClaim, Frame, MountedCamera

if TYPE_CHECKING:
    from belie.detector.object_view import ObjectView

_SAME_NAME = 0.5  # what an equal name is worth, in IoU
_LEAST_OVERLAP = 0.3  # IoU of an object in two frames, without an equal name
_LEAPS = 1.0  # of its longer side: how far an object with an equal name may get in one frame
_SAME_BOX_PX = 1.0
_SAME_PLACE = 0.5  # IoU of an object and a box that is told where it is
_KEPT_NS = 5_000_000_000  # how late a message may be heard


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FollowedObject:
    """One object at one frame.

    Parameters
    ----------
    key : int
        Names the object for as long as its pixels are followed, whatever its detector calls it.
    view : ObjectView
        What is known of it.
    since_ns : int
        Stamp of the frame in which it was first seen.
    told_id : str
        The track id that the message heard at this frame gave to its box; empty where none did.
    message_ns : int
        Stamp of that message.
    told_px : mapping of str to array (4,)
        All boxes of that message by track id, image px; empty where no message was heard.
    """

    key: int
    view: ObjectView
    since_ns: int = 0
    told_id: str = ""
    message_ns: int = 0
    told_px: Mapping[str, FloatArray] = field(default_factory=dict)


def elsewhere_px(
    name: str | None, told_id: str, told_px: Mapping[str, FloatArray], own_px: FloatArray
) -> FloatArray | None:
    """The box, shape (4,), that a message tells of under `name`, where that is not the box of the object at `own_px`.

    >>> own, aside = np.array([0.0, 0.0, 9.0, 9.0]), np.array([20.0, 0.0, 29.0, 9.0])
    >>> elsewhere_px("7", "", {"7": aside}, own)
    array([20.,  0., 29.,  9.])
    >>> elsewhere_px("7", "7", {"7": own}, own) is None
    True
    """
    box = None if not name or name == told_id else told_px.get(name)
    return None if box is None or box_iou(box, own_px) >= _SAME_PLACE else box


def accused(objects: Iterable[FollowedObject], alert: Alert) -> FollowedObject | None:
    """The object that an alert means; None where it is not followed.

    Two may bear its name: of these, hiding means the one that is not told of, injection the one that is.
    """
    named = [o for o in objects if (o.view.source, o.view.name) == (alert.source, alert.object)]
    match alert.type:
        case AlertType.OBSTACLE_HIDING:
            meant = [o for o in named if o.view.status != "reported"]
        case AlertType.OBJECT_MISCLASSIFICATION:
            meant = [o for o in named if o.view.misnamed]
        case _:
            meant = [o for o in named if o.view.status == "reported"][-1:]
    return next(iter(meant or named), None)


@dataclass(frozen=True, slots=True)
class _Heard:
    """A message: its stamp, and its boxes in the image with their track ids."""

    stamp_ns: int
    boxes: list[tuple[str, FloatArray]]
    by_id: dict[str, FloatArray]


class ObjectFollower:
    """Keeps the objects of a run apart, and what messages told of them.

    Examples
    --------
    >>> frame = Frame(camera="/image", stamp_ns=5, received_ns=5, image=np.zeros((2, 2), np.uint8))
    >>> ObjectFollower({}).add(frame, (), ())
    ()
    """

    def __init__(self, cameras: Mapping[str, MountedCamera]) -> None:
        self._cameras = cameras
        self._last: tuple[FollowedObject, ...] = ()
        self._messages: dict[str, dict[int, DetectionClaim]] = {}
        self._made = 0
        self._previous_ns: int | None = None

    def add(
        self, frame: Frame, claims: Iterable[Claim], views: Iterable[ObjectView]
    ) -> tuple[FollowedObject, ...]:
        """The objects of a frame; `claims`: those that came with it, `views`: of the detector after it."""
        for claim in claims:
            if isinstance(claim, DetectionClaim):
                self._messages.setdefault(claim.source, {})[claim.stamp_ns] = claim
        half_ns = 0 if self._previous_ns is None else (frame.stamp_ns - self._previous_ns) // 2
        self._previous_ns = frame.stamp_ns
        followed = self._identified(list(views), frame.stamp_ns)
        heard = {source: self._heard(frame, source, frame.stamp_ns + half_ns) for source in self._messages}
        self._last = tuple(_with_message(one, heard.get(one.view.source)) for one in followed)
        return self._last

    def _heard(self, frame: Frame, source: str, until_ns: int) -> _Heard | None:
        """The newest message of a detector that was heard by now."""
        messages = self._messages[source]
        for stamp_ns in [stamp_ns for stamp_ns in messages if stamp_ns < until_ns - _KEPT_NS]:
            del messages[stamp_ns]
        stamps_ns = [stamp_ns for stamp_ns in messages if stamp_ns <= until_ns]
        mounted = self._cameras.get(frame.camera)
        if not stamps_ns or mounted is None:
            return None
        claim = messages[max(stamps_ns)]
        told = [(each.track_id, box) for each in claim.detections if (box := _box(each, mounted)) is not None]
        return _Heard(claim.stamp_ns, told, {name: box for name, box in told if name})

    def _identified(self, views: list[ObjectView], stamp_ns: int) -> list[FollowedObject]:
        known = self._matched(views)
        followed = []
        for k, view in enumerate(views):
            before = known.get(k)
            if before is None:
                self._made += 1
            key, since_ns = (self._made, stamp_ns) if before is None else (before.key, before.since_ns)
            followed.append(FollowedObject(key=key, view=view, since_ns=since_ns))
        return followed

    def _matched(self, views: list[ObjectView]) -> dict[int, FollowedObject]:
        """Index of a view to the object of the last frame that it is."""
        if not views or not self._last:
            return {}
        now, then = (np.array([v.box_px for v in each]) for each in (views, [o.view for o in self._last]))
        overlap, _ = overlaps(then, now)
        apart = 0.5 * np.linalg.norm(
            (then[:, None, :2] + then[:, None, 2:]) - (now[:, :2] + now[:, 2:]), axis=2
        )
        side = np.array([longer_side(box) for box in then])[:, None]
        source = np.array([[o.view.source == v.source for v in views] for o in self._last])
        name = source & np.array([[o.view.name == v.name for v in views] for o in self._last])
        fits = source & ((overlap >= _LEAST_OVERLAP) | (name & (apart <= _LEAPS * side)))
        worth = np.where(fits, overlap + _SAME_NAME * name - 0.1 * apart / np.maximum(side, 1.0) + 1.0, 0.0)
        rows, columns = linear_sum_assignment(worth, maximize=True)
        return {int(c): self._last[r] for r, c in zip(rows, columns, strict=True) if fits[r, c]}


def _box(detection: Detection, mounted: MountedCamera) -> FloatArray | None:
    if detection.box_px is None:
        return projected_box_px(detection, mounted.model)
    return clipped_box_px(detection.box_px, mounted.model)


def _with_message(one: FollowedObject, heard: _Heard | None) -> FollowedObject:
    if heard is None or one.view.status == "not told":
        return one
    own = one.view.detected_px
    ids = [name for name, box in heard.boxes if own is not None and np.abs(box - own).max() < _SAME_BOX_PX]
    return replace(one, told_id=ids[0] if ids else "", message_ns=heard.stamp_ns, told_px=heard.by_id)
