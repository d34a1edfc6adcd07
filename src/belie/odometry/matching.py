"""Ψ of equation (6): each predicted point to the nearest observed corner at a similar pyramid level.

A bounded window: a prediction without a corner within ``window_px`` (times the scale of its level) has no
pair. Without the bound a few points whose corner was not found again are matched across the image
and rule the mean; ORB-SLAM's projection search, which the paper takes as its model, has the same
bound. See docs/decisions/0003-search-window-of-psi.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydantic import Field

from belie.geometry import FloatArray
from belie.geometry.compiled import compiled
from belie.odometry.prediction import Prediction
from belie.types import Features, Settings


class MatchingSettings(Settings):
    """Ψ of equation (6).

    >>> MatchingSettings().window_px
    15.0
    """

    window_px: float = Field(
        15.0,
        gt=0.0,
        le=500.0,
        description="Radius of the search around a prediction [px of the point's pyramid level], as in"
        " ORB-SLAM's search by projection for one camera.",
    )
    max_level_difference: float = Field(
        1.0, ge=0.0, description="Most levels between the expected and the found corner [count]."
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Matches:
    """Pairs (ẑ_i, z_i).

    Parameters
    ----------
    predicted : array (N,), int64
        Positions in the `Prediction`.
    observed : array (N,), int64
        Positions in the `Features`. One corner may serve several points, as Ψ in the paper allows.
    """

    predicted: npt.NDArray[np.int64]
    observed: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.predicted)


@compiled()
def _nearest_corners(
    predicted: FloatArray,
    predicted_level: FloatArray,
    radius: FloatArray,
    corners: npt.NDArray[np.float32],
    corner_level: npt.NDArray[np.int8],
    max_level_difference: float,
    cell: float,
) -> npt.NDArray[np.int64]:
    """The nearest corner of every prediction, -1 where none is within its radius."""
    nearest = np.full(len(predicted), -1, dtype=np.int64)
    if len(predicted) == 0 or len(corners) == 0:
        return nearest
    right = bottom = 0.0
    for i in range(len(corners)):
        right, bottom = max(right, corners[i, 0]), max(bottom, corners[i, 1])
    columns, rows = int(right / cell) + 1, int(bottom / cell) + 1
    # Counting sort of the corners into cells: cell k owns members[starts[k]:starts[k + 1]].
    starts = np.zeros(rows * columns + 1, dtype=np.int64)
    bucket = np.empty(len(corners), dtype=np.int64)
    for i in range(len(corners)):
        bucket[i] = int(max(0.0, corners[i, 1]) / cell) * columns + int(max(0.0, corners[i, 0]) / cell)
        starts[bucket[i] + 1] += 1
    for k in range(rows * columns):
        starts[k + 1] += starts[k]
    members = np.empty(len(corners), dtype=np.int64)
    filled = starts[:-1].copy()
    for i in range(len(corners)):
        members[filled[bucket[i]]] = i
        filled[bucket[i]] += 1
    for i in range(len(predicted)):
        x, y = predicted[i, 0], predicted[i, 1]
        best = radius[i] * radius[i]
        first_column, last_column = max(0, int((x - radius[i]) / cell)), int((x + radius[i]) / cell)
        first_row, last_row = max(0, int((y - radius[i]) / cell)), int((y + radius[i]) / cell)
        for row in range(first_row, min(rows, last_row + 1)):
            for column in range(first_column, min(columns, last_column + 1)):
                k = row * columns + column
                for m in range(starts[k], starts[k + 1]):
                    j = members[m]
                    if abs(corner_level[j] - predicted_level[i]) > max_level_difference:
                        continue
                    distance2 = (corners[j, 0] - x) ** 2 + (corners[j, 1] - y) ** 2
                    if distance2 <= best:
                        best = distance2
                        nearest[i] = j
    return nearest


def match_nearest(
    prediction: Prediction, features: Features, settings: MatchingSettings, scale_factor: float
) -> Matches:
    """Each prediction to the nearest corner of a similar level, inside a window: Ψ of equation (6).

    Parameters
    ----------
    prediction : Prediction
    features : Features
        Corners of the new image.
    settings : MatchingSettings
    scale_factor : float
        Of the pyramid.

    Returns
    -------
    Matches

    Examples
    --------
    >>> from belie.geometry import SE3
    >>> prediction = Prediction(T_odom_cam=SE3.identity(), index=np.arange(2),
    ...                         px=np.array([[10.0, 10.0], [200.0, 10.0]]), level=np.zeros(2))
    >>> features = Features(px=[[13, 10], [11, 10], [90, 90]], level=[0, 3, 0], score=[1, 1, 1])
    >>> pairs = match_nearest(prediction, features, MatchingSettings(), 1.5)
    >>> pairs.predicted.tolist(), pairs.observed.tolist()
    ([0], [0])
    """
    # At least the window of level 0: a point that comes so near that it leaves the pyramid stays findable.
    radius = settings.window_px * scale_factor ** np.maximum(prediction.level, 0.0)
    nearest = _nearest_corners(
        np.ascontiguousarray(prediction.px, dtype=np.float64),
        np.ascontiguousarray(prediction.level, dtype=np.float64),
        radius,
        features.px,
        features.level,
        settings.max_level_difference,
        max(8.0, settings.window_px),
    )
    found = np.flatnonzero(nearest >= 0)
    return Matches(predicted=found, observed=nearest[found])
