"""Whether a box shows the same small or soft object as before: by its picture as a whole.

Corners of a walking pedestrian of 40 px live no longer than an image or two. Its picture, at a size of 16 px,
correlates well with the next one, and badly with what is beside it; both are measured for each object as it goes.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from belie.geometry import FloatArray
from belie.odometry.local_features import ImageStack, Window
from belie.types import GrayImage

_SIDE_PX = 16.0  # root of the area of an object's picture
_INNER = np.array([0.8, 0.9])  # of the box: its edges show the background
_SEARCH = np.array([0.3, 0.15])  # of the box's width and height, either way
_LEAST_PX = 6
_FLAT, _MOST_FLAT = 2.0, 3.0  # times the noise; gray levels: a picture with less contrast shows nothing


def picture_of(stack: ImageStack, box_px: FloatArray) -> GrayImage | None:
    """The inner part of a box at a size of its own; None where nothing is seen in it.

    >>> picture_of(ImageStack(np.zeros((60, 60), np.uint8)), np.array([10.0, 10.0, 42.0, 42.0])) is None
    True
    """
    picture = _cut(stack, box_px, 0.5 * _INNER)
    flat = min(_FLAT * stack.noise, _MOST_FLAT)
    if min(picture.shape) < _LEAST_PX or float(cv2.meanStdDev(picture)[1][0, 0]) < flat:
        return None
    return picture


def best_match(
    stack: ImageStack, picture: GrayImage, box_px: FloatArray, *, may_fade: bool = True
) -> tuple[float, FloatArray]:
    """How well an object's picture fits in or near a box, and how far from its place in it [px].

    The best normalised correlation, -1 to 1; where it must not fade, at most the contrast there against the picture's.

    Examples
    --------
    >>> image = np.random.default_rng(0).integers(0, 255, (100, 100)).astype(np.uint8)
    >>> box = np.array([30.0, 30.0, 62.0, 62.0])
    >>> soft = ImageStack(cv2.GaussianBlur(image, (0, 0), 3.0))
    >>> score, shift_px = best_match(soft, picture_of(soft, box), box + np.array([4.0, 0.0, 4.0, 0.0]))
    >>> score > 0.9, shift_px.round().tolist()
    (True, [-4.0, 0.0])
    """
    size = np.maximum(box_px[2:] - box_px[:2], 1.0)
    scale = _scale(size)
    margin = np.ceil(_SEARCH * size * scale).astype(int)
    h, w = picture.shape
    window = Window(0.5 * (box_px[:2] + box_px[2:]), scale, (h + 2 * int(margin[1]), w + 2 * int(margin[0])))
    seen = window.cut(stack)
    scores = cv2.matchTemplate(seen, picture, cv2.TM_CCOEFF_NORMED)
    if not may_fade:
        products = cv2.matchTemplate(seen, picture, cv2.TM_CCOEFF)
        scores = np.minimum(scores, products / (picture.size * max(float(np.var(picture)), 1.0)))
    scores = np.where(np.isfinite(scores), scores, 0.0)
    y, x = np.unravel_index(int(np.argmax(scores)), scores.shape)
    return float(scores[y, x]), np.asarray((np.array([x, y]) - margin) / scale)


def _scale(size_px: FloatArray) -> float:
    return min(_SIDE_PX / math.sqrt(float(np.prod(size_px))), 1.0)


def _cut(stack: ImageStack, box_px: FloatArray, half: FloatArray) -> GrayImage:
    size = np.maximum(box_px[2:] - box_px[:2], 1.0)
    scale = _scale(size)
    w, h = np.maximum(np.round(2.0 * half * size * scale), 1.0).astype(int)
    return Window(0.5 * (box_px[:2] + box_px[2:]), scale, (int(h), int(w))).cut(stack)
