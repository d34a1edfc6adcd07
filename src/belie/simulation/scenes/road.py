"""The road itself: strips swept along a path, marks, and the traces of wear."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from belie.simulation import materials
from belie.simulation.meshes.builder import WHITE, Builder
from belie.simulation.motion import Path
from belie.simulation.scenes.common import beside
from belie.simulation.textures import ground
from belie.simulation.world import Colour, Material

_STEP_M = 2.0
_MARK_UP_M = 0.012
_WEAR_UP_M = 0.006


def strip(
    builder: Builder,
    material: Material,
    path: Path,
    span_m: tuple[float, float],
    profile: npt.ArrayLike,
    tile_m: float,
    *,
    colour: Colour = WHITE,
    sky: npt.ArrayLike = 1.0,
    step_m: float = _STEP_M,
    upright: bool = False,
) -> None:
    """Sweep a profile (N, 2: left, up) along a path; its texture is repeated every `tile_m`.

    From right to left it faces upwards. `upright` hangs the texture by the profile's height: for walls.
    """
    section = np.asarray(profile, np.float64)
    ways = np.linspace(*span_m, max(2, math.ceil((span_m[1] - span_m[0]) / step_m) + 1))
    frames = [path.frame(float(way)) for way in ways]
    local = np.column_stack([np.zeros(len(section)), section])
    points = np.stack([T.apply(local) for T in frames], axis=1)  # rows across, columns along
    across = (
        np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(section, axis=0), axis=1))]) + section[0, 0]
    )
    uv = np.stack(np.meshgrid(ways / tile_m, (-section[:, 1] if upright else across) / tile_m), axis=2)
    builder.grid(
        material, points, uv, colour, np.broadcast_to(np.asarray(sky, np.float64), (len(section),))[:, None]
    )


def line(
    builder: Builder,
    path: Path,
    span_m: tuple[float, float],
    left_m: float,
    width_m: float,
    *,
    dash_m: tuple[float, float] | None = None,
) -> None:
    """Paint a line along a path: dashes of a length and a gap, or unbroken."""
    material = materials.decal(ground.paint, 1)
    half = 0.5 * width_m
    dash, gap = dash_m if dash_m is not None else (12.0, 0.0)
    way = span_m[0]
    while way < span_m[1]:
        stop = min(way + dash, span_m[1])
        if stop - way > 0.2:
            profile = [(left_m - half, _MARK_UP_M), (left_m + half, _MARK_UP_M)]
            strip(builder, material, path, (way, stop), profile, 4.0)
        way += dash + gap


def decal(
    builder: Builder,
    material: Material,
    path: Path,
    way_m: float,
    left_m: float,
    size_m: tuple[float, float],
    turn_rad: float,
    up_m: float = _WEAR_UP_M,
) -> None:
    """Lay a rectangle on the road."""
    T = beside(path, way_m, left_m, up_m, turn_rad)
    x, y = 0.5 * size_m[0], 0.5 * size_m[1]
    corners = T.apply(np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]]))
    builder.quad(material, corners)


def wear(
    builder: Builder, path: Path, span_m: tuple[float, float], half_width_m: float, rng: np.random.Generator
) -> None:
    """Cracks, repairs, stains and manholes, about three every 10 m."""
    way = span_m[0]
    while way < span_m[1]:
        way += float(rng.exponential(3.2)) + 0.4
        left = float(rng.uniform(-half_width_m + 1.0, half_width_m - 1.0))
        turn = float(rng.uniform(0.0, 2.0 * np.pi))
        kind = rng.random()
        if kind < 0.52:
            size = float(rng.uniform(2.4, 4.5))
            decal(
                builder,
                materials.decal(ground.cracks, int(rng.integers(1, 9))),
                path,
                way,
                left,
                (size, size),
                turn,
            )
        elif kind < 0.72:
            size_m = (float(rng.uniform(1.0, 5.0)), float(rng.uniform(0.8, 2.0)))
            decal(
                builder,
                materials.decal(ground.patch_of_tar, 2 * int(rng.integers(1, 4))),
                path,
                way,
                left,
                size_m,
                0.0,
                _WEAR_UP_M + 0.002,
            )
        elif kind < 0.90:
            size = float(rng.uniform(0.6, 1.8))
            decal(
                builder,
                materials.decal(ground.patch_of_tar, 2 * int(rng.integers(1, 4)) + 1),
                path,
                way,
                left,
                (size, size),
                turn,
                _WEAR_UP_M + 0.003,
            )
        else:
            decal(
                builder,
                materials.decal(ground.manhole),
                path,
                way,
                left,
                (0.8, 0.8),
                turn,
                _WEAR_UP_M + 0.004,
            )


def crossing(builder: Builder, path: Path, way_m: float, half_width_m: float) -> None:
    """A zebra crossing with its stop line."""
    material = materials.decal(ground.paint, 1)
    for left in np.arange(-half_width_m + 0.5, half_width_m - 0.4, 1.0):
        decal(builder, material, path, way_m, float(left), (3.2, 0.5), 0.0, _MARK_UP_M)
    decal(
        builder, material, path, way_m - 3.2, -0.5 * half_width_m, (0.45, half_width_m - 0.3), 0.0, _MARK_UP_M
    )
