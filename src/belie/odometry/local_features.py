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
_OFF_PX = 8.0  # window pixels that an object may be off the middle of its window
_BORDER = 0.2  # of a window's shorter side: its margin
_LEAST_PX = 24  # of a picture that corners are looked for in
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
            half = np.asarray(cv2.resize(last, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
            self._levels.append(read_only(half))
        return self._levels[k]


@compiled(reassociate=True)
def _resampled(picture: Any, left: float, top: float, dx: float, dy: float, height: int, width: int) -> Any:
    """Pixels (top + i dy, left + j dx) of a picture, between its own by linear interpolation; its border goes on."""
    columns = np.empty(
        width, np.uint32
    )  # unsigned: an index that may be negative keeps the loop from vector code
    weights = np.empty(width, np.int32)
    last_x, last_y = picture.shape[1] - 1, picture.shape[0] - 1
    for j in range(width):
        x = min(max(left + j * dx, 0.0), float(last_x))
        k = max(min(int(x), last_x - 1), 0)
        columns[j] = k
        weights[j] = int((x - k) * 256.0 + 0.5)
    x0, x1 = int(columns[0]), int(columns[width - 1]) + 1
    for j in range(width):
        columns[j] -= np.uint32(x0)
    row = np.empty(x1 + 1 - x0, np.int32)
    seen = min(x1, last_x) + 1 - x0  # all of them, but in a picture one pixel wide
    out = np.empty((height, width), np.uint8)
    for i in range(height):
        y = min(max(top + i * dy, 0.0), float(last_y))
        y0 = max(min(int(y), last_y - 1), 0)
        v = np.int32(int((y - y0) * 256.0 + 0.5))
        u = np.int32(256) - v
        above, below = picture[y0, x0:], picture[min(y0 + 1, last_y), x0:]
        for k in range(seen):  # vector code; the loop below has to gather
            row[k] = np.int32(above[k]) * u + np.int32(below[k]) * v
        if seen == 1:
            row[1] = row[0]
        line = out[i]
        for j in range(width):
            a, b = row[columns[j]], row[columns[j] + np.uint32(1)]
            line[j] = (a * np.int32(256) + (b - a) * weights[j] + np.int32(32768)) >> np.int32(16)
    return out


@compiled()
def _halved(picture: Any) -> Any:
    """As `cv2.pyrDown`, bit for bit: smoothed with (1, 4, 6, 4, 1) / 16 both ways, mirrored at the border."""
    height, width = picture.shape
    row = np.empty(width + 4, np.int32)
    out = np.empty(((height + 1) // 2, (width + 1) // 2), np.uint8)
    for i in range(out.shape[0]):
        y = 2 * i
        a, b, c = picture[abs(y - 2)], picture[abs(y - 1)], picture[y]
        d, e = picture[height - 1 - abs(height - 2 - y)], picture[height - 1 - abs(height - 3 - y)]
        for k in range(width):
            row[k + 2] = (
                np.int32(a[k]) + np.int32(e[k])
                + np.int32(4) * (np.int32(b[k]) + np.int32(d[k])) + np.int32(6) * np.int32(c[k])
            )  # fmt: skip
        row[0], row[1], row[width + 2], row[width + 3] = row[4], row[3], row[width], row[width - 1]
        line = out[i]
        for j in range(out.shape[1]):
            k = 2 * j
            line[j] = (
                row[k] + row[k + 4] + np.int32(4) * (row[k + 1] + row[k + 3]) + np.int32(6) * row[k + 2] + np.int32(128)
            ) >> np.int32(8)  # fmt: skip
    return out


@compiled()
def _looked_at(
    picture: Any, left: float, top: float, dx: float, dy: float, height: int, width: int
) -> tuple[Any, Any, Any, float]:
    """A window's picture, its half and its quarter (empty where a side would fall under 24 px), and its contrast."""
    whole = _resampled(picture, left, top, dx, dy, height, width)
    half = _halved(whole) if min(height, width) >= 2 * _LEAST_PX else np.empty((0, 0), np.uint8)
    quarter = _halved(half) if min(half.shape) >= 2 * _LEAST_PX else np.empty((0, 0), np.uint8)
    m = int(_BORDER * min(height, width))
    total, squares = np.int64(0), np.int64(0)
    for i in range(m, height - m):
        line = whole[i]
        for j in range(m, width - m):
            value = np.int64(line[j])
            total += value
            squares += value * value
    count = float((height - 2 * m) * (width - 2 * m))
    mean = total / count
    return whole, half, quarter, math.sqrt(max(squares / count - mean * mean, 0.0))


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
        return read_only(_resampled(*self._grid(stack)))

    def _grid(self, stack: ImageStack) -> tuple[GrayImage, float, float, float, float, int, int]:
        """What it is cut from: the halved image that is just fine enough; where its pixels lie there; its shape."""
        k = 0
        while 0.5 ** (k + 1) >= self.scale and min(stack.level(k).shape) > 16:
            k += 1
        picture = stack.level(k)
        a, b = picture.shape[1] / stack.size[0], picture.shape[0] / stack.size[1]
        x, y = self.centre_px.tolist()
        height, width = self.shape
        left = ((0.5 - 0.5 * width) / self.scale + x) * a - 0.5
        top = ((0.5 - 0.5 * height) / self.scale + y) * b - 0.5
        return picture, left, top, a / self.scale, b / self.scale, height, width


@dataclass(frozen=True, slots=True)
class View:
    """What one image shows of an object through its window.

    `pictures`: the window's, and its half and quarter, empty where too small; `contrast`: standard deviation of the
    object's gray values (of the window without its margin).
    """

    window: Window
    pictures: tuple[GrayImage, GrayImage, GrayImage]
    contrast: float

    @classmethod
    def of(cls, stack: ImageStack, window: Window) -> View:
        """Look through a window.

        >>> view = View.of(ImageStack(np.zeros((90, 90), np.uint8)), window_of(np.array([10.0, 10.0, 74.0, 74.0])))
        >>> [picture.shape for picture in view.pictures], view.contrast
        ([(116, 116), (58, 58), (29, 29)], 0.0)
        """
        whole, half, quarter, contrast = _looked_at(*window._grid(stack))
        return cls(window, (whole, half, quarter), contrast)

    def fits(self, box_px: FloatArray) -> bool:
        """Whether a box still lies about where and as large as the window was made for."""
        left, top, right, bottom = box_px.tolist()
        x, y = self.window.centre_px.tolist()
        scale = self.window.scale
        off = max(abs(0.5 * (left + right) - x), abs(0.5 * (top + bottom) - y)) * scale
        return off < _OFF_PX and 0.8 < _scale_of(right - left, bottom - top) / scale < 1.25


def window_of(box_px: FloatArray) -> Window:
    """The window through which the object in a box (left, top, right, bottom edge) is looked at.

    >>> window_of(np.array([100.0, 100.0, 228.0, 228.0])).scale
    0.5
    """
    left, top, right, bottom = box_px.tolist()
    w, h = max(right - left, 1.0), max(bottom - top, 1.0)
    scale = _scale_of(w, h)
    shape = (round(h * scale + 2 * _MARGIN_PX), round(w * scale + 2 * _MARGIN_PX))
    return Window(np.array([0.5 * (left + right), 0.5 * (top + bottom)]), scale, shape)


def _scale_of(width_px: float, height_px: float) -> float:
    w, h = max(width_px, 1.0), max(height_px, 1.0)
    return min(SIDE_PX / math.sqrt(w * h), _MOST_ENLARGED, _LONGEST_PX / max(w, h))


@cache
def _fast(threshold: int) -> cv2.FastFeatureDetector:
    return cv2.FastFeatureDetector.create(threshold, True)


def local_corners(
    view: View, box_px: FloatArray, wanted: int, occupied_px: FloatArray, noise: float
) -> FloatArray:
    """Corners inside a box, ``k^L`` of equation (7), image pixels, shape (N, 2).

    Parameters
    ----------
    box_px : array (4,)
        The corners lie within.
    wanted : int
        At most so many.
    occupied_px : array (M, 2)
        Corners that are followed already, image pixels: none is found near them.
    noise : float
        Of the image, gray: fog leaves little contrast, but little noise, too.
    """
    window, picture = view.window, read_only(view.pictures[0])
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
