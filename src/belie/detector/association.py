"""Which detection is which object: by overlap with where its pixels went, and by the detector's own track id.

A tracker library would bring a motion model and a life cycle of its own; here the pixels are the motion model, and
the life cycle is the check. What is left is an assignment, and scipy solves it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from belie.geometry import FloatArray
from belie.geometry.boxes import longer_side

LEAST_OVERLAP = (
    0.25  # of a detection and its object (IoU); 0.25 is a shift by 60 % of the side along one axis
)
_FOOT = 0.05  # of the side: how much a detector errs about where an object stands
_SAME_ID = 0.3  # what an equal track id is worth, in IoU
# Of an object and a detection under another id that does not hold its corners. Edges that are each 5 % of the side off
# (detector and prediction) leave an IoU of 0.84 with a standard deviation of 0.06; below, it is what stands behind.
_LEAST_OF_STRANGERS = 0.6
_MOST_CORNERS = 0.9  # share of an object's corners that lie in its box


def overlaps(a: FloatArray, b: FloatArray) -> FloatArray:
    """Intersection over union of every box of `a` with every one of `b`, shape (len(a), len(b)).

    >>> overlaps(np.array([[0.0, 0, 2, 2]]), np.array([[1.0, 0, 3, 2]])).round(2)
    array([[0.33]])
    """
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    common = np.prod(np.maximum(high - low, 0.0), axis=2)
    area_a, area_b = np.prod(a[:, 2:] - a[:, :2], axis=1), np.prod(b[:, 2:] - b[:, :2], axis=1)
    return np.asarray(common / np.maximum(area_a[:, None] + area_b[None, :] - common, 1e-9))


def covered_by_others(boxes: FloatArray) -> FloatArray:
    """Largest share of each box (N, 4) that another one of them covers, shape (N,).

    >>> covered_by_others(np.array([[0.0, 0, 2, 2], [1, 0, 3, 2], [8, 8, 9, 9]]))
    array([0.5, 0.5, 0. ])
    """
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    common = np.prod(np.maximum(high - low, 0.0), axis=2)
    area = np.maximum(np.diagonal(common).copy(), 1e-9)
    np.fill_diagonal(common, 0.0)
    return np.asarray(common.max(axis=1, initial=0.0) / area)


def may_cover(
    box: FloatArray,
    stands: bool,
    others: FloatArray,
    others_stand: npt.NDArray[np.bool_],
    least_overlap: float,
) -> npt.NDArray[np.bool_]:
    """Which of the others may hide a box, or be taken for the same object: not what stands behind it.

    Of two that stand on the ground, the nearer one's foot is further below. Overlaps (IoU) above `least_overlap` are
    merged by detectors, whichever is nearer.

    >>> car, van = np.array([0.0, 0, 20, 20]), np.array([[10.0, -10, 40, 14]])
    >>> may_cover(car, True, van, np.array([True]), 0.45), may_cover(van[0], True, car[None], np.array([True]), 0.45)
    (array([False]), array([ True]))
    """
    foot = box[3] - _FOOT * longer_side(box)
    behind = others_stand & stands & (others[:, 3] < foot)
    return np.asarray(~behind | (overlaps(box[None], others)[0] > least_overlap))


def covered(box: FloatArray, others: FloatArray) -> float:
    """Largest share of a box that one of the others covers.

    >>> covered(np.array([0.0, 0, 2, 2]), np.array([[1.0, 0, 3, 2]]))
    0.5
    """
    if len(others) == 0:
        return 0.0
    low, high = np.maximum(box[:2], others[:, :2]), np.minimum(box[2:], others[:, 2:])
    common = np.prod(np.maximum(high - low, 0.0), axis=1)
    return float(common.max() / max(float(np.prod(box[2:] - box[:2])), 1e-9))


def assign(
    boxes: FloatArray, ids: Sequence[str], detected: FloatArray, detected_ids: Sequence[str],
    held: Callable[[int, FloatArray], float] = lambda _, __: 1.0,
) -> dict[int, int]:  # fmt: skip
    """Object to detection, each at most once; `held`: share of an object's corners that lie in a box.

    A detection under another id may be the object behind a hidden one.

    >>> here = np.array([[0.0, 0, 10, 10], [30, 0, 40, 10]])
    >>> assign(here, ["1", "2"], here[::-1] + 1.0, ["2", "9"])
    {0: 1, 1: 0}
    >>> assign(here, ["1", "2"], here + 3.0, ["9", "2"], lambda _, __: 0.5)
    {1: 1}
    """
    if len(boxes) == 0 or len(detected) == 0:
        return {}
    iou = overlaps(boxes, detected)
    same = np.array([[bool(i) and i == j for j in detected_ids] for i in ids])
    least = np.where(same, 0.05, LEAST_OVERLAP)
    for r, c in zip(*np.nonzero((iou >= LEAST_OVERLAP) & (iou < _LEAST_OF_STRANGERS) & ~same), strict=True):
        if ids[r] and detected_ids[c] and held(int(r), detected[c]) < _MOST_CORNERS:
            least[r, c] = _LEAST_OF_STRANGERS
    fits = iou >= least
    rows, columns = linear_sum_assignment(np.where(fits, iou + _SAME_ID * same, 0.0), maximize=True)
    return {int(r): int(c) for r, c in zip(rows, columns, strict=True) if fits[r, c]}
