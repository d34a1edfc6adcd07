"""Equations (4) to (6) for one object: its corners moved, matched by patch, and the error ``e^L`` over its box.

A camera sees an object's motion up to scale: as a shift and a growth of its image. They are predicted with constant
velocity, every corner is followed and verified by its patch, and what most of them agree on is the object's new
motion. What does not agree (the background in the box's edges, another object) is left out and counted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from belie.geometry import FloatArray
from belie.odometry.local_features import ImageStack, View, Window
from belie.odometry.local_matching import LEAST_AGREEING, match_corners
from belie.odometry.tracking import TrackingSettings


@dataclass(frozen=True, slots=True)
class LocalMotion:
    """How one object's image moved between two frames.

    predicted_box_px : box by constant velocity; box_px : by the corners that agree (equal where too few do);
    found_px : (N, 2) corners in the new image; agreeing : (N,) those that move as the object;
    error_px2 : ``e^L``, mean squared distance of the agreeing corners from their prediction by the object's motion,
    image px²; None where too few agree; view : the object in the new image.
    """

    predicted_box_px: FloatArray
    box_px: FloatArray
    predicted_px: FloatArray
    found_px: FloatArray
    agreeing: npt.NDArray[np.bool_]
    error_px2: float | None
    growth: float
    shift_px: FloatArray
    view: View


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
    >>> from belie.odometry.local_features import window_of
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
    found, agreeing, votes, (c, s, tx, ty), squared = match_corners(
        view.pictures, seen.pictures, start, np.zeros(len(start), np.bool_) if leads is None else leads,
        settings.iterations, settings.min_correlation,
        min(settings.min_eigenvalue, current.noise**2),  # noise alone gives half of its variance
    )  # fmt: skip
    error: float | None = None
    new_growth, new_shift = growth, np.asarray(shift_px, dtype=np.float64)
    box = predicted_box
    if votes >= LEAST_AGREEING:
        middle = 0.5 * (box_px[:2] + box_px[2:])
        x, y = before.to_window(middle - 0.5).tolist()
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
        view=seen,
    )
