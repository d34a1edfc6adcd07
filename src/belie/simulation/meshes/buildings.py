"""Whole houses: terraced along a street, or standing free; their facades are those of `facades`."""

from __future__ import annotations

import numpy as np

from belie.geometry import SE3
from belie.simulation import materials
from belie.simulation.meshes.builder import Builder
from belie.simulation.meshes.facades import (
    FOOT_SKY,
    TINTS,
    FacadeStyle,
    balcony,
    ground_bay,
    rectangle,
    window_bay,
)
from belie.simulation.textures.openings import WINDOW_ROWS
from belie.simulation.textures.walls import TILE_M
from belie.simulation.world import Colour


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
                ground_bay(builder, style, x, width, tall, bay == door_bay, rng)
            else:
                window_bay(builder, style, x, z, width, tall, style.window_m, rng)
                if style.has_balconies and bay % 2 == 1 and floor < style.floors - 1:
                    balcony(builder, style, x + 0.5 * width, z, min(width * 0.86, 2.4))
    _bands(builder, style, length_m, height)
    _side_walls(builder, style, length_m, depth_m, height)
    _drainpipe(builder, length_m, height)
    builder.T = outside
    return height


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
        builder.quad(style.wall, corners, uv, style.tint, [FOOT_SKY, FOOT_SKY, 1.0, 1.0])
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
    tint = (0.48, 0.25, 0.19) if is_barn else TINTS[int(rng.integers(len(TINTS)))]
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
                rectangle(builder, wall, x, x + w, 0.0, eaves, tint, FOOT_SKY)
            else:
                ground_bay(builder, style, x, w, eaves, bay == 0 and turn == 0.0, rng)
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
