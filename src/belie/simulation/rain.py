"""Falling rain: drops drawn as streaks as long as the exposure lets them fall."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from belie.geometry import CameraModel
from belie.simulation.weather import Weather

_FALL_M_S = 6.5  # terminal speed of a drop of 2 mm (Gunn and Kinzer, 1949)
_STREAK_S = 0.012
_NEAR_M, _FAR_M = 0.7, 14.0
_DROP_M = 0.0016
_SMALL_PX = 960


def add_streaks(
    image: npt.NDArray[np.uint8], weather: Weather, camera: CameraModel, rng: np.random.Generator
) -> npt.NDArray[np.uint8]:
    """The image, shape (H, W, 3), with rain: drops spread evenly through the space before the camera."""
    count = rng.poisson(70.0 * weather.rain_mm_h**0.7)
    # Evenly in space: the number within a distance grows with its cube.
    z = (rng.uniform(_NEAR_M**3, _FAR_M**3, count)) ** (1.0 / 3.0)
    z[: count // 5] = rng.uniform(_NEAR_M, 4.0, count // 5)
    x, y = rng.uniform(0.0, camera.width, count), rng.uniform(-0.1 * camera.height, camera.height, count)
    length_px = camera.fy * _FALL_M_S * _STREAK_S / z
    lean = rng.normal(0.08, 0.04, count) + 0.25 * (x / camera.width - 0.5)
    # Streaks are soft: in large images they are drawn at half the resolution.
    share = 1.0 if camera.width < _SMALL_PX else 0.5
    veil = np.zeros([math.ceil(side * share) for side in image.shape[:2]], np.uint8)
    bright = (26.0 if weather.is_dark else 44.0) * np.clip(3.0 / z, 0.35, 1.0)
    true_px = camera.fy * _DROP_M / z * share
    width_px = np.maximum(1, np.round(true_px)).astype(np.int64)
    bright *= np.clip(true_px, 0.45, 1.0)  # what is narrower than a pixel fills it in part
    for k in range(count):
        place = np.array([x[k], y[k]])
        ends = np.stack([place, place + length_px[k] * np.array([lean[k], 1.0])])
        start, end = (ends * share * 16.0).round().astype(int).tolist()  # OpenCV's fixed point: shift 4
        cv2.line(veil, start, end, float(bright[k]), int(width_px[k]), cv2.LINE_AA, 4)
    veil = cv2.resize(veil, image.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.add(image, cv2.merge([veil, veil, veil])))
