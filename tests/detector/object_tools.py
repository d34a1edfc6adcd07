"""Synthetic pixels for the object checks: a textured patch moves over a textured background."""

from __future__ import annotations

import cv2
import numpy as np

from belie.geometry import CameraModel

WIDTH, HEIGHT, SIDE = 480, 320, 72
FRAME_NS = 100_000_000
MODEL = CameraModel(width=WIDTH, height=HEIGHT, fx=400, fy=400, cx=239.5, cy=159.5)


def texture(seed, width, height, low=20, high=235):
    cells = np.random.default_rng(seed).integers(low, high, (height // 6 + 1, width // 6 + 1))
    return cv2.GaussianBlur(np.kron(cells, np.ones((6, 6))).astype(np.uint8)[:height, :width], (3, 3), 0.8)


BACKGROUND = texture(0, WIDTH + 200, HEIGHT, 80, 170)
PATCH, COVER = texture(1, SIDE, SIDE), texture(2, 100, 140)
BLANK = np.full((SIDE, SIDE), 120, np.uint8)


def place(image, patch, x, y):
    """Paste a patch at a whole pixel; what lies outside is cut."""
    x, y = round(x), round(y)
    h, w = patch.shape
    x0, x1 = max(x, 0), min(x + w, image.shape[1])
    if x1 > x0:
        image[y : y + h, x0:x1] = patch[:, x0 - x : x1 - x]


class Scene:
    """A patch that drives to the right before a background that drifts to the left."""

    def __init__(self, frames=40, *, patch=PATCH, speed=3.0, start=60.0, cover=None):
        self.frames, self.patch, self.speed, self.start, self.cover = frames, patch, speed, start, cover

    def box(self, k):
        x = self.start + self.speed * k
        clipped = np.clip([x, 130.0, x + SIDE, 130.0 + SIDE], 0.0, [WIDTH, HEIGHT, WIDTH, HEIGHT])
        return clipped if (clipped[2:] - clipped[:2] >= 8.0).all() else None

    def image(self, k):
        image = BACKGROUND[:, k : k + WIDTH].copy()
        place(image, self.patch, self.start + self.speed * k, 130)
        if self.cover is not None:
            place(image, COVER, self.cover(k), 100)
        noise = np.random.default_rng(1000 + k).normal(0.0, 1.5, image.shape)
        return np.clip(image + noise, 0, 255).astype(np.uint8)
