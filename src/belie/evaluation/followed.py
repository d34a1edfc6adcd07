"""What the detector's message told beside each object that belie follows: where else its track id is now.

A track id is what the detector tells, so it may lie: shifted boxes and exchanged ids give one name to two objects.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from belie.geometry import FloatArray
from belie.geometry.boxes import box_iou, clipped_box_px, projected_box_px
from belie.types import Alert, AlertType, Claim, Detection, DetectionClaim, Frame, MountedCamera

if TYPE_CHECKING:
    from belie.detector.object_view import ObjectView

_SAME_PLACE = 0.5  # IoU of an object and a box that is told where it is
_KEPT_NS = 5_000_000_000  # how late a message may be heard


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FollowedObject:
    """One object at one frame.

    Parameters
    ----------
    view : ObjectView
        What is known of it.
    message_ns : int
        Stamp of the message that was heard at this frame.
    told_px : mapping of str to array (4,)
        All boxes of that message by track id, image px; empty where no message was heard.
    """

    view: ObjectView
    message_ns: int = 0
    told_px: Mapping[str, FloatArray] = field(default_factory=dict)

    @property
    def key(self) -> tuple[str, int]:
        """Names the object for as long as its pixels are followed, whatever its detector calls it."""
        return self.view.source, self.view.number


def elsewhere_px(
    name: str | None, told_id: str, told_px: Mapping[str, FloatArray], own_px: FloatArray
) -> FloatArray | None:
    """The box, shape (4,), that a message tells of under `name`, where that is not the box of the object at `own_px`.

    >>> import numpy as np
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
    of_source = [o for o in objects if o.view.source == alert.source]
    named = [o for o in of_source if o.view.name == alert.object]
    match alert.type:
        case AlertType.OBSTACLE_HIDING:
            meant = [o for o in named if o.view.status != "reported"]
        case AlertType.OBJECT_MISCLASSIFICATION:
            meant = [o for o in named if o.view.misnamed]
        case _:
            meant = [o for o in of_source if o.view.told_id == alert.object] or named[-1:]
    return next(iter(meant or named), None)


class ObjectFollower:
    """Holds the objects of a run against the messages about them.

    Examples
    --------
    >>> import numpy as np
    >>> frame = Frame(camera="/image", stamp_ns=5, received_ns=5, image=np.zeros((2, 2), np.uint8))
    >>> ObjectFollower({}).add(frame, (), ())
    ()
    """

    def __init__(self, cameras: Mapping[str, MountedCamera]) -> None:
        self._cameras = cameras
        self._messages: dict[str, dict[int, DetectionClaim]] = {}
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
        heard = {source: self._heard(source, frame.stamp_ns + half_ns) for source in self._messages}
        mounted = self._cameras.get(frame.camera)
        boxes = {
            source: {
                d.track_id: box
                for d in message.detections if d.track_id and (box := _box(d, mounted)) is not None
            }
            for source, message in heard.items() if message is not None and mounted is not None
        }  # fmt: skip
        followed = []
        for view in views:
            message = heard.get(view.source)
            if message is None or view.status == "not told":
                followed.append(FollowedObject(view=view))
            else:
                told_px = boxes.get(view.source, {})
                followed.append(FollowedObject(view=view, message_ns=message.stamp_ns, told_px=told_px))
        return tuple(followed)

    def _heard(self, source: str, until_ns: int) -> DetectionClaim | None:
        """The newest message of a detector that was heard by now."""
        messages = self._messages[source]
        for stamp_ns in [stamp_ns for stamp_ns in messages if stamp_ns < until_ns - _KEPT_NS]:
            del messages[stamp_ns]
        stamps_ns = [stamp_ns for stamp_ns in messages if stamp_ns <= until_ns]
        return messages[max(stamps_ns)] if stamps_ns else None


def _box(detection: Detection, mounted: MountedCamera) -> FloatArray | None:
    if detection.box_px is None:
        return projected_box_px(detection, mounted.model)
    return clipped_box_px(detection.box_px, mounted.model)
