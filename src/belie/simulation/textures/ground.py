"""Streets, pavements, grass and fields, and what lies on them as decals: marks, cracks, manholes, stains."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from belie.simulation.textures.noise import Rgba, fbm, rgba, tinted

_SIZE = 1024


@lru_cache(maxsize=4)
def asphalt(seed: int) -> Rgba:
    """Asphalt with its stones and worn tracks; 6 m a tile."""
    rng = np.random.default_rng([seed, 3])
    value = (
        0.31
        + 0.10 * (fbm(_SIZE, seed, slope=1.5) - 0.5)
        + 0.16 * (fbm(_SIZE, seed + 1, slope=0.25, lowest=60) - 0.5)
    )
    value = value + 0.05 * (fbm(_SIZE, seed + 2, slope=1.4, stretch=0.2) - 0.5)
    image = np.ascontiguousarray(value, np.float32)
    for _ in range(2600):  # single light and dark stones
        x, y = rng.integers(0, _SIZE, 2)
        cv2.circle(
            image, (int(x), int(y)), int(rng.integers(1, 3)), float(rng.uniform(0.16, 0.52)), -1, cv2.LINE_AA
        )
    return rgba(tinted(image, (0.99, 1.0, 1.02)))


@lru_cache(maxsize=4)
def slabs(seed: int) -> Rgba:
    """Slabs of a pavement, 0.5 m each; 4 m a tile."""
    rng = np.random.default_rng([seed, 4])
    count = 8
    y, x = np.mgrid[0:_SIZE, 0:_SIZE]
    row = y * count // _SIZE
    shifted = (x + (row % 2) * _SIZE // (2 * count)) % _SIZE
    column = shifted * count // _SIZE
    shade = 0.56 + 0.055 * rng.normal(0.0, 1.0, (count, count)).clip(-2, 2)
    value = shade[row, column] + 0.12 * (fbm(_SIZE, seed, slope=0.5, lowest=20) - 0.5)
    value += 0.16 * (fbm(_SIZE, seed + 1, slope=1.6) - 0.5)
    side = _SIZE // count
    gap = (y % side < 5) | (shifted % side < 5)
    value = np.where(gap, 0.30 + 0.1 * fbm(_SIZE, seed + 2, slope=0.8), value)
    image = np.ascontiguousarray(value, np.float32)
    for _ in range(120):  # chewing gum and stains
        cx, cy = rng.integers(0, _SIZE, 2)
        cv2.circle(
            image,
            (int(cx), int(cy)),
            int(rng.integers(2, 7)),
            float(rng.uniform(0.26, 0.46)),
            -1,
            cv2.LINE_AA,
        )
    return rgba(tinted(image, (1.0, 0.985, 0.95)))


@lru_cache(maxsize=4)
def kerb(seed: int) -> Rgba:
    """Kerb stones, 1 m each; 4 m a tile."""
    value = 0.62 + 0.2 * (fbm(256, seed, slope=0.7, lowest=4) - 0.5)
    value = np.array(value)
    for x in range(0, 256, 64):
        value[:, x : x + 3] *= 0.5
    return rgba(tinted(value, (1.0, 0.99, 0.96)))


@lru_cache(maxsize=4)
def grass(seed: int) -> Rgba:
    """A lawn: blades over soil; 4 m a tile."""
    rng = np.random.default_rng([seed, 8])
    base = 0.26 + 0.22 * (fbm(_SIZE, seed, slope=1.3) - 0.5)
    image = np.ascontiguousarray(np.stack([base * 0.84, base * 1.02, base * 0.52], axis=2), np.float32)
    for _ in range(9000):
        x, y = rng.uniform(0, _SIZE, 2)
        dx, dy = rng.normal(0.0, 7.0, 2)
        bright = rng.uniform(0.2, 0.56)
        colour = (bright * rng.uniform(0.62, 0.95), bright, bright * rng.uniform(0.25, 0.45))
        cv2.line(image, (int(x), int(y)), (int(x + dx), int(y + dy)), colour, 2, cv2.LINE_AA)
    return rgba(image)


@lru_cache(maxsize=8)
def field(kind: str, seed: int) -> Rgba:
    """A field: ``corn``, ``wheat``, ``rape``, ``soil`` or ``meadow``; rows along x; 12 m a tile."""
    colours = {
        "corn": ((0.24, 0.31, 0.14), (0.35, 0.29, 0.20), 20),
        "wheat": ((0.66, 0.55, 0.28), (0.50, 0.41, 0.22), 56),
        "rape": ((0.58, 0.55, 0.30), (0.36, 0.39, 0.22), 40),
        "soil": ((0.42, 0.32, 0.23), (0.30, 0.22, 0.16), 30),
        "meadow": ((0.29, 0.35, 0.19), (0.26, 0.30, 0.16), 0),
    }
    crop, gap, rows = colours[kind]
    rng = np.random.default_rng([seed, 12])
    noise, grain = fbm(_SIZE, seed, slope=1.4), fbm(_SIZE, seed + 1, slope=0.35, lowest=30)
    y = np.arange(_SIZE)[:, None] + 14.0 * (fbm(_SIZE, seed + 2, slope=1.8) - 0.5)
    wave = 0.5 + 0.5 * np.sin(2.0 * np.pi * y * rows / _SIZE) if rows else np.full((_SIZE, _SIZE), 0.6)
    share = np.clip(1.6 * (wave - 0.3) + 0.9 * (noise - 0.5), 0.0, 1.0)[..., None]
    rgb = np.array(crop, np.float32) * share + np.array(gap, np.float32) * (1.0 - share)
    rgb = rgb * (0.62 + 0.42 * grain + 0.36 * noise)[..., None]
    image = np.ascontiguousarray(rgb, np.float32)
    for _ in range(900):  # weeds, stones, bare spots
        cx, cy = rng.integers(0, _SIZE, 2)
        shade = float(rng.uniform(0.45, 1.5))
        cv2.circle(
            image,
            (int(cx), int(cy)),
            int(rng.integers(2, 8)),
            [float(c) * shade for c in crop],
            -1,
            cv2.LINE_AA,
        )
    return rgba(image)


@lru_cache(maxsize=8)
def paint(seed: int) -> Rgba:
    """Worn road paint as a decal: 1 m across, 4 m long."""
    noise, wear = fbm(512, seed, slope=0.6, lowest=8), fbm(512, seed + 1, slope=1.5)
    value = 0.80 + 0.16 * (noise - 0.5)
    alpha = np.clip(
        1.25 - 2.4 * np.clip(wear - 0.56, 0.0, 1.0) - 0.9 * np.clip(noise - 0.62, 0.0, 1.0), 0.0, 0.95
    )
    return rgba(tinted(value, (1.0, 0.99, 0.95)), alpha)


@lru_cache(maxsize=16)
def cracks(seed: int) -> Rgba:
    """Cracks in asphalt as a decal, 4 m a side: branching random walks, partly sealed with tar."""
    rng = np.random.default_rng([seed, 15])
    alpha = np.zeros((512, 512), np.float32)
    for _ in range(int(rng.integers(1, 3))):
        heading, point = rng.uniform(0, 2 * np.pi), rng.uniform(150, 362, 2)
        branches = [(point, heading, int(rng.integers(3, 6)))]
        while branches:
            start, heading, width = branches.pop()
            points = [start]
            for _step in range(int(rng.integers(20, 60))):
                heading += rng.normal(0.0, 0.38)
                points.append(points[-1] + 6.5 * np.array([np.cos(heading), np.sin(heading)]))
                if width > 2 and rng.random() < 0.025:
                    branches.append(
                        (points[-1], heading + rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.2), width - 2)
                    )
            line = (np.array(points) * 16).round().astype(np.int32)
            cv2.polylines(alpha, [line], False, float(rng.uniform(0.65, 0.95)), width, cv2.LINE_AA, 4)
    y, x = np.mgrid[0:512, 0:512]
    fade = np.clip(6.0 * (1.0 - np.hypot(x - 256, y - 256) / 256), 0.0, 1.0)
    return rgba(np.full((512, 512, 3), 0.075, np.float32), alpha * fade)


@lru_cache(maxsize=16)
def patch_of_tar(seed: int) -> Rgba:
    """A repair: a darker rectangle with a sealed edge; or, with an odd seed, an oil stain."""
    noise, grain = fbm(256, seed, slope=1.6), fbm(256, seed + 1, slope=0.3, lowest=20)
    y, x = np.mgrid[0:256, 0:256] / 255.0 - 0.5
    if seed % 2:
        alpha = np.clip(2.4 * (0.42 - np.hypot(x, y) + 0.5 * (noise - 0.5)), 0.0, 0.5)
        return rgba(tinted(np.full((256, 256), 0.10), (1.0, 1.0, 1.0)), alpha)
    edge = 0.46 - np.maximum(np.abs(x), np.abs(y)) + 0.02 * (noise - 0.5)
    value = np.where(edge < 0.025, 0.10, 0.22 + 0.12 * (grain - 0.5))
    return rgba(tinted(value, (1.0, 1.0, 1.02)), np.clip(edge * 120.0, 0.0, 0.92))


@lru_cache(maxsize=2)
def manhole() -> Rgba:
    """A cast-iron cover, 0.8 m across."""
    y, x = np.mgrid[0:256, 0:256] - 127.5
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    ribs = np.sin(radius * 0.35) * np.sin(angle * 12.0)
    value = 0.24 + 0.07 * np.sign(ribs) + 0.08 * (fbm(256, 3, slope=0.6, lowest=8) - 0.5)
    value = np.where(np.abs(radius - 104) < 5, 0.10, value)
    return rgba(tinted(value, (1.0, 0.97, 0.94)), np.clip(124.0 - radius, 0.0, 1.0))


@lru_cache(maxsize=2)
def blob() -> Rgba:
    """The darkness below a body, as a decal."""
    y, x = np.mgrid[0:64, 0:64] / 31.5 - 1.0
    falloff = np.clip(1.0 - np.maximum(np.abs(x), np.abs(y)) ** 3 * 0.5 - 0.5 * np.hypot(x, y) ** 2, 0.0, 1.0)
    return rgba(np.zeros((64, 64, 3), np.float32), 0.72 * falloff)
