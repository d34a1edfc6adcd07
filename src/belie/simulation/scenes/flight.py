"""A drone over fields and farms: six degrees of freedom, few upright things, ground far below."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from belie.geometry import SE3, FloatArray, so3_exp
from belie.simulation import materials
from belie.simulation.meshes.builder import Builder
from belie.simulation.meshes.buildings import farm_house
from belie.simulation.meshes.plants import bush, tree
from belie.simulation.motion import Drive, Motion, Path, SpeedProfile, Unrest, twist_of
from belie.simulation.scenes import traffic
from belie.simulation.scenes.common import centre_line, mount, require_manoeuvre
from belie.simulation.scenes.road import line, strip
from belie.simulation.world import Actor, Glow, Lane, World

MANOEUVRES = ("straight", "curve", "climb")
_SPEED_M_S, _ALTITUDE_M = 9.0, 32.0
_BEHIND_M = 30.0
_ROAD_LEFT_M = -26.0
_GRAVITY_M_S2 = 9.81
_CROPS = ("corn", "wheat", "rape", "soil", "meadow")


def ground_height_m(x_m: float, y_m: float) -> float:
    """Gentle hills.

    >>> abs(ground_height_m(100.0, 50.0)) < 6.0
    True
    """
    return (
        2.4 * math.sin(x_m / 97.0) * math.cos(y_m / 83.0)
        + 1.3 * math.sin(x_m / 41.0 + 1.0) * math.sin(y_m / 53.0)
        + 0.016 * max(0.0, math.hypot(x_m - 300.0, y_m) - 420.0)
    )


class Banked:
    """A motion that leans into its curves, as what flies does: ``tan(bank) = v ω / g``."""

    def __init__(self, base: Drive) -> None:
        self._base = base

    def T_world_body(self, t_s: float) -> SE3:
        """The leaning pose."""
        linear, angular = self._base.twist(t_s)
        bank = -math.atan2(float(linear[0] * angular[2]), _GRAVITY_M_S2)
        return self._base.T_world_body(t_s) @ SE3(so3_exp(np.array([bank, 0.06, 0.0])), np.zeros(3))

    def twist(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Linear and angular velocity in body axes."""
        return twist_of(self.T_world_body, t_s)

    def travelled_m(self, t_s: float) -> float:
        """Way since the start."""
        return self._base.travelled_m(t_s)


def build(*, seed: int, manoeuvre: str = "straight", duration_s: float = 20.0) -> World:
    """Build a landscape and a flight over it.

    Raises
    ------
    ValueError
        On an unknown manoeuvre.

    Examples
    --------
    >>> world = build(seed=1, duration_s=3.0)
    >>> bool(world.ego.T_world_body(0.0).t[2] > 25.0)
    True
    """
    require_manoeuvre(manoeuvre, MANOEUVRES)
    length = _BEHIND_M + max(60.0, _SPEED_M_S * duration_s) + 60.0
    builder = Builder()
    _fields(builder, length, np.random.default_rng([seed, 401]))
    _country_road(builder, length)
    lamps = _farms(builder, length, np.random.default_rng([seed, 402]))
    _trees(builder, length, np.random.default_rng([seed, 403]))
    path = _course(manoeuvre, length)
    drive = Drive(path=path, speed=SpeedProfile(start_m_s=_SPEED_M_S), start_m=_BEHIND_M)
    ego: Motion = Unrest(
        Banked(drive), seed=seed, heave_m=0.06, roll_rad=0.022, pitch_rad=0.020, yaw_rad=0.010, slowest_hz=0.25,
        fastest_hz=1.4, at_rest=True,
    )  # fmt: skip
    return World(
        static=builder.meshes(),
        actors=_actors(length, seed),
        ego=ego,
        T_body_cam=mount(0.12, 0.0, -0.05, pitch_down_deg=32.0),
        lane=Lane(centre_m=centre_line(path, 3.0), half_width_m=8.0, speed_m_s=_SPEED_M_S),
        lamps=np.array(lamps),
        glows=tuple(
            Glow(position_m=(x, y, 6.0), colour=(1.0, 0.8, 0.5), radius_m=1.5) for x, y, _, _ in lamps
        ),
        ground_height_m=ground_height_m,
        has_flat_ground=False,
        shadow_reach_m=150.0,
        headlights_m=(0.2, 0.0, -0.1),
        headlight_power=45.0,
    )


