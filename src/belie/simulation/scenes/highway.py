"""A highway at 25 m/s with few near objects: the paper's weak case."""

from __future__ import annotations

import math

import numpy as np

from belie.geometry import SE3
from belie.simulation import materials
from belie.simulation.meshes.builder import Builder
from belie.simulation.meshes.furniture import board
from belie.simulation.meshes.plants import bush, tree
from belie.simulation.motion import Drive, Path, Ramp, SpeedProfile, Unrest
from belie.simulation.scenes import traffic
from belie.simulation.scenes.common import beside, centre_line, mount, offset_path
from belie.simulation.scenes.road import line, strip, wear
from belie.simulation.world import Lane, World

_LANE_M, _HALF_MEDIAN_M = 3.75, 2.0
_SPEED_M_S = 25.0
_BEHIND_M = 40.0


def build(*, seed: int, duration_s: float = 20.0) -> World:
    """Two carriageways of two lanes with hard shoulders and guard rails, between fields and woods."""
    length = _BEHIND_M + max(120.0, _SPEED_M_S * duration_s) + 700.0
    ways = np.arange(0.0, length, 20.0)
    path = Path(np.column_stack([ways, 18.0 * (1.0 - np.cos(np.pi * ways / 900.0)), np.zeros_like(ways)]))
    builder = Builder()
    _carriageways(builder, path, np.random.default_rng([seed, 201]))
    _verges(builder, path, np.random.default_rng([seed, 202]))
    right_lane = offset_path(path, -_HALF_MEDIAN_M - 0.9 - 1.5 * _LANE_M, 10.0)
    ramps = (
        Ramp(start_s=3.0, duration_s=4.0, change_m_s=1.5),
        Ramp(start_s=9.0, duration_s=5.0, change_m_s=-2.0),
    )
    speed = SpeedProfile(start_m_s=_SPEED_M_S, ramps=ramps)
    cast = _cast(path, right_lane, speed, seed)
    return World(
        static=builder.meshes(),
        actors=tuple(cast.actors),
        ego=Unrest(Drive(path=right_lane, speed=speed, start_m=_BEHIND_M), seed=seed, slowest_hz=0.8),
        T_body_cam=mount(1.75, 0.0, 1.45, pitch_down_deg=1.5),
        lane=Lane(centre_m=centre_line(right_lane, 2.0), half_width_m=0.5 * _LANE_M, speed_m_s=_SPEED_M_S),
        lamps=np.zeros((0, 4)),
    )


def _carriageways(builder: Builder, path: Path, rng: np.random.Generator) -> None:
    span = (0.0, path.length_m)
    inner = _HALF_MEDIAN_M
    outer = inner + 0.9 + 2 * _LANE_M + 2.6
    for side in (-1.0, 1.0):
        a, b = sorted((side * inner, side * outer))
        strip(
            builder,
            materials.asphalt(),
            path,
            span,
            [(a, 0.0), (0.5 * (a + b), 0.0), (b, 0.0)],
            6.0,
            step_m=8.0,
        )
        line(builder, path, span, side * (inner + 0.75), 0.2)
        line(builder, path, span, side * (inner + 0.9 + _LANE_M), 0.15, dash_m=(6.0, 12.0))
        line(builder, path, span, side * (inner + 0.9 + 2 * _LANE_M), 0.28)
        _guard_rail(builder, path, span, side * (inner - 0.5))
        _guard_rail(builder, path, span, side * (outer + 0.7))
    strip(
        builder, materials.lawn(), path, span, [(-inner, -0.02), (0.0, 0.03), (inner, -0.02)], 4.0, step_m=8.0
    )
    wear(builder, path, (0.0, min(path.length_m, 900.0)), outer, rng)


def _guard_rail(builder: Builder, path: Path, span: tuple[float, float], left: float) -> None:
    steel = (0.62, 0.64, 0.66)
    for lean in (0.03, -0.03):
        profile = [(left + lean, 0.45), (left - lean, 0.60), (left + lean, 0.75)]
        strip(
            builder,
            materials.metal(),
            path,
            span,
            profile if lean > 0 else profile[::-1],
            1.0,
            colour=steel,
            step_m=8.0,
        )
    for way in np.arange(span[0], span[1], 4.0):
        foot = beside(path, float(way), left).t
        builder.box(materials.metal(), (*foot[:2].tolist(), 0.35), (0.10, 0.06, 0.7), (0.45, 0.46, 0.48))


def _verges(builder: Builder, path: Path, rng: np.random.Generator) -> None:
    """Grass, fields, woods, and boards over the road."""
    span = (0.0, path.length_m)
    edge = _HALF_MEDIAN_M + 0.9 + 2 * _LANE_M + 2.6
    for side in (-1.0, 1.0):
        near = [(side * edge, -0.02), (side * (edge + 4.0), -0.6), (side * (edge + 16.0), -0.5)]
        strip(builder, materials.lawn(), path, span, near if side > 0 else near[::-1], 4.0, step_m=8.0)
        way = 0.0
        while way < path.length_m:
            length = float(rng.uniform(90.0, 220.0))
            kind = str(rng.choice(["corn", "wheat", "rape", "soil", "meadow"]))
            far = [(side * (edge + 16.0), -0.5), (side * (edge + 70.0), 0.3), (side * 420.0, 6.0)]
            stop = min(way + length, path.length_m)
            strip(
                builder,
                materials.field(kind),
                path,
                (way, stop),
                far if side > 0 else far[::-1],
                12.0,
                step_m=30.0,
            )
            way += length
        way = float(rng.uniform(0.0, 30.0))
        while way < path.length_m:
            left = side * (
                edge
                + float(rng.choice([6.0, 14.0, 22.0, 60.0], p=[0.2, 0.3, 0.3, 0.2]))
                + float(rng.uniform(0, 5))
            )
            place = beside(path, way, left, -0.5).t
            if rng.random() < 0.7:
                tree(builder, place, float(rng.uniform(6.0, 13.0)), rng)
            else:
                bush(builder, place, float(rng.uniform(1.0, 2.4)), rng)
            way += float(rng.exponential(16.0)) + 3.0
    for k, way in enumerate(np.arange(110.0, path.length_m, 260.0)):
        T = beside(path, float(way), -edge - 3.2)
        builder.T = SE3(T.R, T.t)
        board(builder, ("NORD 12", "HAFEN", "MITTE 3", "EXIT 24")[k % 4], 4.6, 3.4)
        builder.T = SE3.identity()


def _cast(path: Path, right_lane: Path, speed: SpeedProfile, seed: int) -> traffic.Cast:
    cast = traffic.Cast()
    rng = np.random.default_rng([seed, 210])
    traffic.ahead(cast, right_lane, (_BEHIND_M + 48.0, _BEHIND_M + 130.0), speed, rng, kinds=("truck", "car"))
    left_lane = offset_path(path, -_HALF_MEDIAN_M - 0.9 - 0.5 * _LANE_M, 10.0)
    faster = SpeedProfile(start_m_s=29.0)
    traffic.ahead(cast, left_lane, (_BEHIND_M - 22.0, _BEHIND_M + 70.0), faster, rng, kinds=("car", "van"))
    traffic.oncoming(
        cast, path, _HALF_MEDIAN_M + 0.9 + 1.5 * _LANE_M, 24.0, 120.0, np.random.default_rng([seed, 211])
    )
    edge = _HALF_MEDIAN_M + 0.9 + 2 * _LANE_M + 2.6
    for way in np.arange(90.0, path.length_m, 300.0):
        cast.sign("80", beside(path, float(way), -edge - 1.4, -0.1, math.pi))
    return cast
