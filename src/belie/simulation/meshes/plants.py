"""Trees, bushes and hedges: trunks with sprays of leaves."""

from __future__ import annotations

import math

import numpy as np

from belie.geometry import FloatArray
from belie.simulation import materials
from belie.simulation.meshes.builder import Builder
from belie.simulation.world import Colour

_GREENS: tuple[Colour, ...] = ((0.94, 0.90, 0.88), (0.82, 0.88, 0.80), (0.96, 0.86, 0.74), (0.78, 0.82, 0.82))


def tree(
    builder: Builder, place: FloatArray, height_m: float, rng: np.random.Generator, *, sprays: int = 64
) -> None:
    """Add a broad-leaved tree that stands at a place, world."""
    trunk_m = height_m * float(rng.uniform(0.30, 0.38))
    crown = np.array([0.30, 0.30, 0.36]) * height_m * rng.uniform(0.9, 1.1, 3)
    middle = place + np.array([0.0, 0.0, trunk_m + 0.72 * crown[2]])
    radius = 0.018 * height_m + 0.03
    lean = rng.normal(0.0, 0.02 * height_m, 2)
    fork = place + np.array([*lean, trunk_m])
    builder.tube(
        materials.bark(),
        tuple(place),
        tuple(fork),
        (radius * 1.3, radius),
        repeats=(1.0, trunk_m),
        sky_foot=0.6,
    )
    for _ in range(4):
        tip = middle + crown * rng.uniform(-0.5, 0.6, 3)
        builder.tube(
            materials.bark(),
            tuple(fork),
            tuple(tip),
            (0.6 * radius, 0.15 * radius),
            sides=5,
            repeats=(1.0, 2.0),
        )
    _sprays(builder, middle, crown, sprays, 0.19 * height_m, rng)


def bush(
    builder: Builder, place: FloatArray, size_m: float, rng: np.random.Generator, *, sprays: int = 14
) -> None:
    """Add a bush that stands at a place, world."""
    extent = size_m * np.array([0.6, 0.6, 0.45])
    _sprays(builder, place + np.array([0.0, 0.0, 0.42 * size_m]), extent, sprays, 0.55 * size_m, rng)


def _sprays(
    builder: Builder,
    middle: FloatArray,
    extent: FloatArray,
    count: int,
    size_m: float,
    rng: np.random.Generator,
) -> None:
    """Leaves on a shell: those inside a crown are not seen. Normals point outwards, as a crown is lit as a whole."""
    tint = _GREENS[int(rng.integers(len(_GREENS)))]
    material = materials.leaves(int(rng.integers(1, 4)))
    for k in range(count):
        # Evenly over the sphere (golden spiral), then shaken.
        z = 1.0 - 2.0 * (k + 0.5) / count
        angle = k * 2.39996 + float(rng.uniform(-0.3, 0.3))
        out = np.array([np.sqrt(1.0 - z * z) * np.cos(angle), np.sqrt(1.0 - z * z) * np.sin(angle), z])
        centre = middle + out * extent * rng.uniform(0.60, 1.0)
        facing = out + rng.normal(0.0, 0.45, 3)
        facing /= np.linalg.norm(facing)
        fx, fy, fz = facing.tolist()
        across = max(math.hypot(fx, fy), 1e-6)
        u = np.array([-fy, fx, 0.0]) / across  # level; v is upright
        v = np.array([-fz * fx / across, -fz * fy / across, across])
        turn = rng.uniform(0.0, 2.0 * np.pi)
        u, v = np.cos(turn) * u + np.sin(turn) * v, np.cos(turn) * v - np.sin(turn) * u
        half = 0.5 * size_m * float(rng.uniform(0.85, 1.25))
        corners = [
            centre - half * u - half * v,
            centre + half * u - half * v,
            centre + half * u + half * v,
            centre - half * u + half * v,
        ]
        sky = np.clip(0.62 + 0.38 * z + rng.normal(0.0, 0.05), 0.3, 1.0)
        uv = [[0, 1], [1, 1], [1, 0], [0, 0]]
        builder.surface(material, corners, np.tile(out, (4, 1)), uv, [[0, 1, 2], [0, 2, 3]], tint, sky)
