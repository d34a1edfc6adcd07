"""Leaves and bark."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from belie.simulation.textures.noise import Rgba, fbm, rgba, tinted


@lru_cache(maxsize=8)
def leaves(seed: int) -> Rgba:
    """A spray of leaves as a cut-out: some hundred single leaves, the lower ones in the shade."""
    rng = np.random.default_rng([seed, 21])
    size = 256
    image = np.zeros((size, size, 3), np.float32) + np.array([0.16, 0.26, 0.07], np.float32)
    alpha = np.zeros((size, size), np.float32)
    for layer in range(190):
        radius, angle = 104.0 * np.sqrt(rng.random()), rng.uniform(0.0, 2.0 * np.pi)
        middle = (int(128 + radius * np.cos(angle)), int(128 + radius * np.sin(angle)))
        axes = (int(rng.uniform(9, 15)), int(rng.uniform(4, 7)))
        bright = rng.uniform(0.20, 0.34) * (0.6 + 0.7 * layer / 190)
        colour = (
            bright * rng.uniform(0.7, 1.05),
            bright * rng.uniform(1.0, 1.2),
            bright * rng.uniform(0.35, 0.6),
        )
        turn = rng.uniform(0, 360)
        cv2.ellipse(image, middle, axes, turn, 0, 360, colour, -1, cv2.LINE_AA)
        cv2.ellipse(alpha, middle, axes, turn, 0, 360, 1.0, -1, cv2.LINE_AA)
    return rgba(image, alpha)


@lru_cache(maxsize=4)
def blades(seed: int) -> Rgba:
    """Tall grass as a cut-out that stands on its lower edge."""
    rng = np.random.default_rng([seed, 22])
    image = np.zeros((128, 256, 3), np.float32) + np.array([0.22, 0.27, 0.08], np.float32)
    alpha = np.zeros((128, 256), np.float32)
    for _ in range(150):
        x, tall, lean = rng.uniform(0, 256), rng.uniform(30, 118), rng.normal(0, 18)
        bright = rng.uniform(0.18, 0.42)
        line = np.array([[x - 2, 127], [x + lean, 127 - tall], [x + 2.5, 127]]).round().astype(np.int32)
        cv2.fillConvexPoly(image, line, (bright * 0.85, bright, bright * 0.35), cv2.LINE_AA)
        cv2.fillConvexPoly(alpha, line, 1.0, cv2.LINE_AA)
    return rgba(image, alpha)


@lru_cache(maxsize=4)
def bark(seed: int) -> Rgba:
    """Furrowed bark."""
    value = 0.30 + 0.34 * (fbm(256, seed, slope=1.0, stretch=0.2, lowest=4) - 0.5)
    value = value + 0.18 * (fbm(256, seed + 1, slope=1.6) - 0.5)
    return rgba(tinted(value, (1.0, 0.86, 0.70)))


@lru_cache(maxsize=4)
def tiles(seed: int) -> Rgba:
    """Roof tiles in overlapping rows; near white, to be tinted; 3 m a tile."""
    rng = np.random.default_rng([seed, 23])
    rows, columns, size = 12, 14, 512
    y, x = np.mgrid[0:size, 0:size].astype(np.float32)
    row, column = (y * rows / size).astype(int), (x * columns / size).astype(int)
    shade = 0.74 + 0.10 * rng.normal(0.0, 1.0, (rows, columns)).clip(-2, 2)
    in_y, in_x = (y * rows / size) % 1.0, (x * columns / size) % 1.0
    value = shade[row, column] * (0.66 + 0.34 * np.sin(np.pi * in_x)) * (1.0 - 0.45 * (in_y > 0.86))
    value = value + 0.24 * (fbm(size, seed, slope=1.3) - 0.5)
    return rgba(tinted(value, (1.0, 0.98, 0.96)))
