"""Traffic signs, number plates, posters, and the printed adversarial patch."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from belie.simulation.textures.noise import Rgba, fbm, rgba, text

_RED, _WHITE, _BLACK, _BLUE = (0.70, 0.04, 0.06), (0.93, 0.93, 0.92), (0.05, 0.05, 0.06), (0.05, 0.20, 0.55)


def _octagon(radius: float, middle: float = 128.0) -> npt.NDArray[np.int32]:
    angles = np.pi / 8 + np.arange(8) * np.pi / 4
    unit = np.column_stack([np.cos(angles), np.sin(angles)])
    return np.asarray(np.round(middle + radius / np.cos(np.pi / 8) * unit), np.int32)


@lru_cache(maxsize=4)
def stop_sign(patched: bool = False) -> Rgba:
    """The octagon, as a cut-out; with an adversarial patch stuck on where asked."""
    image, alpha = np.zeros((256, 256, 3), np.float32), np.zeros((256, 256), np.float32)
    cv2.fillConvexPoly(alpha, _octagon(124), 1.0, cv2.LINE_AA)
    image[:] = _WHITE
    cv2.fillConvexPoly(image, _octagon(114), _RED, cv2.LINE_AA)
    text(image, "STOP", (128, 128), 56, _WHITE)
    if patched:
        small = cv2.resize(_patch(5), (112, 80), interpolation=cv2.INTER_AREA)
        image[150:230, 72:184] = small
    return rgba(image * (0.92 + 0.12 * fbm(256, 41, slope=1.4)[..., None]), alpha)


@lru_cache(maxsize=8)
def speed_sign(limit: int) -> Rgba:
    """A speed limit, as a cut-out."""
    image, alpha = np.zeros((256, 256, 3), np.float32), np.zeros((256, 256), np.float32)
    cv2.circle(alpha, (128, 128), 124, 1.0, -1, cv2.LINE_AA)
    image[:] = _RED
    cv2.circle(image, (128, 128), 92, _WHITE, -1, cv2.LINE_AA)
    text(image, str(limit), (128, 128), 88, _BLACK)
    return rgba(image * (0.92 + 0.12 * fbm(256, 42, slope=1.4)[..., None]), alpha)


@lru_cache(maxsize=8)
def board(words: str) -> Rgba:
    """A blue board with white words: street names, directions, parking; 2 to 1."""
    image = np.zeros((128, 256, 3), np.float32)
    image[:] = _BLUE
    cv2.rectangle(image, (5, 5), (250, 122), _WHITE, 4, cv2.LINE_AA)
    text(image, words, (128, 64), min(56.0, 262.0 / len(words)), _WHITE)
    return rgba(image)


@lru_cache(maxsize=32)
def plate(seed: int) -> Rgba:
    """A number plate."""
    rng = np.random.default_rng([seed, 44])
    letters = "".join(chr(65 + int(v)) for v in rng.integers(0, 26, 3))
    image = np.zeros((48, 224, 3), np.float32) + np.array(_WHITE, np.float32)
    image[:, :20] = _BLUE
    cv2.rectangle(image, (1, 1), (222, 46), _BLACK, 2)
    text(image, f"{letters}{int(rng.integers(100, 999))}", (122, 25), 32, _BLACK)
    return rgba(image)


@lru_cache(maxsize=8)
def poster(seed: int) -> Rgba:
    """A poster of coloured shapes and words."""
    rng = np.random.default_rng([seed, 45])
    image = np.zeros((256, 192, 3), np.float32) + rng.uniform(0.2, 0.9, 3).astype(np.float32)
    for _ in range(7):
        colour = tuple(float(v) for v in rng.uniform(0.05, 0.95, 3))
        corners = rng.uniform([0, 0], [192, 256], (3, 2)).round().astype(np.int32)
        if rng.random() < 0.5:
            cv2.fillConvexPoly(image, corners, colour, cv2.LINE_AA)
        else:
            cv2.circle(
                image, tuple(int(v) for v in corners[0]), int(rng.integers(12, 60)), colour, -1, cv2.LINE_AA
            )
    words = ("MUSIK", "SALE", "FILM", "VOTE", "OPEN", "EXIT")[int(rng.integers(6))]
    text(image, words, (96, 40), 40, _WHITE)
    for y in range(190, 246, 10):
        cv2.line(image, (16, y), (int(rng.integers(90, 176)), y), _BLACK, 2)
    return rgba(image)


def _patch(seed: int) -> npt.NDArray[np.float32]:
    """A picture as optimisation against a detector makes it: saturated, patchy at every scale."""
    layers = [fbm(256, seed + 10 * c, slope=1.6, lowest=3) for c in range(3)]
    rgb = np.stack([np.clip(2.4 * (layer - 0.5) + 0.5, 0.0, 1.0) for layer in layers], axis=2)
    fine = np.stack([fbm(256, seed + 10 * c + 3, slope=1.2, lowest=12) for c in range(3)], axis=2)
    return np.ascontiguousarray(np.clip(rgb + 0.5 * (fine - 0.5), 0.0, 1.0), np.float32)


@lru_cache(maxsize=4)
def adversarial_patch(seed: int) -> Rgba:
    """The paper's printed patch, with a white border."""
    image = _patch(seed)
    image[:8] = image[-8:] = image[:, :8] = image[:, -8:] = 0.95
    return rgba(image)
