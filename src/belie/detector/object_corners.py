"""The corners that one object is followed by: where they are, and since when they ride with its box."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from belie.detector.covering import DRIFTS
from belie.detector.places import places_in
from belie.geometry import FloatArray, compiled

_PROVEN = 2  # detections
_OUTSIDE = 0.05  # of the box's side: how far a corner of the object may lie outside its box


def _no_points() -> FloatArray:
    return np.empty((0, 2))


def _no_counts() -> npt.NDArray[np.int64]:
    return np.empty(0, dtype=np.int64)


@dataclass(slots=True)
class ObjectCorners:
    """N corners; places lie within a box, 0 to 1.

    >>> box = np.array([0.0, 0.0, 20.0, 10.0])
    >>> corners = ObjectCorners()
    >>> corners.add(np.array([[4.5, 4.5], [9.5, 7.5]]), box, None, frame=3)
    >>> corners.ages += 2
    >>> corners.keep(np.array([True, False]))
    >>> len(corners), corners.places.tolist(), corners.proven.tolist()
    (1, [[0.25, 0.5]], [True])
    """

    px: FloatArray = field(default_factory=_no_points)  # (N, 2), in the newest image
    places: FloatArray = field(default_factory=_no_points)  # (N, 2), in the object's box when they were found
    ages: npt.NDArray[np.int64] = field(default_factory=_no_counts)  # (N,), detections ridden
    births: npt.NDArray[np.int64] = field(default_factory=_no_counts)  # (N,), frame counts
    born_px: FloatArray = field(default_factory=_no_points)  # (N, 2), where they were then
    # (N, 2), in the box that was told then; NaN where that is about another image, and not known in this one.
    born_places: FloatArray = field(default_factory=_no_points)

    def __len__(self) -> int:
        return len(self.px)

    @property
    def proven(self) -> npt.NDArray[np.bool_]:
        """Which have ridden with the detected box long enough to be the object's, not the background's, (N,)."""
        return np.asarray(self.ages >= _PROVEN)

    def keep(self, which: npt.NDArray[np.bool_]) -> None:
        """Drop the others."""
        if which.all():
            return
        self.px, self.places, self.ages = self.px[which], self.places[which], self.ages[which]
        self.births, self.born_px = self.births[which], self.born_px[which]
        self.born_places = self.born_places[which]

    def add(self, px: FloatArray, box_px: FloatArray, told_px: FloatArray | None, frame: int) -> None:
        """Take over new ones (M, 2), found in the object's box; `told_px`: the box that was told, where it is known."""
        places = places_in(box_px, px)
        born_places = np.full(px.shape, np.nan) if told_px is None else places_in(told_px, px)
        self.px = np.concatenate([self.px, px])
        self.places = np.concatenate([self.places, places])
        self.ages = np.concatenate([self.ages, np.zeros(len(px), dtype=np.int64)])
        self.births = np.concatenate([self.births, np.full(len(px), frame)])
        self.born_px = np.concatenate([self.born_px, px])
        self.born_places = np.concatenate([self.born_places, born_places])

    def bear_again(self, told_px: FloatArray, frame: int) -> None:
        """Those whose place in a told box was not known were told of late: what is seen of them begins now."""
        unplaced = np.isnan(self.born_places[:, 0])
        if unplaced.any():
            self.births = np.where(unplaced, frame, self.births)
            self.born_px = np.where(unplaced[:, None], self.px, self.born_px)
            self.born_places = np.where(unplaced[:, None], places_in(told_px, self.px), self.born_places)


@compiled()
def riding(box_px: Any, px: Any, places: Any) -> Any:
    """Which corners (N, 2) of an object keep the places (N, 2) in its box that they were found at, (N,).

    >>> box, places = np.array([0.0, 0.0, 10.0, 10.0]), np.array([[0.2, 0.5], [0.5, 0.5], [1.0, 0.5]])
    >>> riding(box, np.array([[1.5, 4.5], [7.5, 4.5], [10.5, 4.5]]), places)
    array([ True, False, False])
    """
    rides = np.zeros(px.shape[0], np.bool_)
    width, height = max(box_px[2] - box_px[0], 1.0), max(box_px[3] - box_px[1], 1.0)
    for k in range(px.shape[0]):
        x, y = (px[k, 0] + 0.5 - box_px[0]) / width, (px[k, 1] + 0.5 - box_px[1]) / height
        drift = max(abs(x - places[k, 0]), abs(y - places[k, 1]))
        rides[k] = drift < DRIFTS and max(abs(x - 0.5), abs(y - 0.5)) < 0.5 + _OUTSIDE
    return rides
