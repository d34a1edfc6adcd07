"""Places within a box, and boxes within the image."""

from __future__ import annotations

import numpy as np

from belie.geometry import FloatArray


def places_in(box_px: FloatArray, px: FloatArray) -> FloatArray:
    """Where pixels lie within a box, 0 to 1 along each axis, shape (N, 2).

    >>> places_in(np.array([0.0, 0.0, 10.0, 20.0]), np.array([[4.5, 4.5]]))
    array([[0.5 , 0.25]])
    """
    left, top, right, bottom = box_px.tolist()
    size = np.array([max(right - left, 1.0), max(bottom - top, 1.0)])
    return np.asarray((px - np.array([left - 0.5, top - 0.5])) / size)


def sides_of(box_px: FloatArray) -> FloatArray:
    """What a shift of each edge, shape (4,), is measured by: width, height, width, height.

    >>> sides_of(np.array([0.0, 0.0, 10.0, 20.0]))
    array([10., 20., 10., 20.])
    """
    left, top, right, bottom = box_px.tolist()
    return np.array([right - left, bottom - top] * 2)


def in_view(box_px: FloatArray, size: tuple[int, int]) -> float:
    """Share of a box that lies inside the image.

    >>> in_view(np.array([-5.0, 0.0, 5.0, 10.0]), (100, 100))
    0.5
    """
    left, top, right, bottom = box_px.tolist()
    width = min(max(right, 0.0), size[0]) - min(max(left, 0.0), size[0])
    height = min(max(bottom, 0.0), size[1]) - min(max(top, 0.0), size[1])
    area = (right - left) * (bottom - top)
    return float(width * height / area) if area > 0.0 else 0.0
