"""Those who have an identity on a street: vehicles, people, signs and traffic lights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from belie.geometry import SE3
from belie.simulation.meshes.furniture import (
    LIGHT_BASE_M,
    LIGHT_DIMENSIONS_M,
    SIGN_BASE_M,
    SIGN_DIMENSIONS_M,
    sign_parts,
    traffic_light_parts,
)
from belie.simulation.meshes.people import HEIGHT_M, person_parts
from belie.simulation.meshes.vehicle_bodies import BODIES, PAINTS
from belie.simulation.meshes.vehicles import brake_lamps, vehicle_glows, vehicle_parts
from belie.simulation.motion import Drive, Motion, Parked, Path, SpeedProfile
from belie.simulation.scenes.common import beside
from belie.simulation.scenes.roadside import KERB_UP_M
from belie.simulation.world import Actor

_MOVING_KINDS, _MOVING_SHARES = ("car", "van", "truck", "bus"), (0.62, 0.16, 0.12, 0.10)


@dataclass(frozen=True, slots=True, kw_only=True)
class Parking:
    """A row of parked vehicles: classes and their shares, the share of places taken, and the gaps between places."""

    kinds: tuple[str, ...] = ("car", "van", "truck")
    shares: tuple[float, ...] = (0.80, 0.16, 0.04)
    taken: float = 0.62
    gaps_m: tuple[float, float] = (0.9, 3.4)


class Cast:
    """Gathers actors and numbers them.

    >>> cast = Cast()
    >>> cast.vehicle("car", Parked(T=SE3.identity()), np.random.default_rng(1))
    >>> [(actor.id, actor.label) for actor in cast.actors]
    [(1, 'car')]
    """

    def __init__(self) -> None:
        self.actors: list[Actor] = []

    def vehicle(
        self,
        kind: str,
        motion: Motion,
        rng: np.random.Generator,
        *,
        brakes_s: tuple[tuple[float, float], ...] = (),
        lights: bool = True,
    ) -> None:
        """Add a vehicle of a class."""
        paint = PAINTS[int(rng.integers(len(PAINTS)))]
        parts = vehicle_parts(kind, paint, int(rng.integers(6)), rolls=not isinstance(motion, Parked))
        if brakes_s:
            parts = (*parts, brake_lamps(kind, brakes_s))
        glows = vehicle_glows(kind) if lights else ()
        self.actors.append(
            Actor(
                id=self._next_id,
                label=kind,
                dimensions_m=BODIES[kind].dimensions_m,
                motion=motion,
                parts=parts,
                glows=glows,
            )
        )

    def person(self, motion: Motion, rng: np.random.Generator) -> None:
        """Add a person."""
        parts = person_parts(int(rng.integers(24)))
        dimensions_m = (0.62, 0.58, HEIGHT_M + 0.03)
        self.actors.append(
            Actor(id=self._next_id, label="pedestrian", dimensions_m=dimensions_m, motion=motion, parts=parts)
        )

    def sign(self, kind: str, T: SE3, *, patched: bool = False) -> None:
        """Add a traffic sign that faces x of its frame: ``stop`` or a speed limit."""
        size = "stop" if kind == "stop" else "speed"
        self.actors.append(
            Actor(
                id=self._next_id,
                label=f"{size} sign",
                dimensions_m=SIGN_DIMENSIONS_M[size],
                base_m=SIGN_BASE_M[size],
                motion=Parked(T=T),
                parts=sign_parts(kind, patched=patched),
                is_patched=patched,
            )
        )

    def traffic_light(self, T: SE3, cycle: tuple[tuple[str, tuple[float, float]], ...]) -> None:
        """Add a traffic light that faces x of its frame."""
        self.actors.append(
            Actor(
                id=self._next_id,
                label="traffic light",
                dimensions_m=LIGHT_DIMENSIONS_M,
                base_m=LIGHT_BASE_M,
                motion=Parked(T=T),
                parts=traffic_light_parts(cycle),
            )
        )

    @property
    def _next_id(self) -> int:
        return len(self.actors) + 1


def parked_row(
    cast: Cast,
    path: Path,
    span_m: tuple[float, float],
    left_m: float,
    rng: np.random.Generator,
    parking: Parking | None = None,
) -> None:
    """Vehicles parked along a kerb; on the left they face the other way."""
    parking = parking or Parking()
    way = span_m[0]
    while way < span_m[1]:
        kind = str(rng.choice(parking.kinds, p=parking.shares))
        length = BODIES[kind].length_m
        if rng.random() < parking.taken:
            turn = float(rng.normal(0.0, 0.012)) + (np.pi if left_m > 0 else 0.0)
            T = beside(path, way + 0.5 * length, left_m + float(rng.normal(0.0, 0.06)), 0.0, turn)
            cast.vehicle(kind, Parked(T=T), rng, lights=False)
        way += length + float(rng.uniform(*parking.gaps_m))


def oncoming(
    cast: Cast, path: Path, left_m: float, speed_m_s: float, spacing_m: float, rng: np.random.Generator
) -> None:
    """Traffic towards the robot on the left side."""
    back = Path(
        np.array([T.t for T in (beside(path, float(w), left_m) for w in np.linspace(path.length_m, 0.0, 80))])
    )
    way = float(rng.uniform(0.55, 0.8)) * spacing_m
    while way < path.length_m:
        kind = str(rng.choice(_MOVING_KINDS, p=_MOVING_SHARES))
        speed = SpeedProfile(start_m_s=speed_m_s)
        cast.vehicle(kind, Drive(path=back, speed=speed, start_m=way), rng)
        way += float(rng.uniform(0.6, 1.5)) * spacing_m


def ahead(
    cast: Cast,
    lane: Path,
    starts_m: tuple[float, ...],
    speed: SpeedProfile,
    rng: np.random.Generator,
    *,
    kinds: tuple[str, ...] = _MOVING_KINDS,
) -> None:
    """Traffic that drives before the robot with the same profile of speed; it shows when it brakes."""
    braking = tuple(
        (ramp.start_s, ramp.start_s + ramp.duration_s) for ramp in speed.ramps if ramp.change_m_s < -1.0
    )
    for k, start in enumerate(starts_m):
        cast.vehicle(
            kinds[k % len(kinds)], Drive(path=lane, speed=speed, start_m=start), rng, brakes_s=braking
        )


def walkers(
    cast: Cast, path: Path, span_m: tuple[float, float], left_m: float, rng: np.random.Generator
) -> None:
    """People on both pavements, in both directions."""
    for side in (-1.0, 1.0):
        tracks = [_pavement_track(path, side * (left_m + shift)) for shift in (-0.7, 0.0, 0.7)]
        way = span_m[0] + float(rng.uniform(0.0, 15.0))
        while way < span_m[1]:
            there, back = tracks[int(rng.integers(len(tracks)))]
            speed = SpeedProfile(start_m_s=float(rng.uniform(1.1, 1.6)))
            forth = rng.random() < 0.5
            start = way if forth else back.length_m - way
            cast.person(Drive(path=there if forth else back, speed=speed, start_m=start), rng)
            way += float(rng.uniform(10.0, 34.0))


def _pavement_track(path: Path, left_m: float) -> tuple[Path, Path]:
    """The way along a pavement, forth and back."""
    ways = np.linspace(0.0, path.length_m, 60)
    points = np.array([beside(path, float(way), left_m, KERB_UP_M).t for way in ways])
    return Path(points), Path(points[::-1])
