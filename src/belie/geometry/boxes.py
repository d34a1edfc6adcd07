"""Boxes in the image: overlap of two, and the box of an object that is known in space.

A box is left, top, right, bottom edge in pixels, shape (4,); pixel i covers i to i + 1, so that the whole image is
(0, 0, width, height), half a pixel off the pixel centres that cameras project to.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from belie.geometry.camera import CameraModel
from belie.geometry.compiled import compiled
from belie.geometry.projection import flat_camera
from belie.geometry.se3 import SE3, FloatArray

_NEAR_M = 0.1
_LARGEST_RADIUS2 = 5  # its place in `flat_camera`: the squared radius beyond which nothing is in view
_SAMPLES = 9  # along an edge: through a lens its middle may reach further out than its ends
_CORNERS = 0.5 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
_EDGES = np.array([(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b).bit_count() == 1])


class Solid(Protocol):
    """What is known of an object in camera axes; `belie.types.Detection` is one."""

    @property
    def T_cam_obj(self) -> SE3 | None:
        """Maps its coordinates (x forward, y left, z up, origin in its middle) to the camera's."""
        ...

    @property
    def position_m(self) -> FloatArray | None:
        """Its middle, shape (3,)."""
        ...

    @property
    def dimensions_m(self) -> FloatArray | None:
        """Length, width, height, shape (3,)."""
        ...


def box_iou(a_px: FloatArray, b_px: FloatArray) -> float:
    """Intersection over union of two boxes; 0 where both are empty.

    >>> box_iou(np.array([0.0, 0.0, 2.0, 2.0]), np.array([1.0, 0.0, 3.0, 2.0]))
    0.3333333333333333
    """
    sides = np.minimum(a_px[2:], b_px[2:]) - np.maximum(a_px[:2], b_px[:2])
    shared = float(np.prod(np.maximum(sides, 0.0)))
    union = float(np.prod(a_px[2:] - a_px[:2]) + np.prod(b_px[2:] - b_px[:2])) - shared
    return shared / union if union > 0.0 else 0.0


def clipped_box_px(box_px: FloatArray, model: CameraModel) -> FloatArray | None:
    """The part of a box inside the image, shape (4,); None where nothing of it is.

    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> clipped_box_px(np.array([-10.0, 5.0, 20.0, 500.0]), camera)
    array([  0.,   5.,  20., 480.])
    >>> clipped_box_px(np.array([-10.0, 5.0, 0.0, 10.0]), camera) is None
    True
    """
    size = (model.width, model.height, model.width, model.height)
    clipped = np.clip(box_px, 0.0, size)
    return clipped if (clipped[2:] > clipped[:2]).all() else None


def where_px(box_px: FloatArray) -> str:
    """A box of the image in words.

    >>> where_px(np.array([1.0, 2.0, 30.4, 40.0]))
    'at [1, 2, 30, 40] px'
    """
    return "at [" + ", ".join(f"{edge:.0f}" for edge in box_px) + "] px"


def edges_px(box_px: FloatArray) -> tuple[float, float, float, float]:
    """The edges of a box as plain numbers.

    >>> edges_px(np.array([1.0, 2.0, 30.5, 40.0]))
    (1.0, 2.0, 30.5, 40.0)
    """
    left, top, right, bottom = box_px.tolist()
    return left, top, right, bottom


def projected_box_px(solid: Solid, model: CameraModel) -> FloatArray | None:
    """The image box of an object in space, clipped to the image: around its eight projected corners.

    What reaches behind the camera is cut off 0.1 m before it. Where only position and dimensions are known, the
    object stands upright (the camera's y points down) and its heading is any: it is taken for as wide as its length
    and width are in the mean.

    Parameters
    ----------
    solid : Solid
        The object; a `belie.types.Detection` will do.
    model : CameraModel
        The camera.

    Returns
    -------
    array (4,) or None
        None without dimensions or place, and for what is behind the camera or out of view.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> post = SimpleNamespace(T_cam_obj=None, position_m=np.array([0.0, 0.0, 10.5]),
    ...                        dimensions_m=np.array([1.0, 1.0, 2.0]))
    >>> projected_box_px(post, camera)
    array([295., 190., 345., 290.])
    >>> post.position_m = np.array([0.0, 0.0, -10.0])
    >>> projected_box_px(post, camera) is None
    True
    """
    corners = _corners(solid)
    if corners is None:
        return None
    visible = _in_front(corners, _SAMPLES if model.is_distorted else 2)
    if not len(visible):
        return None
    normalized = visible[:, :2] / visible[:, 2:]
    # Polynomials fold back beyond the field of view: what lies further out is brought to just outside of it.
    radius2 = (normalized**2).sum(axis=1, keepdims=True)
    normalized = normalized * np.sqrt(
        np.minimum(1.0, flat_camera(model)[_LARGEST_RADIUS2] / np.maximum(radius2, 1e-12))
    )
    edges = model.project(np.column_stack([normalized, np.ones(len(normalized))])) + 0.5
    return clipped_box_px(np.concatenate([edges.min(axis=0), edges.max(axis=0)]), model)


