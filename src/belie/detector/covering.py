"""Which boxes may hide which: of two objects that stand on the ground, the nearer one's foot is further below."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from belie.geometry import FloatArray, compiled
from belie.geometry.boxes import overlaps

_FOOT = 0.05  # of the side: how much a detector errs about where an object stands
DRIFTS = 0.2  # of the box's side: how far a corner of the object may drift within its box
LEAST_CORNERS = 4
# Share of an object's corners in another's box that must stay to say that nothing stands before them. Whatever is
# opaque fills more than half of its box (a walking person the least), and takes those corners away.
_SHOWS = 0.75
_MERGED = 0.45  # overlap (IoU) at which detectors take two boxes for one, whichever is nearer


@dataclass(frozen=True, slots=True)
class Covering:
    """What may hide some boxes.

    shares : (N, M) share of each that each of M others covers, 0 where that one cannot hide it: what stands behind it;
    merged : (N, M) whether the two may be taken for one; by_any : (N,) largest share that any other covers.
    """

    shares: FloatArray
    merged: npt.NDArray[np.bool_]
    by_any: FloatArray

    @property
    def which(self) -> npt.NDArray[np.bool_]:
        """Which of the others may hide a box, or be taken for the same object, (N, M)."""
        return self.shares > 0.0

    @property
    def share(self) -> FloatArray:
        """Largest share of each box that one of those covers, (N,)."""
        return np.asarray(self.shares.max(axis=1, initial=0.0))

    def besides(self, k: int, shown: npt.NDArray[np.int64], known: npt.NDArray[np.bool_]) -> None:
        """Take away from what may hide box `k` those of the others (their indices) that it shows through.

        One that may be taken for the same object stays, if it is `known`, (M,): that has nothing to do with who stands
        before whom. But nobody hides behind a box that has just come up.
        """
        self.shares[k, shown[~(self.merged[k, shown] & known[shown])]] = 0.0

    @classmethod
    def of(
        cls,
        boxes: FloatArray,
        stand: npt.NDArray[np.bool_],
        others: FloatArray,
        others_stand: npt.NDArray[np.bool_],
    ) -> Covering:
        """Of boxes (N, 4) by others (M, 4); `stand`: whether an object stands on the ground.

        >>> car, van, both = np.array([[0.0, 0, 20, 20]]), np.array([[10.0, -10, 40, 14]]), np.array([True])
        >>> Covering.of(car, both, van, both).share, Covering.of(van, both, car, both).share.round(2)
        (array([0.]), array([0.19]))
        """
        return cls._of(boxes, stand, others, others_stand, *overlaps(boxes, others))

    @classmethod
    def _of(
        cls, boxes: FloatArray, stand: npt.NDArray[np.bool_], others: FloatArray, others_stand: npt.NDArray[np.bool_],
        iou: FloatArray, shares: FloatArray,
    ) -> Covering:  # fmt: skip
        sides = np.maximum(boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1])
        foot = boxes[:, 3] - _FOOT * sides
        behind = stand[:, None] & others_stand[None, :] & (others[None, :, 3] < foot[:, None])
        merged = np.asarray(iou > _MERGED)
        return cls(np.where(~behind | merged, shares, 0.0), merged, shares.max(axis=1, initial=0.0))

    @classmethod
    def among(cls, boxes: FloatArray, stand: npt.NDArray[np.bool_]) -> Covering:
        """Of boxes (N, 4) by one another.

        >>> Covering.among(np.array([[0.0, 0, 2, 2], [1, 0, 3, 2], [8, 8, 9, 9]]), np.zeros(3, bool)).by_any
        array([0.5, 0.5, 0. ])
        """
        iou, shares = overlaps(boxes, boxes)
        for own in (iou, shares):
            np.fill_diagonal(own, 0.0)
        return cls._of(boxes, stand, boxes, stand, iou, shares)


@compiled()
def shown_through(boxes: Any, own: Any, then: Any, now: Any, born: Any) -> Any:
    """Of boxes of others (N, 4): whether the corners of an object, itself in the box `own` (4,), stay in them, (N,).

    Places within its own box, 0 to 1: `then` (K, 2), before anything covered it; of those left of them `now` (M, 2),
    and where each was `born` (M, 2).

    >>> car, places = np.array([0.0, 0, 40, 40]), np.random.default_rng(0).uniform(0.1, 0.9, (12, 2))
    >>> over = np.array([[0.0, 0, 640, 480]])
    >>> [shown_through(over, car, places, left, left).tolist() for left in (places[1:], places[5:])]
    [[True], [False]]
    """
    shown = np.zeros(boxes.shape[0], np.bool_)
    width, height = max(own[2] - own[0], 1.0), max(own[3] - own[1], 1.0)
    for j in range(boxes.shape[0]):
        x0, y0 = (boxes[j, 0] - own[0]) / width, (boxes[j, 1] - own[1]) / height
        x1, y1 = (boxes[j, 2] - own[0]) / width, (boxes[j, 3] - own[1]) / height
        before = left = 0
        for k in range(then.shape[0]):
            before += x0 < then[k, 0] < x1 and y0 < then[k, 1] < y1
        for k in range(now.shape[0]):
            x, y = now[k]
            drifts = max(abs(x - born[k, 0]), abs(y - born[k, 1])) >= DRIFTS
            left += not drifts and x0 < x < x1 and y0 < y < y1
        shown[j] = before >= LEAST_CORNERS and left >= _SHOWS * before
    return shown
