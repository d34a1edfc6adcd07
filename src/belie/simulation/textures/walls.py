"""Walls of houses: plaster, brick, ashlar, concrete; 4 m a tile."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from belie.simulation.textures.noise import Noise, Rgba, fbm, rgba, tinted

_SIZE = 1024
TILE_M = 4.0


@lru_cache(maxsize=16)
def plaster(seed: int) -> Rgba:
    """Painted plaster: grain, patches of weathering, runs of rain, hairline cracks; near white, to be tinted."""
    grain = fbm(_SIZE, seed, slope=0.5, lowest=24)
    patches = fbm(_SIZE, seed + 1, slope=1.7)
    runs = fbm(_SIZE, seed + 2, slope=1.3, stretch=0.12, lowest=3)
    value = 0.80 + 0.16 * (grain - 0.5) + 0.24 * (patches - 0.5) + 0.14 * (runs - 0.5)
    value = _cracked(value, seed, 7)
    # Where plaster has come off, the brick shows darker.
    bare = np.clip((fbm(_SIZE, seed + 3, slope=1.9) - 0.80) * 12.0, 0.0, 1.0)
    rgb = tinted(value, (1.0, 0.99, 0.97))
    return rgba(rgb * (1.0 - 0.35 * bare[..., None]))


@lru_cache(maxsize=16)
def brick(seed: int) -> Rgba:
    """Bricks in stretcher bond with mortar, each of its own shade."""
    rows, columns = 48, 16
    return _masonry(seed, rows, columns, mortar=0.66, colour_spread=0.30, joint_px=3)


@lru_cache(maxsize=16)
def ashlar(seed: int) -> Rgba:
    """Large hewn stones."""
    return _masonry(seed, 10, 6, mortar=0.45, colour_spread=0.22, joint_px=4)


@lru_cache(maxsize=16)
def concrete(seed: int) -> Rgba:
    """Panels of concrete with joints, anchor holes and stains."""
    value = (
        0.72
        + 0.14 * (fbm(_SIZE, seed, slope=1.5) - 0.5)
        + 0.12 * (fbm(_SIZE, seed + 1, slope=0.4, lowest=30) - 0.5)
    )
    value = value + 0.12 * (fbm(_SIZE, seed + 2, slope=1.2, stretch=0.1) - 0.5)
    step = _SIZE // 2
    for edge in range(0, _SIZE, step):
        value[edge : edge + 5] *= 0.62
        value[:, edge : edge + 5] *= 0.62
    holes = np.ascontiguousarray(value, np.float32)
    for x in range(step // 4, _SIZE, step // 2):
        for y in range(step // 4, _SIZE, step // 2):
            cv2.circle(holes, (x, y), 7, 0.36, -1, cv2.LINE_AA)
    return rgba(tinted(_cracked(holes, seed, 5), (0.98, 0.98, 1.0)))


def _masonry(
    seed: int, rows: int, columns: int, *, mortar: float, colour_spread: float, joint_px: int
) -> Rgba:
    rng = np.random.default_rng([seed, 31])
    y, x = np.mgrid[0:_SIZE, 0:_SIZE].astype(np.float32)
    row = (y * rows / _SIZE).astype(np.int32)
    shifted = (x + (row % 2) * (0.5 * _SIZE / columns)) % _SIZE
    column = (shifted * columns / _SIZE).astype(np.int32)
    shade = 1.0 + colour_spread * rng.normal(0.0, 0.5, (rows, columns)).clip(-1.2, 1.2)
    hue = rng.normal(0.0, 0.014, (rows, columns, 3))
    stone = shade[row, column]
    in_y, in_x = y % (_SIZE / rows), shifted % (_SIZE / columns)
    joint = (in_y < joint_px) | (in_x < joint_px)
    # The upper edge of a stone catches light, the lower lies in the shade.
    relief = 0.10 * (in_y < joint_px + 3) - 0.12 * (in_y > _SIZE / rows - 3)
    value = 0.66 * stone + relief + 0.22 * (fbm(_SIZE, seed, slope=0.7, lowest=12) - 0.5)
    value += 0.20 * (fbm(_SIZE, seed + 1, slope=1.7) - 0.5)
    rgb = tinted(value, (1.0, 1.0, 1.0)) * (1.0 + hue[row, column])
    dust = mortar * (0.9 + 0.25 * (fbm(_SIZE, seed + 2, slope=0.6, lowest=16) - 0.5))
    rgb = np.where(joint[..., None], tinted(dust, (1.0, 0.98, 0.95)), rgb)
    return rgba(rgb)


def _cracked(value: Noise, seed: int, count: int) -> Noise:
    """Draw hairline cracks: random walks."""
    rng = np.random.default_rng([seed, 77])
    image = np.ascontiguousarray(value, np.float32)
    for _ in range(count):
        steps = rng.normal(0.0, 1.0, (40, 2)) * 9.0 + rng.normal(0.0, 6.0, 2)
        points = rng.uniform(0, _SIZE, 2) + np.cumsum(steps, axis=0)
        cv2.polylines(image, [(points * 16).round().astype(np.int32)], False, 0.48, 1, cv2.LINE_AA, 4)
    return image
