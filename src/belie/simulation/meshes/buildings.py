"""Houses along a street: facades with recessed windows, doors, shops, balconies and cornices; and whole houses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from belie.geometry import SE3
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

_RECESS_M = 0.22
_REVEAL_SKY, _FOOT_SKY = 0.55, 0.62
_TINTS: tuple[Colour, ...] = (
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
    tints = _BRICK_TINTS if kind == "brick" else _TINTS
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


def house(
    builder: Builder, style: FacadeStyle, length_m: float, depth_m: float, rng: np.random.Generator
) -> float:
    """Add a terraced house; its facade runs along x from 0 and faces -y, the house lies behind it in +y.

    Returns its height, metres.
    """
    outside = builder.T
    height = style.ground_floor_m + (style.floors - 1) * style.floor_m
    bays = max(1, round(length_m / style.bay_m))
    width = length_m / bays
    door_bay = int(rng.integers(bays))
    for bay in range(bays):
        x = bay * width
        for floor in range(style.floors):
            z = 0.0 if floor == 0 else style.ground_floor_m + (floor - 1) * style.floor_m
            tall = style.ground_floor_m if floor == 0 else style.floor_m
            if floor == 0:
                _ground_bay(builder, style, x, width, tall, bay == door_bay, rng)
            else:
                _window_bay(builder, style, x, z, width, tall, style.window_m, rng)
                if style.has_balconies and bay % 2 == 1 and floor < style.floors - 1:
                    _balcony(builder, style, x + 0.5 * width, z, min(width * 0.86, 2.4))
    _bands(builder, style, length_m, height)
    _side_walls(builder, style, length_m, depth_m, height)
    _drainpipe(builder, length_m, height)
    builder.T = outside
    return height


def _rectangle(
    builder: Builder,
    material: Material,
    x0: float,
    x1: float,
    z0: float,
    z1: float,
    colour: Colour,
    foot_sky: float = 1.0,
) -> None:
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


def _window_bay(
    builder: Builder,
    style: FacadeStyle,
    x: float,
    z: float,
    width: float,
    tall: float,
    window_m: tuple[float, float],
    rng: np.random.Generator,
) -> None:
    w, h = window_m
    x0, z0 = x + 0.5 * (width - w), z + 0.28 * tall
    x1, z1 = x0 + w, min(z0 + h, z + tall - 0.25)
    foot = 1.0 if z > 0.1 else _FOOT_SKY
    _rectangle(builder, style.wall, x, x + width, z, z0, style.tint, foot)
    _rectangle(builder, style.wall, x, x + width, z1, z + tall, style.tint)
    _rectangle(builder, style.wall, x, x0, z0, z1, style.tint)
    _rectangle(builder, style.wall, x1, x + width, z0, z1, style.tint)
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


def _ground_bay(
    builder: Builder,
    style: FacadeStyle,
    x: float,
    width: float,
    tall: float,
    is_door: bool,
    rng: np.random.Generator,
) -> None:
    if is_door:
        w, h = 1.15, 2.35
        x0 = x + 0.5 * (width - w)
        _rectangle(builder, style.base, x, x0, 0.0, tall, style.tint, _FOOT_SKY)
        _rectangle(builder, style.base, x0 + w, x + width, 0.0, tall, style.tint, _FOOT_SKY)
        _rectangle(builder, style.base, x0, x0 + w, h, tall, style.tint)
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
        _rectangle(builder, style.base, x, x0, 0.0, tall, style.tint, _FOOT_SKY)
        _rectangle(builder, style.base, x0 + w, x + width, 0.0, tall, style.tint, _FOOT_SKY)
        _rectangle(builder, style.base, x0, x0 + w, h, tall, style.tint)
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
        _window_bay(builder, style, x, 0.0, width, tall, (style.window_m[0], style.window_m[1] * 1.05), rng)


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


def _balcony(builder: Builder, style: FacadeStyle, x: float, z: float, width: float) -> None:
    deep = 1.1
    builder.box(materials.kerb(), (x, -0.5 * deep, z + 0.06), (width, deep, 0.16), style.trim, 2.0, 0.45)
    rail: Colour = (0.16, 0.17, 0.19)
    top = z + 1.12
    builder.box(materials.railing(), (x, -deep + 0.03, top), (width, 0.06, 0.05), rail)
    for side in (-1.0, 1.0):
        builder.box(materials.railing(), (x + side * 0.5 * width, -0.5 * deep, top), (0.05, deep, 0.05), rail)
    for post in np.linspace(x - 0.5 * width, x + 0.5 * width, max(5, round(width / 0.22))):
        builder.box(materials.railing(), (float(post), -deep + 0.03, z + 0.6), (0.035, 0.035, 1.0), rail)


def _bands(builder: Builder, style: FacadeStyle, length_m: float, height: float) -> None:
    """String course, cornice and a roof that rises behind it."""
    middle = 0.5 * length_m
    builder.box(
        materials.kerb(),
        (middle, -0.06, style.ground_floor_m - 0.08),
        (length_m, 0.14, 0.22),
        style.trim,
        3.0,
        0.6,
    )
    builder.box(materials.kerb(), (middle, -0.16, height - 0.1), (length_m, 0.42, 0.26), style.trim, 3.0, 0.5)
    builder.box(
        materials.kerb(), (middle, -0.22, height + 0.09), (length_m + 0.1, 0.56, 0.12), style.trim, 3.0, 0.5
    )
    rise, run = 2.4, 3.4
    slope = float(np.hypot(rise, run)) / 3.0
    builder.quad(
        materials.roof_tiles(),
        [
            [0.0, 0.0, height + 0.1],
            [length_m, 0.0, height + 0.1],
            [length_m, run, height + rise],
            [0.0, run, height + rise],
        ],
        [[0.0, slope], [length_m / 3.0, slope], [length_m / 3.0, 0.0], [0.0, 0.0]],
        (0.56, 0.34, 0.27) if style.floors % 2 else (0.38, 0.38, 0.42),
    )
    builder.box(
        materials.wall("brick", 1),
        (0.3 * length_m, 2.6, height + rise),
        (0.9, 0.7, 1.9),
        (0.62, 0.38, 0.30),
        4.0,
    )


def _side_walls(builder: Builder, style: FacadeStyle, length_m: float, depth_m: float, height: float) -> None:
    for x, ends in ((0.0, (depth_m, 0.0)), (length_m, (0.0, depth_m))):
        corners = [[x, ends[0], 0.0], [x, ends[1], 0.0], [x, ends[1], height], [x, ends[0], height]]
        uv = [[y / TILE_M, -z / TILE_M] for _, y, z in corners]
        builder.quad(style.wall, corners, uv, style.tint, [_FOOT_SKY, _FOOT_SKY, 1.0, 1.0])
    # The back closes the house, so that the sun does not shine through it.
    corners = [
        [length_m, depth_m, 0.0],
        [0.0, depth_m, 0.0],
        [0.0, depth_m, height],
        [length_m, depth_m, height],
    ]
    builder.quad(
        style.wall,
        corners,
        np.array([[0.0, 0.0], [length_m, 0.0], [length_m, -height], [0.0, -height]]) / TILE_M,
        style.tint,
    )
    builder.quad(
        style.wall,
        [
            [0, 3.4, height + 2.4],
            [length_m, 3.4, height + 2.4],
            [length_m, depth_m, height],
            [0, depth_m, height],
        ],
        colour=(0.4, 0.4, 0.4),
    )


def _drainpipe(builder: Builder, length_m: float, height: float) -> None:
    builder.tube(
        materials.metal(),
        (length_m - 0.12, -0.12, 0.0),
        (length_m - 0.12, -0.12, height),
        (0.055, 0.055),
        (0.45, 0.47, 0.48),
        6,
    )


def farm_house(
    builder: Builder, size_m: tuple[float, float, float], rng: np.random.Generator, *, is_barn: bool = False
) -> None:
    """Add a free-standing house with a pitched roof, its middle at the origin, its ridge along x."""
    length, width, eaves = size_m
    ridge = eaves + 0.42 * width
    wall = materials.wall("brick" if rng.random() < 0.5 else "plaster", int(rng.integers(1, 3)))
    tint = (0.48, 0.25, 0.19) if is_barn else _TINTS[int(rng.integers(len(_TINTS)))]
    style = FacadeStyle(
        wall=wall, base=wall, tint=tint, trim=(0.9, 0.88, 0.84), bay_m=3.0, floor_m=2.8, ground_floor_m=eaves, floors=1,
        window_m=(1.2, 1.4), window_row=int(rng.integers(WINDOW_ROWS)), has_balconies=False, has_shops=False,
    )  # fmt: skip
    base = builder.T
    half_l, half_w = 0.5 * length, 0.5 * width
    for turn, run, far in (
        (0.0, length, half_w),
        (np.pi, length, half_w),
        (0.5 * np.pi, width, half_l),
        (-0.5 * np.pi, width, half_l),
    ):
        c, s = float(np.cos(turn)), float(np.sin(turn))
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        builder.T = base @ SE3(R, R @ np.array([-0.5 * run, -far, 0.0]))
        bays = max(1, round(run / 3.0))
        for bay in range(bays):
            x, w = bay * run / bays, run / bays
            if is_barn and bay % 2 == 0:
                _rectangle(builder, wall, x, x + w, 0.0, eaves, tint, _FOOT_SKY)
            else:
                _ground_bay(builder, style, x, w, eaves, bay == 0 and turn == 0.0, rng)
        if far == half_l:  # gable
            corners = np.array([[0.0, 0.0, eaves], [run, 0.0, eaves], [0.5 * run, 0.0, ridge]])
            uv = corners[:, [0, 2]] / TILE_M * [1.0, -1.0]
            builder.surface(wall, corners, np.tile([0.0, -1.0, 0.0], (3, 1)), uv, [[0, 1, 2]], tint)
    builder.T = base
    roof: Colour = ((0.60, 0.30, 0.22), (0.40, 0.36, 0.36), (0.52, 0.38, 0.30))[int(rng.integers(3))]
    over, lower = 0.5, eaves - 0.21
    slope = float(np.hypot(half_w + over, ridge - lower)) / 3.0
    span = (length + 2 * over) / 3.0
    for side in (-1.0, 1.0):
        a, b = side * (half_l + over), -side * (half_l + over)
        y = side * (half_w + over)
        face = np.array([[b, -y, lower], [a, -y, lower], [a, 0.0, ridge + 0.05], [b, 0.0, ridge + 0.05]])
        uv = np.array([[0.0, slope], [span, slope], [span, 0.0], [0.0, 0.0]])
        builder.quad(materials.roof_tiles(), face, uv, roof)
    builder.box(
        materials.wall("brick", 1),
        (0.25 * length, 0.12 * width, ridge),
        (0.8, 0.7, 1.6),
        (0.6, 0.36, 0.3),
        4.0,
    )
