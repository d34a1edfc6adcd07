"""Equation (7), ``k^L = {k in k_t : k inside the box}``: the corners of one object.

An image-wide search leaves a far car two corners. So every object is looked at through a window of its own, brought
to one size: 64 px where the object is. A pedestrian of 30 px and a lorry of 600 then give about the same number of
corners, and cost the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any

import cv2
import numpy as np

from belie.geometry import FloatArray, compiled
from belie.odometry.corner_selection import corner_scores, spread_evenly
from belie.odometry.image_quality import sensor_noise
from belie.types import GrayImage, read_only

SIDE_PX = 64.0  # of an object in its window (root of the area)
_MARGIN_PX = 26.0  # around it: half a patch, and how far a corner may stray from its prediction
_MOST_ENLARGED = 2.0  # beyond, there is nothing but interpolation
_LONGEST_PX = 150.0
_FAST_THRESHOLDS = (7.0, 3.5)  # times the noise; the second where the first finds too few
_LEAST_SCORE = 1.0  # times the variance of the noise, which alone gives half of it
_MOST_NOISE = 2.0  # gray; beyond, patches are verified anyway
_SPACING_PX = 5.0


class ImageStack:
    """An image and its halves, made when first asked for; `half`: the first, where somebody has made it already.

    Examples
    --------
    >>> stack = ImageStack(np.zeros((40, 60), np.uint8))
    >>> stack.level(1).shape
    (20, 30)
    """

    def __init__(self, image: GrayImage, half: GrayImage | None = None) -> None:
        self._levels = [image]
        if half is not None and half.shape == (image.shape[0] // 2, image.shape[1] // 2):
            self._levels.append(half)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of the sensor's noise, gray, within what corners are judged by."""
        return min(sensor_noise(self._levels[0]), _MOST_NOISE)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        height, width = self._levels[0].shape
        return width, height

    def level(self, k: int) -> GrayImage:
        """The image, halved `k` times."""
        while len(self._levels) <= k:
            last = self._levels[-1]
            size = (max(1, last.shape[1] // 2), max(1, last.shape[0] // 2))
            self._levels.append(
                np.asarray(cv2.resize(last, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
            )
        return self._levels[k]


@compiled(reassociate=True)
def _resampled(picture: Any, left: float, top: float, dx: float, dy: float, height: int, width: int) -> Any:
    """Pixels (top + i dy, left + j dx) of a picture, between its own by linear interpolation; its border goes on."""
    columns = np.empty(width, np.int64)
    weights = np.empty(width, np.int32)
    last = picture.shape[1] - 1
    for j in range(width):
        x = min(max(left + j * dx, 0.0), float(last))
        columns[j] = min(int(x), last - 1)
        weights[j] = int((x - columns[j]) * 256.0 + 0.5)
    x0, x1 = columns[0], columns[width - 1] + 2
    columns -= x0
    row = np.empty(x1 - x0, np.int32)
    out = np.empty((height, width), np.uint8)
    for i in range(height):
        y = min(max(top + i * dy, 0.0), float(picture.shape[0] - 1))
        y0 = min(int(y), picture.shape[0] - 2)
        v = np.int32(int((y - y0) * 256.0 + 0.5))
        above, below = picture[y0, x0:x1], picture[y0 + 1, x0:x1]
        for k in range(x1 - x0):  # vector code; the loop below has to gather
            row[k] = np.int32(above[k]) * (np.int32(256) - v) + np.int32(below[k]) * v
        for j in range(width):
            k, w = columns[j], weights[j]
            out[i, j] = (row[k] * (np.int32(256) - w) + row[k + 1] * w + np.int32(32768)) >> np.int32(16)
    return out


@dataclass(frozen=True, slots=True)
class Window:
    """A piece of the image around an object, at a scale of its own.

    `centre_px` in edge coordinates (pixel i covers i to i + 1); `scale`: window pixels per image pixel; `shape`:
    height and width of the window.
    """

    centre_px: FloatArray
    scale: float
    shape: tuple[int, int]

    origin_px: FloatArray = field(init=False)  # where image pixel (0, 0) lies in the window

    def __post_init__(self) -> None:
        x, y = self.centre_px.tolist()
        height, width = self.shape
        left, top = (0.5 - x) * self.scale + 0.5 * width - 0.5, (0.5 - y) * self.scale + 0.5 * height - 0.5
        object.__setattr__(self, "origin_px", np.array([left, top]))

    def to_window(self, px: FloatArray) -> FloatArray:
        """Image pixels to window pixels; pixel centres at integers in both."""
        return np.asarray(px * self.scale + self.origin_px)

    def to_image(self, px: FloatArray) -> FloatArray:
        """Window pixels to image pixels."""
        return np.asarray((px - self.origin_px) / self.scale)

    def cut(self, stack: ImageStack) -> GrayImage:
        """The window's picture; beyond the image its border goes on."""
        k = 0
        while 0.5 ** (k + 1) >= self.scale and min(stack.level(k).shape) > 16:
            k += 1
        picture = stack.level(k)
        a, b = picture.shape[1] / stack.size[0], picture.shape[0] / stack.size[1]
        x, y = self.centre_px.tolist()
        height, width = self.shape
        left = ((0.5 - 0.5 * width) / self.scale + x) * a - 0.5
        top = ((0.5 - 0.5 * height) / self.scale + y) * b - 0.5
        return read_only(_resampled(picture, left, top, a / self.scale, b / self.scale, height, width))


def window_of(box_px: FloatArray) -> Window:
    """The window through which the object in a box (left, top, right, bottom edge) is looked at.

    >>> window_of(np.array([100.0, 100.0, 228.0, 228.0])).scale
    0.5
    """
    left, top, right, bottom = box_px.tolist()
    w, h = max(right - left, 1.0), max(bottom - top, 1.0)
    scale = min(SIDE_PX / math.sqrt(w * h), _MOST_ENLARGED, _LONGEST_PX / max(w, h))
    shape = (round(h * scale + 2 * _MARGIN_PX), round(w * scale + 2 * _MARGIN_PX))
    return Window(np.array([0.5 * (left + right), 0.5 * (top + bottom)]), scale, shape)


@cache
def _fast(threshold: int) -> cv2.FastFeatureDetector:
    return cv2.FastFeatureDetector.create(threshold, True)


def local_corners(
    picture: GrayImage, window: Window, box_px: FloatArray, wanted: int, occupied_px: FloatArray, noise: float
) -> FloatArray:
    """Corners inside a box, ``k^L`` of equation (7), image pixels, shape (N, 2).

    Parameters
    ----------
    picture : array
        From `Window.cut`.
    box_px : array (4,)
        The corners lie within.
    wanted : int
        At most so many.
    occupied_px : array (M, 2)
        Corners that are followed already, image pixels: none is found near them.
    noise : float
        Of the image, gray: fog leaves little contrast, but little noise, too.
    """
    low = np.maximum(window.to_window(box_px[:2] - 0.5), 4.0)
    limit = np.array([picture.shape[1], picture.shape[0]]) - 5.0
    high = np.minimum(window.to_window(box_px[2:] - 0.5), limit)
    x0, y0, x1, y1 = int(low[0]), int(low[1]), math.ceil(high[0]), math.ceil(high[1])
    if wanted < 1 or x1 - x0 < 8 or y1 - y0 < 8:
        return np.empty((0, 2))
    px = np.empty((0, 2), np.float32)
    for threshold in _FAST_THRESHOLDS:
        found = _fast(round(threshold * noise)).detect(picture[y0 - 3 : y1 + 3, x0 - 3 : x1 + 3])
        if found:
            px = np.asarray(cv2.KeyPoint.convert(found), np.float32).reshape(-1, 2)
            px += np.array([x0 - 3, y0 - 3], np.float32)
        if len(px) >= wanted:
            break
    inside = (px[:, 0] >= x0) & (px[:, 0] <= x1) & (px[:, 1] >= y0) & (px[:, 1] <= y1)
    px = px[inside]
    if len(px) == 0:
        return np.empty((0, 2))
    scores = corner_scores(picture, px)
    taken = window.to_window(occupied_px.reshape(-1, 2)).astype(np.float32)
    order, least = np.argsort(-scores, kind="stable"), _LEAST_SCORE * noise**2
    kept = spread_evenly(
        px, scores, order, least, picture.shape[1], picture.shape[0], wanted, _SPACING_PX, taken, _SPACING_PX
    )
    return window.to_image(px[kept].astype(np.float64))
