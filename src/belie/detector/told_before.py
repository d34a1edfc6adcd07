"""What a detector has not told of, though it stood before a standing camera: it does so again."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from belie.detector.association import LEAST_OVERLAP
from belie.geometry import FloatArray
from belie.geometry.boxes import overlaps
from belie.odometry.still_background import STOOD_NS, StillBackground

_MESSAGES = 64  # kept
_COVERED = 0.5  # share of a place: who was told to stand before it may have hidden it


@dataclass(slots=True)
class ToldBefore:
    """The boxes of the latest messages of one detector."""

    _told: deque[tuple[int, FloatArray]] = field(default_factory=lambda: deque(maxlen=_MESSAGES))

    def keep(self, boxes: FloatArray, stamp_ns: int) -> None:
        """Take over the boxes (N, 4) of a message."""
        self._told.append((stamp_ns, boxes))

    def missed(self, box_px: FloatArray, background: StillBackground, stamp_ns: int) -> int:
        """For how many messages an object that is new at a stamp was not told of, though it stood there already."""
        if not background.shows(box_px):
            return 0
        return sum(
            not _is_told(box_px, boxes)
            for then_ns, boxes in self._told
            if stamp_ns - STOOD_NS <= then_ns < stamp_ns
        )


def _is_told(box_px: FloatArray, boxes: FloatArray) -> bool:
    if len(boxes) == 0:
        return False
    iou, covered = overlaps(box_px[None], boxes)
    return bool((iou >= LEAST_OVERLAP).any() or covered.max() > _COVERED)