def _course(manoeuvre: str, length: float) -> Path:
    ways = np.arange(0.0, length, 6.0)
    left, up = 3.0 * np.sin(ways / 40.0), 1.5 * np.sin(ways / 29.0)
    if manoeuvre == "curve":
        left = 26.0 * np.sin((ways - _BEHIND_M) / 34.0)
    if manoeuvre == "climb":
        up = 11.0 * (1.0 - np.cos((ways - _BEHIND_M) / 28.0)) - 8.0
    return Path(np.column_stack([ways, left, _ALTITUDE_M + up]))


def _on_ground(points: FloatArray, up_m: float = 0.0) -> FloatArray:
    """Set the height of points (..., 3) to the ground's."""
    flat = points.reshape(-1, 3).copy()
    flat[:, 2] = [ground_height_m(float(x), float(y)) + up_m for x, y, _ in flat]
    return flat.reshape(points.shape)


def _fields(builder: Builder, length: float, rng: np.random.Generator) -> None:
    """A patchwork of fields; far ones are larger and coarser, and together they reach the horizon."""
    xs, ys = _borders(-90.0, length + 500.0, rng), _borders(-330.0, 330.0, rng)
    for x0, x1 in pairwise(xs):
        for y0, y1 in pairwise(ys):
            _field(builder, (x0, x1), (y0, y1), 12.0, rng)
            if abs(y0) < 130.0:
                _border(builder, (x0, x1), (y0, y1), rng)
    far_x, far_y = xs[-1], ys[-1]
    for x in np.arange(-400.0, far_x + 900.0, 180.0):
        for y in np.arange(-1100.0, 1100.0, 180.0):
            # The near patchwork lies a little above these.
            if not (xs[0] <= x and x + 180.0 <= far_x and ys[0] <= y and y + 180.0 <= far_y):
                _field(
                    builder, (float(x), float(x) + 180.0), (float(y), float(y) + 180.0), 60.0, rng, down_m=1.2
                )


def _borders(start: float, stop: float, rng: np.random.Generator) -> list[float]:
    borders = [start]
    while borders[-1] < stop:
        borders.append(borders[-1] + float(rng.uniform(26.0, 62.0)))
    return borders


def _field(
    builder: Builder,
    x: tuple[float, float],
    y: tuple[float, float],
    step: float,
    rng: np.random.Generator,
    down_m: float = 0.0,
) -> None:
    columns, rows = (max(2, math.ceil((b - a) / step) + 1) for a, b in (x, y))
    gx, gy = np.meshgrid(np.linspace(*x, columns), np.linspace(*y, rows))
    points = _on_ground(np.stack([gx, gy, np.zeros_like(gx)], axis=2), -down_m)
    turn = float(rng.choice([0.0, 0.5 * np.pi])) + float(rng.normal(0.0, 0.12))
    c, s = math.cos(turn), math.sin(turn)
    uv = np.stack([c * gx + s * gy, -s * gx + c * gy], axis=2) / 12.0
    shade = float(rng.uniform(0.8, 1.0))
    builder.grid(materials.field(str(rng.choice(_CROPS))), points, uv, (shade, shade, shade))


def _border(
    builder: Builder, x: tuple[float, float], y: tuple[float, float], rng: np.random.Generator
) -> None:
    """What divides a field from its neighbours: a hedge, a row of trees, a track, or nothing; and bales on some."""
    kind = rng.random()
    if kind < 0.30:
        for at in np.arange(x[0], x[1], 2.6):
            place = _on_ground(
                np.array([[at + float(rng.normal(0.0, 0.4)), y[0] + float(rng.normal(0.0, 0.4)), 0.0]])
            )[0]
            if abs(place[1] - _ROAD_LEFT_M) > 16.0:
                bush(builder, place, float(rng.uniform(1.6, 2.6)), rng, sprays=7)
    elif kind < 0.62:
        ends = np.linspace([x[0], y[0], 0.0], [x[0] + float(rng.normal(0.0, 3.0)), y[1], 0.0], 8)
        track = [(-1.5, 0.0), (-0.5, 0.03), (0.5, 0.03), (1.5, 0.0)]
        strip(
            builder,
            materials.field("soil"),
            Path(_on_ground(ends, 0.16)),
            (0.0, y[1] - y[0]),
            track,
            12.0,
            step_m=6.0,
        )
    if rng.random() < 0.30:
        for _ in range(int(rng.integers(4, 12))):
            place = _on_ground(np.array([[rng.uniform(*x), rng.uniform(*y), 0.0]]), 0.6)[0]
            if abs(place[1] - _ROAD_LEFT_M) > 12.0:
                _bale(builder, place, float(rng.uniform(0.0, np.pi)))


