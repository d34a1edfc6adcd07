"""What lines a street: pavements, rows of houses, trees, lamps, and small things."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from belie.geometry import SE3
from belie.simulation import materials
from belie.simulation.meshes.builder import Builder
from belie.simulation.meshes.buildings import house
from belie.simulation.meshes.facades import facade_style
from belie.simulation.meshes.furniture import bench, bin_, bollard, street_lamp
from belie.simulation.meshes.plants import bush, tree
from belie.simulation.motion import Path
from belie.simulation.scenes.common import beside
from belie.simulation.scenes.road import strip
from belie.simulation.world import Glow

KERB_UP_M = 0.13
PAVEMENT_M = 4.2
_BINS = ((0.16, 0.30, 0.20), (0.55, 0.30, 0.10), (0.22, 0.24, 0.28))


@dataclass(slots=True)
class Lights:
    """Lamps as they are put up."""

    glows: list[Glow] = field(default_factory=list)
    lamps: list[tuple[float, float, float, float]] = field(default_factory=list)


def pavements(builder: Builder, path: Path, span_m: tuple[float, float], road_half_m: float) -> None:
    """Kerbs and pavements on both sides."""
    k, w = road_half_m, PAVEMENT_M
    kerb, slabs = materials.kerb(), materials.pavement()
    strip(
        builder,
        kerb,
        path,
        span_m,
        [(k, 0.0), (k, KERB_UP_M), (k + 0.16, KERB_UP_M)],
        2.0,
        sky=(0.6, 1.0, 1.0),
    )
    strip(
        builder,
        kerb,
        path,
        span_m,
        [(-k - 0.16, KERB_UP_M), (-k, KERB_UP_M), (-k, 0.0)],
        2.0,
        sky=(1.0, 1.0, 0.6),
    )
    a, b, c = k + 0.16, k + w - 0.9, k + w
    strip(
        builder,
        slabs,
        path,
        span_m,
        [(a, KERB_UP_M), (b, KERB_UP_M), (c, KERB_UP_M)],
        4.0,
        sky=(1.0, 0.97, 0.62),
    )
    strip(
        builder,
        slabs,
        path,
        span_m,
        [(-c, KERB_UP_M), (-b, KERB_UP_M), (-a, KERB_UP_M)],
        4.0,
        sky=(0.62, 0.97, 1.0),
    )


def houses(
    builder: Builder,
    path: Path,
    span_m: tuple[float, float],
    side: float,
    left_m: float,
    rng: np.random.Generator,
) -> None:
    """A row of terraced houses on one side (1: left), now and then with a gap that trees fill."""
    way = span_m[0]
    while way < span_m[1]:
        length = float(rng.uniform(9.0, 19.0))
        style = facade_style(rng)
        if rng.random() < 0.10:  # a yard
            T = beside(path, way + 0.5 * length, side * (left_m + 9.0))
            for _ in range(3):
                place = T.apply(np.array([[rng.uniform(-0.4, 0.4) * length, rng.uniform(-3.0, 5.0), 0.0]]))[0]
                tree(builder, place, float(rng.uniform(7.0, 11.0)), rng)
        else:
            # The facade runs along x and faces -y: on the left that is forwards, on the right it is turned round.
            if side > 0:
                builder.T = beside(path, way, left_m, KERB_UP_M)
            else:
                builder.T = beside(path, way + length, -left_m, KERB_UP_M, np.pi)
            house(builder, style, length, 11.0, rng)
            builder.T = SE3.identity()
        way += length


def closing_house(builder: Builder, path: Path, rng: np.random.Generator) -> None:
    """Houses across the street where it ends, so that the view does not run into the void."""
    for shift in (-24.0, -8.0, 8.0):
        T = beside(path, path.length_m + 24.0, shift)
        R = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        builder.T = SE3(T.R @ R, T.t + T.R @ np.array([0.0, 16.0, 0.0]))
        house(builder, facade_style(rng), 16.0, 11.0, rng)
    builder.T = SE3.identity()


def greenery(
    builder: Builder, path: Path, span_m: tuple[float, float], left_m: float, rng: np.random.Generator
) -> None:
    """Trees in the pavement on both sides."""
    for side in (-1.0, 1.0):
        way = span_m[0] + float(rng.uniform(0.0, 12.0))
        while way < span_m[1]:
            T = beside(path, way, side * left_m, KERB_UP_M)
            if rng.random() < 0.72:
                tree(builder, T.t, float(rng.uniform(4.8, 7.6)), rng)
                corners = T.apply(
                    np.array([[-0.6, -0.6, 0.01], [0.6, -0.6, 0.01], [0.6, 0.6, 0.01], [-0.6, 0.6, 0.01]])
                )
                builder.quad(
                    materials.lawn(),
                    corners,
                    np.array([[0, 0.3], [0.3, 0.3], [0.3, 0], [0, 0]]),
                    (0.75, 0.62, 0.5),
                    0.8,
                )
            elif rng.random() < 0.5:
                bush(builder, T.t, 1.1, rng)
            way += float(rng.uniform(11.0, 19.0))


def lamps(
    builder: Builder,
    lights: Lights,
    path: Path,
    span_m: tuple[float, float],
    left_m: float,
    spacing_m: float = 27.0,
) -> None:
    """Street lamps, alternately left and right."""
    for k, way in enumerate(np.arange(span_m[0] + 9.0, span_m[1], spacing_m)):
        side = 1.0 if k % 2 else -1.0
        T = beside(path, float(way), side * left_m, KERB_UP_M)
        glow, lamp = street_lamp(builder, T.t, -side * T.R[:, 1])
        lights.glows.append(glow)
        lights.lamps.append(lamp)


def clutter(
    builder: Builder, path: Path, span_m: tuple[float, float], road_half_m: float, rng: np.random.Generator
) -> None:
    """Bollards, bins and benches on the pavement."""
    for side in (-1.0, 1.0):
        way = span_m[0] + float(rng.uniform(0.0, 8.0))
        while way < span_m[1]:
            kind = rng.random()
            near, far = road_half_m + 0.5, road_half_m + PAVEMENT_M - 0.7
            if kind < 0.45:
                for k in range(3):
                    builder.T = beside(path, way + 1.6 * k, side * near, KERB_UP_M)
                    bollard(builder)
            elif kind < 0.75:
                builder.T = beside(path, way, side * near, KERB_UP_M)
                bin_(builder, _BINS[int(rng.integers(3))])
            else:
                builder.T = beside(path, way, side * far, KERB_UP_M, np.pi if side > 0 else 0.0)
                bench(builder)
            builder.T = SE3.identity()
            way += float(rng.uniform(9.0, 22.0))
