"""A city street: houses, parked and moving vehicles, people, trees, signs; and, as a manoeuvre, a highway."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from belie.simulation import materials
from belie.simulation.meshes.builder import Builder
from belie.simulation.motion import Drive, Path, Ramp, SpeedProfile, Unrest
from belie.simulation.scenes import highway, roadside, traffic
from belie.simulation.scenes.common import (
    beside,
    centre_line,
    mount,
    offset_path,
    require_manoeuvre,
    smooth_step,
)
from belie.simulation.scenes.road import crossing, line, strip, wear
from belie.simulation.world import Lane, World

MANOEUVRES = ("straight", "curve", "lane-change", "stop-and-go", "narrow", "highway")
_BEHIND_M = 30.0  # of street behind the start
_CAMERA = mount(1.75, 0.0, 1.45, pitch_down_deg=1.5)


_HALF_PARKED = traffic.Parking()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Section:
    """A street across: lanes in each direction, and what is parked along the kerbs."""

    lanes: int = 1
    lane_m: float = 3.5
    parking_m: float = 2.3
    parked: traffic.Parking = _HALF_PARKED

    @property
    def road_half_m(self) -> float:
        """From the middle to the kerb."""
        return self.lanes * self.lane_m + self.parking_m


_SECTIONS = {
    "lane-change": _Section(lanes=2),
    # A residential street with 30 km/h: 5.5 m for both directions between two full rows of parked cars.
    "narrow": _Section(
        lane_m=2.75,
        parking_m=2.1,
        parked=traffic.Parking(kinds=("car", "van"), shares=(0.85, 0.15), taken=0.96, gaps_m=(0.7, 1.5)),
    ),
}


def build(*, seed: int, manoeuvre: str = "straight", duration_s: float = 20.0) -> World:
    """Build a street that is long enough for a drive of a duration; one seed gives one street, however long.

    Raises
    ------
    ValueError
        On an unknown manoeuvre.

    Examples
    --------
    >>> world = build(seed=1, duration_s=4.0)
    >>> world.lane.half_width_m, world.lane.speed_m_s
    (1.75, 9.5)
    """
    require_manoeuvre(manoeuvre, MANOEUVRES)
    if manoeuvre == "highway":
        return highway.build(seed=seed, duration_s=duration_s)
    speed = _speed(manoeuvre)
    length = _BEHIND_M + max(40.0, speed.start_m_s * duration_s) + 160.0
    path = _course(manoeuvre, length)
    section = _SECTIONS.get(manoeuvre, _Section())
    road_half = section.road_half_m
    builder, lights = Builder(), roadside.Lights()
    _road(builder, path, section, seed)
    _sides(builder, lights, path, road_half, seed)
    lane = offset_path(path, -(section.lanes - 0.5) * section.lane_m)
    shift = _lane_change if manoeuvre == "lane-change" else None
    drive = Drive(path=lane, speed=speed, start_m=_BEHIND_M, shift=shift)
    cast = _cast(path, lane, manoeuvre, speed, section, seed)
    return World(
        static=builder.meshes(),
        actors=tuple(cast.actors),
        ego=Unrest(drive, seed=seed),
        T_body_cam=_CAMERA,
        lane=Lane(centre_m=centre_line(lane), half_width_m=0.5 * section.lane_m, speed_m_s=speed.start_m_s),
        glows=tuple(lights.glows),
        lamps=np.array(lights.lamps),
    )


def _speed(manoeuvre: str) -> SpeedProfile:
    if manoeuvre == "stop-and-go":
        stops = (
            Ramp(start_s=2.0, duration_s=5.0, change_m_s=-9.0),
            Ramp(start_s=9.5, duration_s=5.0, change_m_s=8.0),
        )
        return SpeedProfile(start_m_s=9.0, ramps=stops)
    if manoeuvre == "narrow":
        return SpeedProfile(start_m_s=8.5)
    gentle = (
        Ramp(start_s=3.0, duration_s=3.0, change_m_s=1.2),
        Ramp(start_s=8.0, duration_s=4.0, change_m_s=-1.6),
    )
    return SpeedProfile(start_m_s=9.5 if manoeuvre != "curve" else 8.5, ramps=gentle)


def _course(manoeuvre: str, length_m: float) -> Path:
    """The middle of the street. A curve bends left, then right, with radii of about 70 m."""
    ways = np.arange(0.0, length_m + 4.0, 4.0)
    if manoeuvre != "curve":
        return Path(np.column_stack([ways, np.zeros_like(ways), np.zeros_like(ways)]))
    fine = np.arange(0.0, length_m + 4.0, 0.25)
    bend = np.zeros_like(fine)
    start, sign = _BEHIND_M + 22.0, 1.0
    while start < length_m:
        along = np.clip((fine - start) / 78.0, 0.0, 1.0)
        bend += sign * np.sin(np.pi * along) ** 2 / 62.0
        start, sign = start + 88.0, -sign
    heading = np.cumsum(bend) * 0.25
    x, y = np.cumsum(np.cos(heading)) * 0.25, np.cumsum(np.sin(heading)) * 0.25
    points = np.column_stack([x, y, np.zeros_like(x)])[::16]
    return Path(points)


def _lane_change(t_s: float) -> float:
    """To the left lane and back."""
    return _SECTIONS["lane-change"].lane_m * (smooth_step((t_s - 2.0) / 4.0) - smooth_step((t_s - 9.0) / 4.0))


def _road(builder: Builder, path: Path, section: _Section, seed: int) -> None:
    rng = np.random.default_rng([seed, 101])
    span = (0.0, path.length_m + 12.0)
    road_half, lane_m = section.road_half_m, section.lane_m
    h, lane_edge = road_half, section.lanes * lane_m
    profile = [(-h, 0.0), (-h + 0.6, 0.0), (0.0, 0.0), (h - 0.6, 0.0), (h, 0.0)]
    strip(builder, materials.asphalt(), path, span, profile, 6.0, sky=(0.72, 1.0, 1.0, 1.0, 0.72))
    line(builder, path, span, 0.0, 0.14, dash_m=(3.0, 5.0))
    for side in (-1.0, 1.0):
        line(builder, path, span, side * lane_edge, 0.12)
        for k in range(1, section.lanes):
            line(builder, path, span, side * k * lane_m, 0.12, dash_m=(3.0, 6.0))
    wear(builder, path, span, road_half, rng)
    crossing(builder, path, _BEHIND_M + 71.0, road_half)
    corners = [
        [-400.0, -900.0, -0.15],
        [2400.0, -900.0, -0.15],
        [2400.0, 900.0, -0.15],
        [-400.0, 900.0, -0.15],
    ]
    builder.quad(
        materials.lawn(), corners, np.array([[0, 450], [700, 450], [700, 0], [0, 0]]), (0.8, 0.8, 0.75)
    )


def _sides(builder: Builder, lights: roadside.Lights, path: Path, road_half: float, seed: int) -> None:
    span = (0.0, path.length_m + 6.0)
    roadside.pavements(builder, path, span, road_half)
    for k, side in enumerate((-1.0, 1.0)):
        rng = np.random.default_rng([seed, 102, k])
        roadside.houses(builder, path, span, side, road_half + roadside.PAVEMENT_M, rng)
    roadside.closing_house(builder, path, np.random.default_rng([seed, 104]))
    roadside.greenery(builder, path, span, road_half + 0.95, np.random.default_rng([seed, 105]))
    roadside.lamps(builder, lights, path, span, road_half + 0.45)
    roadside.clutter(builder, path, span, road_half, np.random.default_rng([seed, 106]))


def _cast(
    path: Path, lane: Path, manoeuvre: str, speed: SpeedProfile, section: _Section, seed: int
) -> traffic.Cast:
    road_half = section.road_half_m
    cast = traffic.Cast()
    rng = np.random.default_rng([seed, 110])
    span = (4.0, path.length_m)
    first_gap = 19.0 + float(rng.uniform(0.0, 8.0))
    kinds = tuple(rng.permutation(["car", "van", "car", "bus", "truck"]).tolist())
    traffic.ahead(cast, lane, (_BEHIND_M + first_gap, _BEHIND_M + first_gap + 26.0), speed, rng, kinds=kinds)
    traffic.oncoming(cast, path, 0.5 * section.lane_m, 9.0, 48.0, np.random.default_rng([seed, 111]))
    for k, side in enumerate((-1.0, 1.0)):
        parked = np.random.default_rng([seed, 112, k])
        left_m = side * (road_half - 0.5 * section.parking_m)
        traffic.parked_row(cast, path, span, left_m, parked, section.parked)
    traffic.walkers(cast, path, span, road_half + 2.2, np.random.default_rng([seed, 114]))
    _signs(cast, path, road_half, manoeuvre, np.random.default_rng([seed, 115]))
    return cast


def _signs(
    cast: traffic.Cast, path: Path, road_half: float, manoeuvre: str, rng: np.random.Generator
) -> None:
    """Signs on the right that face the robot; at ``stop-and-go`` a traffic light where it stops."""
    way = _BEHIND_M + 16.0
    k = 0
    while way < path.length_m:
        kind = ("stop", "30", "50", "stop")[k % 4]
        cast.sign(kind, beside(path, way, -road_half - 0.55, roadside.KERB_UP_M, math.pi))
        way += float(rng.uniform(30.0, 52.0))
        k += 1
    light_way = _BEHIND_M + (66.0 if manoeuvre == "stop-and-go" else 84.0)
    cycle: tuple[tuple[str, tuple[float, float]], ...] = (("green", (-1.0, 1e9)),)
    if manoeuvre == "stop-and-go":
        cycle = (("red", (-1.0, 9.0)), ("amber", (9.0, 10.0)), ("green", (10.0, 1e9)))
    for left in (-road_half - 0.7, road_half + 0.7):
        cast.traffic_light(beside(path, light_way, left, roadside.KERB_UP_M, math.pi), cycle)