def _bale(builder: Builder, place: FloatArray, turn_rad: float) -> None:
    along = 0.65 * np.array([math.cos(turn_rad), math.sin(turn_rad), 0.0])
    straw = materials.field("wheat")
    builder.tube(
        straw, tuple(place - along), tuple(place + along), (0.75, 0.75), (1.0, 0.96, 0.85), 12, (0.4, 0.15)
    )
    for sign in (-1.0, 1.0):
        builder.disc(straw, tuple(place + sign * along), tuple(sign * along / 0.65), 0.75, (0.85, 0.8, 0.7))


def _road_path(length: float) -> Path:
    ways = np.arange(-80.0, length + 300.0, 10.0)
    points = np.column_stack([ways, _ROAD_LEFT_M + 9.0 * np.sin(ways / 75.0), np.zeros_like(ways)])
    return Path(_on_ground(points, 0.22))


def _country_road(builder: Builder, length: float) -> None:
    path = _road_path(length)
    span = (0.0, path.length_m)
    strip(
        builder,
        materials.lawn(),
        path,
        span,
        [(-5.2, -0.5), (-3.0, -0.04), (3.0, -0.04), (5.2, -0.5)],
        4.0,
        step_m=6.0,
    )
    strip(builder, materials.asphalt(), path, span, [(-2.9, 0.0), (0.0, 0.04), (2.9, 0.0)], 6.0, step_m=6.0)
    line(builder, path, span, 0.0, 0.14, dash_m=(4.0, 6.0))


def _farms(
    builder: Builder, length: float, rng: np.random.Generator
) -> list[tuple[float, float, float, float]]:
    """Groups of houses and barns along the road; gives the lamps in their yards."""
    lamps = []
    x = float(rng.uniform(20.0, 45.0))
    while x < length + 260.0:
        side = float(rng.choice([-1.0, 1.0]))
        for k in range(int(rng.integers(2, 6))):
            y = _ROAD_LEFT_M + side * (17.0 + 22.0 * (k // 2)) + float(rng.normal(0.0, 2.5))
            place = _on_ground(np.array([[x + 21.0 * (k % 2) + float(rng.normal(0.0, 2.0)), y, 0.0]]), -0.25)[
                0
            ]
            turn = float(rng.choice([0.0, 0.5 * np.pi])) + float(rng.normal(0.0, 0.1))
            builder.T = SE3(so3_exp(np.array([0.0, 0.0, turn])), place)
            is_barn = rng.random() < 0.35
            size = (
                (16.0, 9.5, 4.2)
                if is_barn
                else (float(rng.uniform(9.0, 13.0)), float(rng.uniform(7.5, 9.0)), 3.4)
            )
            farm_house(builder, size, rng, is_barn=is_barn)
            builder.T = SE3.identity()
        yard = _on_ground(np.array([[x + 10.0, _ROAD_LEFT_M + side * 9.0, 0.0]]), 6.0)[0]
        lamps.append((float(yard[0]), float(yard[1]), 6.0, 1.6))
        x += float(rng.uniform(48.0, 90.0))
    return lamps


def _trees(builder: Builder, length: float, rng: np.random.Generator) -> None:
    """Hedges, single trees, and copses."""
    for _ in range(round(0.8 * (length + 330.0))):
        place = np.array([[rng.uniform(-60.0, length + 330.0), rng.uniform(-150.0, 150.0), 0.0]])
        if abs(place[0, 1] - _ROAD_LEFT_M) < 16.0:
            continue
        foot = _on_ground(place)[0]
        if rng.random() < 0.6:
            tree(builder, foot, float(rng.uniform(5.0, 10.0)), rng, sprays=40)
        else:
            bush(builder, foot, float(rng.uniform(1.2, 2.6)), rng, sprays=12)


def _actors(length: float, seed: int) -> tuple[Actor, ...]:
    """Cars on the country road."""
    cast = traffic.Cast()
    rng = np.random.default_rng([seed, 410])
    road = _road_path(length)
    right = Path(
        np.array(
            [
                (road.frame(float(w)) @ SE3.from_translation([0.0, -1.5, 0.05])).t
                for w in np.linspace(0.0, road.length_m, 60)
            ]
        )
    )
    starts = tuple(float(v) for v in np.arange(60.0, road.length_m, 85.0))
    traffic.ahead(
        cast, right, starts, SpeedProfile(start_m_s=11.0), rng, kinds=("car", "van", "car", "truck")
    )
    return tuple(cast.actors)
