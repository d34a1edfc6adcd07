"""Inside of a building: painted walls, floor, ceiling, doors."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from belie.simulation.textures.noise import Rgba, fbm, rgba, text, tinted


@lru_cache(maxsize=4)
def painted_wall(seed: int) -> Rgba:
    """A wall as decorators leave it: almost blank, with faint roller marks and a few scuffs; 4 m a tile."""
    value = (
        0.82
        + 0.022 * (fbm(1024, seed, slope=0.5, lowest=40) - 0.5)
        + 0.05 * (fbm(1024, seed + 1, slope=1.8) - 0.5)
    )
    rng = np.random.default_rng([seed, 61])
    image = np.ascontiguousarray(value, np.float32)
    for _ in range(9):
        x, y = rng.uniform(0, 1024), rng.uniform(640, 1010)
        end = (int(x + rng.normal(0, 60)), int(y + rng.normal(0, 8)))
        cv2.line(
            image, (int(x), int(y)), end, float(rng.uniform(0.58, 0.72)), int(rng.integers(1, 4)), cv2.LINE_AA
        )
    return rgba(tinted(image, (1.0, 0.985, 0.95)))


@lru_cache(maxsize=4)
def vinyl(seed: int) -> Rgba:
    """Speckled vinyl flooring with welded joints and wheel marks; 3 m a tile."""
    rng = np.random.default_rng([seed, 62])
    speck = fbm(1024, seed, slope=0.15, lowest=80)
    value = 0.50 + 0.20 * np.clip(3.0 * (speck - 0.72), 0, 1) - 0.18 * np.clip(3.0 * (0.28 - speck), 0, 1)
    value = value + 0.09 * (fbm(1024, seed + 1, slope=1.7) - 0.5)
    image = np.ascontiguousarray(value, np.float32)
    image[:, :4] *= 0.62
    image[:4] *= 0.62
    for _ in range(14):
        points = rng.uniform(0, 1024, 2) + np.cumsum(rng.normal(0, 2, (24, 2)) + rng.normal(0, 14, 2), axis=0)
        cv2.polylines(image, [(points * 16).round().astype(np.int32)], False, 0.44, 2, cv2.LINE_AA, 4)
    return rgba(tinted(image, (0.96, 1.0, 1.02)))


@lru_cache(maxsize=2)
def ceiling() -> Rgba:
    """Perforated ceiling boards of 0.6 m; 2.4 m a tile."""
    value = np.full((512, 512), 0.80, np.float32) + 0.03 * (fbm(512, 64, slope=1.2) - 0.5)
    for y in range(6, 512, 14):
        for x in range(6, 512, 14):
            value[y : y + 2, x : x + 2] = 0.60
    for edge in range(0, 512, 128):
        value[edge : edge + 4] = value[:, edge : edge + 4] = 0.56
    return rgba(tinted(value, (1.0, 1.0, 0.98)))


@lru_cache(maxsize=2)
def light_panel() -> Rgba:
    """A ceiling light behind its diffuser."""
    y, x = np.mgrid[0:64, 0:256]
    value = 0.95 - 0.12 * ((x % 16 < 2) | (y % 16 < 2))
    return rgba(tinted(value, (1.0, 1.0, 0.97)), 1.0)


@lru_cache(maxsize=8)
def office_door(number: int) -> Rgba:
    """A door of veneer with handle, kick plate, name plate and a narrow pane."""
    h, w = 512, 256
    wood = fbm(512, 65 + number % 3, slope=1.2, stretch=0.1)[:, :w]
    tone = ((0.55, 0.40, 0.25), (0.40, 0.45, 0.50), (0.62, 0.52, 0.38))[number % 3]
    image = np.ascontiguousarray(tinted(0.75 + 0.45 * wood, tone), np.float32)
    cv2.rectangle(image, (0, 0), (w - 1, h - 1), (0.22,) * 3, 8)
    image[456:500, 12:244] = 0.55 + 0.1 * wood[456:500, 12:244, None]
    cv2.rectangle(image, (178, 60), (212, 250), (0.14, 0.18, 0.20), -1)
    cv2.rectangle(image, (178, 60), (212, 250), (0.3,) * 3, 3)
    cv2.circle(image, (28, 280), 9, (0.7,) * 3, -1, cv2.LINE_AA)
    cv2.line(image, (28, 280), (70, 280), (0.75,) * 3, 9, cv2.LINE_AA)
    cv2.rectangle(image, (56, 100), (140, 146), (0.92,) * 3, -1)
    text(image, f"R{number}", (98, 123), 26, (0.1, 0.1, 0.12))
    return rgba(image)


@lru_cache(maxsize=4)
def cardboard(seed: int) -> Rgba:
    """A box with tape and a label."""
    value = 0.62 + 0.14 * (fbm(256, seed, slope=1.1, stretch=0.3) - 0.5)
    image = np.ascontiguousarray(tinted(value, (1.0, 0.78, 0.54)), np.float32)
    image[112:146] *= (1.12, 1.08, 1.0)
    cv2.rectangle(image, (150, 30), (236, 96), (0.9, 0.9, 0.87), -1)
    for x in range(158, 228, 6):
        cv2.line(image, (x, 40), (x, 68), (0.05,) * 3, 1 + (x * seed) % 4)
    text(image, "FRAGILE", (76, 206), 24, (0.55, 0.1, 0.08))
    cv2.rectangle(image, (0, 0), (255, 255), (0.36, 0.26, 0.17), 4)
    return rgba(image)
