"""Which detection is which object: by overlap with where its pixels went, and by the detector's own track id.

A tracker library would bring a motion model and a life cycle of its own; here the pixels are the motion model, and
the life cycle is the check. What is left is an assignment, and scipy solves it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from belie.geometry import FloatArray
from belie.geometry.boxes import overlaps
from belie.types import Detection

LEAST_OVERLAP = (
    0.25  # of a detection and its object (IoU); 0.25 is a shift by 60 % of the side along one axis
)
_NO_ID = "-1"  # of trackers that have none to give
_LEAST_OF_SAME = 0.05  # of a detection and its object by id: at a low rate it moves by most of its side
# Of the longer side: how far one that was told of once, whose speed nobody knows, may have gone. A walking person does
# a third of his height in 0.3 s, a car that passes at 15 m/s as much of its length in 0.1 s.
_REACH = 0.5
# Of the area that was told before: less, with so little overlap, is a box that shrank at once. Nothing drives away so
# fast, and what passes behind others is cut a little at a time.
_SHRINKS = 1.0 / 3.0
_SAME_ID = 0.3  # what an equal track id is worth, in IoU
# Of an object and a detection under another id that does not hold its corners. Edges that are each 5 % of the side off
# (detector and prediction) leave an IoU of 0.84 with a standard deviation of 0.06; below, it is what stands behind.
_LEAST_OF_STRANGERS = 0.6
_LOST_BY_NOISE = 8.0  # IoU, a deviation of the edges: in the mean 3.2 (as above), and four times 1.2 besides
_MOST_CORNERS = 0.9  # share of an object's corners that lie in its box


def assign(
    boxes: FloatArray, ids: Sequence[str], detected: FloatArray, detected_ids: Sequence[str],
    held: Callable[[int, FloatArray], float] = lambda _, __: 1.0, told_area: Sequence[float] = (),
    is_new: Sequence[bool] = (),
) -> dict[int, int]:  # fmt: skip
    """Object to detection, each at most once; `held`: share of an object's corners that lie in a box.

    A detection under another id may be the object behind a hidden one; `told_area`, px²: of the boxes that were told of
    the objects before; `is_new`: which were told of once only.

    >>> here = np.array([[0.0, 0, 10, 10], [30, 0, 40, 10]])
    >>> assign(here, ["1", "2"], here[::-1] + 1.0, ["2", "9"])
    {0: 1, 1: 0}
    >>> assign(here, ["1", "2"], here + 3.0, ["9", "2"], lambda _, __: 0.5)
    {1: 1}
    >>> assign(here[:1], ["1"], np.array([[4.0, 4, 6, 6]]), ["1"], told_area=[100.0])
    {}
    >>> walker, on = np.array([[0.0, 0, 10, 30]]), np.array([11.0, 0, 11, 0])
    >>> [assign(walker, ["1"], walker + on, ["1"], is_new=[is_new]) for is_new in (True, False)]
    [{0: 0}, {}]
    """
    if len(boxes) == 0 or len(detected) == 0:
        return {}
    iou, _ = overlaps(boxes, detected)
    same = np.array([[bool(i) and i == j for j in detected_ids] for i in ids])
    before = np.array(told_area)[:, None] if len(told_area) else 0.0
    shrank = np.prod(detected[:, 2:] - detected[:, :2], axis=1)[None] < _SHRINKS * before
    least = np.where(same & ~shrank, _LEAST_OF_SAME, LEAST_OVERLAP)
    least[_reached(boxes, detected) & same & ~shrank & np.reshape(is_new or False, (-1, 1))] = 0.0
    for r, c in zip(*np.nonzero((iou >= LEAST_OVERLAP) & (iou < _LEAST_OF_STRANGERS) & ~same), strict=True):
        if ids[r] and detected_ids[c] and held(int(r), detected[c]) < _MOST_CORNERS:
            least[r, c] = _LEAST_OF_STRANGERS
    fits = iou >= least
    rows, columns = linear_sum_assignment(np.where(fits, iou + _SAME_ID * same, 0.0), maximize=True)
    return {int(r): int(c) for r, c in zip(rows, columns, strict=True) if fits[r, c]}


def own_overlap(deviation: float) -> float:
    """Least IoU of an object and its box under another id; `deviation`: of detected edges, as a share of the side.

    >>> [round(own_overlap(deviation), 2) for deviation in (0.05, 0.07, 0.2)]
    [0.6, 0.44, 0.25]
    """
    return float(np.clip(1.0 - _LOST_BY_NOISE * deviation, LEAST_OVERLAP, _LEAST_OF_STRANGERS))


def _reached(boxes: FloatArray, detected: FloatArray) -> npt.NDArray[np.bool_]:
    """Which detections (M, 4) are near enough to which boxes (N, 4), shape (N, M)."""
    steps = 0.5 * np.abs(
        (boxes[:, None] - detected[None]).reshape(len(boxes), len(detected), 2, 2).sum(axis=2)
    )
    sides = (boxes[:, 2:] - boxes[:, :2]).max(axis=1)
    return np.asarray(np.hypot(steps[..., 0], steps[..., 1]) <= _REACH * sides[:, None])


def named(detections: Sequence[Detection]) -> list[Detection]:
    """Detections whose ids name something: an id that several bear, or that stands for none, is none.

    >>> cars = [Detection(label="car", score=0.9, track_id=i, box_px=np.array([0.0, 0, 9, 9])) for i in "0017"]
    >>> [d.track_id for d in named(cars)]
    ['', '', '1', '7']
    """
    times = Counter(d.track_id for d in detections)
    return [
        replace(d, track_id="") if times[d.track_id] > 1 or d.track_id == _NO_ID else d for d in detections
    ]
