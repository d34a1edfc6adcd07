"""Which boxes may hide which: of two objects that stand on the ground, the nearer one's foot is further below."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from belie.geometry import FloatArray
from belie.geometry.boxes import overlaps

_FOOT = 0.05  # of the side: how much a detector errs about where an object stands
_MERGED = 0.45  # overlap (IoU) at which detectors take two boxes for one, whichever is nearer


@dataclass(frozen=True, slots=True)
class Covering:
    """What may hide some boxes.

    which : (N, M) which of the M others may hide a box, or be taken for the same object: not what stands behind it;
    share : (N,) largest share of it that one of those covers; by_any : (N,) the same for all others.
    """

    which: npt.NDArray[np.bool_]
    share: FloatArray
    by_any: FloatArray

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
        which = (~behind | (iou > _MERGED)) & (shares > 0.0)
        share = np.where(which, shares, 0.0).max(axis=1, initial=0.0)
        return cls(which, share, shares.max(axis=1, initial=0.0))

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
