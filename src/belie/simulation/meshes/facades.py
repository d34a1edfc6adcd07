"""Facades bay by bay: recessed windows, doors, shops, awnings and balconies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from belie.simulation import materials
from belie.simulation.meshes.builder import Builder
from belie.simulation.textures.openings import (
    DOOR_COLUMNS,
    SHOP_COLUMNS,
    SHOP_ROWS,
    WINDOW_COLUMNS,
    WINDOW_ROWS,
)
from belie.simulation.textures.walls import TILE_M
from belie.simulation.world import Colour, Material

FOOT_SKY = 0.62  # what the foot of a wall sees of the sky
_RECESS_M, _REVEAL_SKY = 0.22, 0.55
TINTS: tuple[Colour, ...] = (
    (0.88, 0.80, 0.66),
    (0.80, 0.56, 0.42),
    (0.93, 0.90, 0.84),
    (0.72, 0.74, 0.70),
    (0.86, 0.70, 0.48),
    (0.62, 0.66, 0.74),
    (0.76, 0.62, 0.58),
    (0.66, 0.70, 0.58),
)
_BRICK_TINTS: tuple[Colour, ...] = (
    (0.72, 0.40, 0.31),
    (0.60, 0.36, 0.28),
    (0.78, 0.62, 0.46),
    (0.55, 0.48, 0.44),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FacadeStyle:
    """How a house looks; drawn by `facade_style`."""

    wall: Material
    base: Material
    tint: Colour
    trim: Colour
    bay_m: float
    floor_m: float
    ground_floor_m: float
    floors: int
    window_m: tuple[float, float]
    window_row: int
    has_balconies: bool
    has_shops: bool


def facade_style(rng: np.random.Generator, *, most_floors: int = 6) -> FacadeStyle:
    """A style at random."""
    kind = str(rng.choice(materials.WALL_KINDS, p=[0.5, 0.27, 0.13, 0.10]))
    tints = _BRICK_TINTS if kind == "brick" else TINTS
    bay = float(rng.uniform(2.3, 3.3))
    floor = float(rng.uniform(2.9, 3.5))
    return FacadeStyle(
        wall=materials.wall(kind, int(rng.integers(1, 3))),
        base=materials.wall("ashlar", 1),
        tint=tints[int(rng.integers(len(tints)))],
        trim=(0.90, 0.88, 0.84) if rng.random() < 0.6 else (0.62, 0.56, 0.50),
        bay_m=bay,
        floor_m=floor,
        ground_floor_m=float(rng.uniform(3.4, 4.1)),
        floors=int(rng.integers(2, most_floors)),
        window_m=(bay * float(rng.uniform(0.40, 0.58)), floor * float(rng.uniform(0.50, 0.64))),
        window_row=int(rng.integers(WINDOW_ROWS)),
        has_balconies=bool(rng.random() < 0.35),
        has_shops=bool(rng.random() < 0.45),
    )


def rectangle(
    builder: Builder,
    material: Material,
    x0: float,
    x1: float,
    z0: float,
    z1: float,
    colour: Colour,
    foot_sky: float = 1.0,
) -> None:
    """A piece of wall from x0 to x1 and z0 to z1; nothing where it would have no width."""
    if x1 - x0 < 1e-6 or z1 - z0 < 1e-6:
        return
    corners = [[x0, 0.0, z0], [x1, 0.0, z0], [x1, 0.0, z1], [x0, 0.0, z1]]
    uv = [[x / TILE_M, -z / TILE_M] for x, _, z in corners]
    builder.quad(material, corners, uv, colour, [foot_sky, foot_sky, 1.0, 1.0])


def _opening(
    builder: Builder,
    material: Material,
    box: tuple[float, float, float, float],
    uv_box: tuple[float, float, float, float],
    reveal: Material,
    tint: Colour,
) -> None:
    """A recessed rectangle (x0, x1, z0, z1) with its four reveals."""
    x0, x1, z0, z1 = box
    d = _RECESS_M
    u0, u1, v0, v1 = uv_box
    builder.quad(
        material,
        [[x0, d, z0], [x1, d, z0], [x1, d, z1], [x0, d, z1]],
        [[u0, v1], [u1, v1], [u1, v0], [u0, v0]],
        sky=[0.85, 0.85, 0.65, 0.65],
    )
    outer, inner = (
        np.array([[x0, 0, z0], [x1, 0, z0], [x1, 0, z1], [x0, 0, z1]]),
        np.array([[x0, d, z0], [x1, d, z0], [x1, d, z1], [x0, d, z1]]),
    )
    for k in range(4):
        n = (k + 1) % 4
        side = [outer[k], outer[n], inner[n], inner[k]]
        length = float(np.linalg.norm(outer[n] - outer[k]))
        uv = np.array([[0.0, 0.0], [length, 0.0], [length, d], [0.0, d]]) / TILE_M
        builder.quad(reveal, side, uv, tint, [1.0, 1.0, _REVEAL_SKY, _REVEAL_SKY])


def window_bay(
    builder: Builder,
    style: FacadeStyle,
    x: float,
    z: float,
    width: float,
    tall: float,
    window_m: tuple[float, float],
    rng: np.random.Generator,
) -> None:
    """A bay of one floor with a window in its wall."""
    w, h = window_m
    x0, z0 = x + 0.5 * (width - w), z + 0.28 * tall
    x1, z1 = x0 + w, min(z0 + h, z + tall - 0.25)
    foot = 1.0 if z > 0.1 else FOOT_SKY
    rectangle(builder, style.wall, x, x + width, z, z0, style.tint, foot)
    rectangle(builder, style.wall, x, x + width, z1, z + tall, style.tint)
    rectangle(builder, style.wall, x, x0, z0, z1, style.tint)
    rectangle(builder, style.wall, x1, x + width, z0, z1, style.tint)
    column = int(rng.integers(WINDOW_COLUMNS))
    row = style.window_row if rng.random() < 0.7 else int(rng.integers(WINDOW_ROWS))
    u, v = column / WINDOW_COLUMNS, row / WINDOW_ROWS
    _opening(
        builder,
        materials.windows(),
        (x0, x1, z0, z1),
        (u, u + 1 / WINDOW_COLUMNS, v, v + 1 / WINDOW_ROWS),
        style.wall,
        style.tint,
    )
    builder.box(
        materials.kerb(), (0.5 * (x0 + x1), -0.05, z0 - 0.04), (w + 0.24, 0.16, 0.08), style.trim, 2.0, 0.6
    )
    if rng.random() < 0.8:
        builder.box(
            materials.kerb(), (0.5 * (x0 + x1), -0.025, z1 + 0.09), (w + 0.30, 0.06, 0.18), style.trim, 2.0
        )


def ground_bay(
    builder: Builder,
    style: FacadeStyle,
    x: float,
    width: float,
    tall: float,
    is_door: bool,
    rng: np.random.Generator,
) -> None:
    """A bay of the ground floor: a door, a shop or a window."""
    if is_door:
        w, h = 1.15, 2.35
        x0 = x + 0.5 * (width - w)
        rectangle(builder, style.base, x, x0, 0.0, tall, style.tint, FOOT_SKY)
        rectangle(builder, style.base, x0 + w, x + width, 0.0, tall, style.tint, FOOT_SKY)
        rectangle(builder, style.base, x0, x0 + w, h, tall, style.tint)
        u = int(rng.integers(DOOR_COLUMNS)) / DOOR_COLUMNS
        _opening(
            builder,
            materials.doors(),
            (x0, x0 + w, 0.0, h),
            (u, u + 1 / DOOR_COLUMNS, 0.0, 1.0),
            style.base,
            style.tint,
        )
        builder.box(materials.kerb(), (x0 + 0.5 * w, -0.2, 0.08), (w + 0.5, 0.5, 0.16), style.trim, 2.0, 0.6)
        builder.box(
            materials.kerb(), (x0 + 0.5 * w, -0.3, h + 0.22), (w + 0.8, 0.7, 0.12), style.trim, 2.0, 0.6
        )
    elif style.has_shops and width > 2.2:
        w, h = width - 0.4, 2.9
        x0 = x + 0.2
        rectangle(builder, style.base, x, x0, 0.0, tall, style.tint, FOOT_SKY)
        rectangle(builder, style.base, x0 + w, x + width, 0.0, tall, style.tint, FOOT_SKY)
        rectangle(builder, style.base, x0, x0 + w, h, tall, style.tint)
        column, row = int(rng.integers(SHOP_COLUMNS)), int(rng.integers(SHOP_ROWS))
        u, v = column / SHOP_COLUMNS, row / SHOP_ROWS
        _opening(
            builder,
            materials.shops(),
            (x0, x0 + w, 0.0, h),
            (u, u + 1 / SHOP_COLUMNS, v, v + 1 / SHOP_ROWS),
            style.base,
            style.tint,
        )
        if rng.random() < 0.5:
            _awning(builder, x0, x0 + w, h - 0.1, rng)
    else:
        window_bay(builder, style, x, 0.0, width, tall, (style.window_m[0], style.window_m[1] * 1.05), rng)


def _awning(builder: Builder, x0: float, x1: float, z: float, rng: np.random.Generator) -> None:
    colour = ((0.75, 0.20, 0.16), (0.18, 0.40, 0.26), (0.80, 0.72, 0.52), (0.20, 0.28, 0.50))[
        int(rng.integers(4))
    ]
    stripes = max(2, round((x1 - x0) / 0.35))
    edges = np.linspace(x0, x1, stripes + 1)
    for i in range(stripes):
        a, b = edges[i], edges[i + 1]
        tint = colour if i % 2 else (0.92, 0.90, 0.85)
        builder.quad(
            materials.cloth(),
            [[a, -1.1, z - 0.35], [b, -1.1, z - 0.35], [b, 0.0, z], [a, 0.0, z]],
            colour=tint,
        )
        builder.quad(
            materials.cloth(),
            [[a, -1.1, z - 0.58], [b, -1.1, z - 0.58], [b, -1.1, z - 0.35], [a, -1.1, z - 0.35]],
            colour=tint,
        )


def balcony(builder: Builder, style: FacadeStyle, x: float, z: float, width: float) -> None:
    """A slab with a railing before a bay."""
    deep = 1.1
    builder.box(materials.kerb(), (x, -0.5 * deep, z + 0.06), (width, deep, 0.16), style.trim, 2.0, 0.45)
    rail: Colour = (0.16, 0.17, 0.19)
    top = z + 1.12
    builder.box(materials.railing(), (x, -deep + 0.03, top), (width, 0.06, 0.05), rail)
    for side in (-1.0, 1.0):
        builder.box(materials.railing(), (x + side * 0.5 * width, -0.5 * deep, top), (0.05, deep, 0.05), rail)
    for post in np.linspace(x - 0.5 * width, x + 0.5 * width, max(5, round(width / 0.22))):
        builder.box(materials.railing(), (float(post), -deep + 0.03, z + 0.6), (0.035, 0.035, 1.0), rail)
