"""Equations (4) to (6) for one object: its corners moved, matched by patch, and the error ``e^L`` over its box.

A camera sees an object's motion up to scale: as a shift and a growth of its image. They are predicted with constant
velocity, every corner is followed and verified by its patch, and what most of them agree on is the object's new
motion. What does not agree (the background in the box's edges, another object) is left out and counted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from belie.geometry import FloatArray, compiled
from belie.odometry.local_features import ImageStack, Window, window_of
from belie.odometry.tracking import Pyramid, TrackingSettings, build_pyramid, track
from belie.types import GrayImage

_TOLERANCE_PX = 2.0  # window pixels (an object is 64): objects are neither flat nor rigid
_LEVELS = 3
_LEAST_AGREEING = 3
_OFF_PX = 8.0  # window pixels; the margin of the window has 26


@dataclass(frozen=True, slots=True)
class View:
    """What one image shows of an object: its window, and the pictures in it at three scales."""

    window: Window
    pyramid: Pyramid

    @classmethod
    def of(cls, stack: ImageStack, window: Window) -> View:
        """Cut it out."""
        return cls(window, build_pyramid(window.cut(stack), _LEVELS))

    def fits(self, box_px: FloatArray) -> bool:
        """Whether a box still lies about where and as large as the window was made for."""
        window = window_of(box_px)
        (x, y), (u, v) = window.centre_px.tolist(), self.window.centre_px.tolist()
        off = max(abs(x - u), abs(y - v)) * self.window.scale
        return bool(off < _OFF_PX and 0.8 < window.scale / self.window.scale < 1.25)


@dataclass(frozen=True, slots=True)
class LocalMotion:
    """How one object's image moved between two frames.

    predicted_box_px : box by constant velocity; box_px : by the corners that agree (equal where too few do);
    found_px : (N, 2) corners in the new image; agreeing : (N,) those that move as the object;
    error_px2 : ``e^L``, mean squared distance of the agreeing corners from their prediction by the object's motion,
    image px²; None where too few agree; contrast : standard deviation of the box's gray values.
    """

    predicted_box_px: FloatArray
    box_px: FloatArray
    predicted_px: FloatArray
    found_px: FloatArray
    agreeing: npt.NDArray[np.bool_]
    error_px2: float | None
    growth: float
    shift_px: FloatArray
    contrast: float
    view: View


@compiled()
def _fit_similarity(a: Any, b: Any, tolerance: float) -> tuple[float, float, float, float, Any, float]:
    """Scale times (cos, sin) and shift of ``b = z a + t`` that most pairs agree on; which do; their squared error."""
    n = a.shape[0]
    best = -1
    bc, bs, bx, by = 1.0, 0.0, 0.0, 0.0
    limit = tolerance * tolerance
    agree = np.zeros(n, np.bool_)
    middle_x = middle_y = 0.0
    for k in range(n):
        middle_x += a[k, 0] / n
        middle_y += a[k, 1] / n
    for i in range(n):
        for j in range(i, n):
            c, s = 1.0, 0.0  # i == j: a pure shift
            if j > i:
                dx, dy = a[j, 0] - a[i, 0], a[j, 1] - a[i, 1]
                length2 = dx * dx + dy * dy
                if length2 < 100.0:
                    continue
                ex, ey = b[j, 0] - b[i, 0], b[j, 1] - b[i, 1]
                c = (dx * ex + dy * ey) / length2
                s = (dx * ey - dy * ex) / length2
                if c < 0.6 or c > 1.6 or abs(s) > 0.25:
                    continue
            tx = b[i, 0] - c * a[i, 0] + s * a[i, 1]
            ty = b[i, 1] - s * a[i, 0] - c * a[i, 1]
            count = 0
            for k in range(n):
                rx = c * a[k, 0] - s * a[k, 1] + tx - b[k, 0]
                ry = s * a[k, 0] + c * a[k, 1] + ty - b[k, 1]
                if rx * rx + ry * ry <= limit:
                    count += 1
            # Where two motions share the box, the expected one is the object's.
            mx = c * middle_x - s * middle_y + tx - middle_x
            my = s * middle_x + c * middle_y + ty - middle_y
            if mx * mx + my * my <= 4.0 * limit:
                count += n // 4
            if count > best:
                best = count
                bc, bs, bx, by = c, s, tx, ty
    for _ in range(3):
        count = 0
        ax = ay = ux = uy = 0.0
        for k in range(n):
            rx = bc * a[k, 0] - bs * a[k, 1] + bx - b[k, 0]
            ry = bs * a[k, 0] + bc * a[k, 1] + by - b[k, 1]
            agree[k] = rx * rx + ry * ry <= limit
            if agree[k]:
                count += 1
                ax += a[k, 0]
                ay += a[k, 1]
                ux += b[k, 0]
                uy += b[k, 1]
        if count < 2:
            break
        ax, ay, ux, uy = ax / count, ay / count, ux / count, uy / count
        power = cross = turn = 0.0
        for k in range(n):
            if agree[k]:
                px, py = a[k, 0] - ax, a[k, 1] - ay
                qx, qy = b[k, 0] - ux, b[k, 1] - uy
                power += px * px + py * py
                cross += px * qx + py * qy
                turn += px * qy - py * qx
        if power > 25.0 * count:
            bc, bs = cross / power, turn / power
        bx, by = ux - bc * ax + bs * ay, uy - bs * ax - bc * ay
    error = 0.0
    count = 0
    for k in range(n):
        if agree[k]:
            rx = bc * a[k, 0] - bs * a[k, 1] + bx - b[k, 0]
            ry = bs * a[k, 0] + bc * a[k, 1] + by - b[k, 1]
            error += rx * rx + ry * ry
            count += 1
    return bc, bs, bx, by, agree, error / max(count, 1)


def moved_box(box_px: FloatArray, growth: float, shift_px: FloatArray) -> FloatArray:
    """A box, grown about its middle and shifted.

    >>> moved_box(np.array([0.0, 0.0, 10.0, 10.0]), 2.0, np.array([1.0, 0.0]))
    array([-4., -5., 16., 15.])
    """
    left, top, right, bottom = box_px.tolist()
    x, y = (float(s) for s in shift_px)
    x, y = x + 0.5 * (left + right), y + 0.5 * (top + bottom)
    w, h = 0.5 * growth * (right - left), 0.5 * growth * (bottom - top)
    return np.array([x - w, y - h, x + w, y + h])


def contrast_of(picture: GrayImage) -> float:
    """Standard deviation of an object's gray values: of its window without the margin.

    >>> contrast_of(np.zeros((100, 100), np.uint8))
    0.0
    """
    m = int(0.2 * min(picture.shape))
    return float(cv2.meanStdDev(picture[m:-m, m:-m])[1][0, 0])


def follow_object(
    view: View,
    current: ImageStack,
    box_px: FloatArray,
    corners_px: FloatArray,
    growth: float,
    shift_px: FloatArray,
    settings: TrackingSettings,
    leads: npt.NDArray[np.bool_] | None = None,
) -> LocalMotion:
    """Follow one object from image to image.

    Parameters
    ----------
    view : View
        Of the object in the previous image.
    box_px, corners_px : arrays (4,), (N, 2)
        The object in the previous image.
    growth, shift_px : float, array (2,)
        Its last motion, which is expected to go on: growth of its size, shift of its middle.
    leads : array (N,) or None
        Corners that are sure to be the object's: they alone say how it moves.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> image = np.kron(rng.integers(0, 255, (40, 40)), np.ones((5, 5))).astype(np.uint8)
    >>> box, corners = np.array([60.0, 60, 124, 124]), rng.uniform(70, 110, (9, 2))
    >>> view = View.of(ImageStack(image), window_of(box))
    >>> motion = follow_object(view, ImageStack(np.roll(image, 3, axis=1)), box, corners, 1.0, np.zeros(2),
    ...                        TrackingSettings())
    >>> motion.box_px.round(0), int(motion.agreeing.sum())
    (array([ 63.,  60., 127., 124.]), 9)
    """
    predicted_box = moved_box(box_px, growth, shift_px)
    before = view.window
    # An object of the same size in its window: growth is what the scales tell.
    after = Window(before.centre_px + shift_px, before.scale / growth, before.shape)
    seen = View.of(current, after)
    start = before.to_window(corners_px)
    least = min(settings.min_eigenvalue, current.noise**2)  # noise alone gives half of its variance
    found, verified = track(view.pyramid, seen.pyramid, start, start, settings, least)
    agreeing = np.zeros(len(start), dtype=bool)
    error: float | None = None
    new_growth, new_shift = growth, np.asarray(shift_px, dtype=np.float64)
    box = predicted_box
    if verified.any():
        voters = verified
        if leads is not None and np.count_nonzero(verified & leads) >= _LEAST_AGREEING:
            voters = verified & leads
        c, s, tx, ty, agree, squared = _fit_similarity(start[voters], found[voters], _TOLERANCE_PX)
        agreeing[voters] = agree
        if voters is not verified:
            off = start @ np.array([[c, s], [-s, c]]) + np.array([tx, ty]) - found
            agreeing |= verified & ~voters & ((off * off).sum(axis=1) <= _TOLERANCE_PX**2)
        if np.count_nonzero(agree) >= _LEAST_AGREEING:
            middle = 0.5 * (box_px[:2] + box_px[2:])
            x, y = before.to_window(middle - 0.5)
            new_middle = after.to_image(np.array([c * x - s * y + tx, s * x + c * y + ty])) + 0.5
            new_growth, new_shift = growth * math.hypot(c, s), new_middle - middle
            box = moved_box(box_px, new_growth, new_shift)
            error = squared / after.scale**2
    return LocalMotion(
        predicted_box_px=predicted_box,
        box_px=box,
        predicted_px=after.to_image(start),
        found_px=after.to_image(found),
        agreeing=agreeing,
        error_px2=error,
        growth=new_growth,
        shift_px=new_shift,
        contrast=contrast_of(seen.pyramid[0]),
        view=seen,
    )
