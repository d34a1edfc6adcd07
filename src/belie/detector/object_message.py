"""A detector's message, beside the objects that were known before it: which of them it tells of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from belie.checks.objects import ClassGroups
from belie.detector.association import assign, named
from belie.detector.object_track import ObjectTrack
from belie.geometry import CameraModel, FloatArray, clipped_box_px, projected_box_px
from belie.types import Detection, DetectionClaim

_LEAST_PX = 4.0  # sides of a box
STANDING = ("vehicle", "person", "barrier")  # groups of labels that stand on the ground


@dataclass(frozen=True, slots=True, eq=False)
class ObjectMessage:
    """M detections that have a box in the image, and N objects.

    boxes : (M, 4) px; carried : the same, those of known objects as they would be in the newest image; stand : (M,)
    whether they stand on the ground, by their labels; own : (N, 4) px, boxes of the objects at the message's stamp;
    found : object to detection.
    """

    stamp_ns: int
    detections: tuple[Detection, ...]
    boxes: FloatArray
    carried: FloatArray
    stand: npt.NDArray[np.bool_]
    own: FloatArray
    found: dict[int, int]

    @classmethod
    def of(
        cls, claim: DetectionClaim, tracks: Sequence[ObjectTrack], camera: CameraModel, classes: ClassGroups
    ) -> ObjectMessage:
        """Find out which object is which detection."""
        told = [(d, box) for d in named(claim.detections) if (box := _box_of(d, camera)) is not None]
        boxes = np.array([box for _, box in told]).reshape(-1, 4)
        own = np.array([track.box_at(claim.stamp_ns) for track in tracks]).reshape(-1, 4)
        found = assign(
            own, [t.track_id for t in tracks], boxes, [d.track_id for d, _ in told],
            lambda i, box: tracks[i].share_in(box, own[i]), [t.told_area_px2 for t in tracks],
            [t.detections == 1 for t in tracks],
        )  # fmt: skip
        stand = np.array([classes.of(d.label) in STANDING for d, _ in told], dtype=bool)
        carried = boxes.copy()  # from the image that a late message is about
        for i, j in found.items():
            carried[j] += tracks[i].box_px - own[i]
        return cls(claim.stamp_ns, tuple(d for d, _ in told), boxes, carried, stand, own, found)

    @property
    def missing(self) -> list[int]:
        """Objects that it does not tell of."""
        return [i for i in range(len(self.own)) if i not in self.found]

    @property
    def unknown(self) -> list[int]:
        """Detections of no known object."""
        return sorted(set(range(len(self.boxes))) - set(self.found.values()))


def has_no_box(detection: Detection) -> bool:
    """Whether it may be in view, and nobody can say where in the image."""
    where = detection.position_m
    return (
        detection.box_px is None
        and detection.dimensions_m is None
        and (where is None or bool(where[2] > 0.0))
    )


def _box_of(detection: Detection, camera: CameraModel) -> FloatArray | None:
    """Its box, cut by the image's border; None where too little of it is in the image."""
    told = detection.box_px if detection.box_px is not None else projected_box_px(detection, camera)
    box = None if told is None else clipped_box_px(told, camera)
    return box if box is not None and bool((box[2:] - box[:2] >= _LEAST_PX).all()) else None