def _corners(solid: Solid) -> FloatArray | None:
    """Corners in camera axes, shape (8, 3)."""
    dimensions_m = solid.dimensions_m
    if dimensions_m is None:
        return None
    if solid.T_cam_obj is not None:
        return solid.T_cam_obj.apply(_CORNERS * dimensions_m)
    if solid.position_m is None:
        return None
    across_m = 0.5 * (dimensions_m[0] + dimensions_m[1])
    return np.asarray(solid.position_m + _CORNERS * (across_m, dimensions_m[2], across_m))


def _in_front(corners: FloatArray, samples: int) -> FloatArray:
    """Points along the edges before the near plane, and where edges cross it, shape (N, 3)."""
    a, b = corners[_EDGES[:, 0]], corners[_EDGES[:, 1]]
    along = (a + np.linspace(0.0, 1.0, samples)[:, None, None] * (b - a)).reshape(-1, 3)
    crosses = (a[:, 2] < _NEAR_M) != (b[:, 2] < _NEAR_M)
    a, b = a[crosses], b[crosses]
    share = (_NEAR_M - a[:, 2:]) / (b[:, 2:] - a[:, 2:])
    return np.concatenate([along[along[:, 2] >= _NEAR_M], a + share * (b - a)])


def longer_side(box_px: FloatArray) -> float:
    """Of a box, px.

    >>> longer_side(np.array([0.0, 0.0, 10.0, 20.0]))
    20.0
    """
    left, top, right, bottom = box_px.tolist()
    return float(max(right - left, bottom - top))


def root_area(box_px: FloatArray) -> float:
    """Side of a square of a box's area, px: what detectors call an object's size (COCO: small is below 32).

    >>> root_area(np.array([0.0, 0.0, 8.0, 18.0]))
    12.0
    """
    left, top, right, bottom = box_px.tolist()
    return float(np.sqrt(max((right - left) * (bottom - top), 0.0)))


def are_apart(a_px: FloatArray, b_px: FloatArray) -> bool:
    """Whether two boxes are farther apart, middle to middle, than the sum of their longer sides.

    No tracker takes the one for the other then.

    >>> a = np.array([0.0, 0.0, 10.0, 5.0])
    >>> are_apart(a, a + 14.0), are_apart(a, a + 15.0)
    (False, True)
    """
    gap = float(np.linalg.norm(0.5 * (a_px[:2] + a_px[2:] - b_px[:2] - b_px[2:])))
    return gap > longer_side(a_px) + longer_side(b_px)


@compiled()
def overlaps(a: Any, b: Any) -> tuple[Any, Any]:
    """Intersection over union of every box of `a` with every one of `b`, and the share of `a` that `b` covers.

    Both of shape (len(a), len(b)).

    >>> iou, share = overlaps(np.array([[0.0, 0, 2, 2]]), np.array([[1.0, 0, 3, 2]]))
    >>> iou.round(2), share
    (array([[0.33]]), array([[0.5]]))
    """
    iou = np.zeros((a.shape[0], b.shape[0]))
    share = np.zeros((a.shape[0], b.shape[0]))
    for i in range(a.shape[0]):
        area = (a[i, 2] - a[i, 0]) * (a[i, 3] - a[i, 1])
        for j in range(b.shape[0]):
            width = min(a[i, 2], b[j, 2]) - max(a[i, 0], b[j, 0])
            height = min(a[i, 3], b[j, 3]) - max(a[i, 1], b[j, 1])
            if width > 0.0 and height > 0.0:
                common = width * height
                other = (b[j, 2] - b[j, 0]) * (b[j, 3] - b[j, 1])
                iou[i, j] = common / max(area + other - common, 1e-9)
                share[i, j] = common / max(area, 1e-9)
    return iou, share


@compiled()
def inside(px: Any, boxes: Any) -> Any:
    """Which pixels (N, 2) lie in one of the boxes (M, 4), shape (N,).

    >>> inside(np.array([[1.0, 1.0], [5.0, 1.0]]), np.array([[0.0, 0.0, 3.0, 3.0]]))
    array([ True, False])
    """
    found = np.zeros(px.shape[0], np.bool_)
    for k in range(px.shape[0]):
        x, y = px[k, 0] + 0.5, px[k, 1] + 0.5
        for j in range(boxes.shape[0]):
            if boxes[j, 0] < x < boxes[j, 2] and boxes[j, 1] < y < boxes[j, 3]:
                found[k] = True
                break
    return found
