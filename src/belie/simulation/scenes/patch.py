"""The paper's real-world case: a printed adversarial patch on a door and on a stop sign, in a yard."""

from __future__ import annotations

import math

import numpy as np

from belie.geometry import SE3
from belie.simulation import materials
from belie.simulation.meshes.builder import Builder
from belie.simulation.meshes.buildings import house
from belie.simulation.meshes.facades import facade_style
from belie.simulation.meshes.furniture import bench, bin_, bollard
from belie.simulation.meshes.plants import bush, tree
from belie.simulation.motion import Drive, Parked, Path, Ramp, SpeedProfile, Unrest
from belie.simulation.scenes import roadside, traffic
from belie.simulation.scenes.common import beside, centre_line, mount, require_manoeuvre
from belie.simulation.scenes.corridor import door_face
from belie.simulation.scenes.road import strip, wear
from belie.simulation.textures import signs
from belie.simulation.world import Actor, Lane, Part, World

MANOEUVRES = ("straight", "curve", "stop-and-go")
_HALF_M, _SPEED_M_S, _BEHIND_M = 7.0, 1.3, 8.0
_DOOR_AHEAD_M = 11.0  # of where the drive ends


def build(
    *, seed: int, manoeuvre: str = "straight", duration_s: float = 15.0, is_patched: bool = True
) -> World:
    """Build a yard with a stop sign on the right and, at its end, a door; both bear a patch.

    Parameters
    ----------
    seed : int
        Of the yard.
    manoeuvre : str
        One of `MANOEUVRES`.
    duration_s : float
        The yard is as long as a drive of this duration needs.
    is_patched : bool
        Whether the patches are there.

    Raises
    ------
    ValueError
        On an unknown manoeuvre.

    Examples
    --------
    >>> [actor.label for actor in build(seed=1, duration_s=4.0).actors if actor.is_patched]
    ['stop sign', 'door']
    """
    require_manoeuvre(manoeuvre, MANOEUVRES)
    length = _BEHIND_M + max(8.0, _SPEED_M_S * duration_s) + _DOOR_AHEAD_M
    ways = np.arange(0.0, length + 1.0, 1.0)
    middle = Path(np.column_stack([ways, np.zeros_like(ways), np.zeros_like(ways)]))
    sway = (1.1 if manoeuvre == "curve" else 0.06) * np.sin(2.0 * np.pi * (ways - _BEHIND_M) / 15.0)
    track = Path(np.column_stack([ways, sway, np.zeros_like(ways)]))
    builder, rng = Builder(), np.random.default_rng([seed, 501])
    _yard(builder, middle, length, rng)
    ramps: tuple[Ramp, ...] = ()
    if manoeuvre == "stop-and-go":
        ramps = (
            Ramp(start_s=4.0, duration_s=1.5, change_m_s=-_SPEED_M_S),
            Ramp(start_s=7.5, duration_s=1.5, change_m_s=_SPEED_M_S),
        )
    drive = Drive(path=track, speed=SpeedProfile(start_m_s=_SPEED_M_S, ramps=ramps), start_m=_BEHIND_M)
    return World(
        static=builder.meshes(),
        actors=_actors(middle, length, seed, is_patched),
        ego=Unrest(
            drive, seed=seed, heave_m=0.003, roll_rad=0.006, pitch_rad=0.006, slowest_hz=1.0, fastest_hz=5.0
        ),
        T_body_cam=mount(0.25, 0.0, 0.55, pitch_down_deg=-2.0),
        lane=Lane(centre_m=centre_line(track, 0.5), half_width_m=1.0, speed_m_s=_SPEED_M_S),
        lamps=np.array([[length - 3.0, 3.0, 4.5, 0.9], [0.45 * length, -6.5, 4.5, 0.9]]),
        shadow_reach_m=50.0,
        headlights_m=(0.3, 0.0, 0.5),
    )


def _yard(builder: Builder, path: Path, length: float, rng: np.random.Generator) -> None:
    span = (0.0, length)
    paved = [(-_HALF_M, 0.0), (-_HALF_M + 0.8, 0.0), (0.0, 0.0), (_HALF_M - 0.8, 0.0), (_HALF_M, 0.0)]
    strip(builder, materials.pavement(), path, span, paved, 4.0, sky=(0.65, 1.0, 1.0, 1.0, 0.65))
    wear(builder, path, span, 0.6 * _HALF_M, rng)
    for side in (-1.0, 1.0):
        roadside.houses(builder, path, (-6.0, length - 4.0), side, _HALF_M, rng)
    for shift in (-11.0, 1.0):  # the house at the end, facing the robot
        R = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        builder.T = SE3(R, np.array([length, shift + 11.5, 0.0]))
        house(builder, facade_style(rng, most_floors=4), 12.0, 9.0, rng)
    for k, x in enumerate(np.arange(9.0, length - 3.0, 4.6)):
        side = 1.0 if k % 2 else -1.0
        place = beside(path, float(x), side * (_HALF_M - 1.6 + float(rng.uniform(-0.3, 0.3))))
        builder.T = place
        kind = rng.random()
        if kind < 0.25:
            bench(builder)
        elif kind < 0.45:
            bin_(builder, (0.2, 0.3, 0.24))
        elif kind < 0.6:
            bollard(builder)
        builder.T = SE3.identity()
        if 0.6 <= kind < 0.85:
            bush(builder, place.t, 1.0, rng)
        elif kind >= 0.85:
            tree(builder, place.t, 4.6, rng)


def _actors(path: Path, length: float, seed: int, is_patched: bool) -> tuple[Actor, ...]:
    cast = traffic.Cast()
    rng = np.random.default_rng([seed, 510])
    cast.sign("stop", beside(path, length - 13.0, -3.1, 0.0, math.pi), patched=is_patched)
    cast.vehicle("car", Parked(T=beside(path, length - 4.2, 4.6, 0.0, 0.5 * math.pi)), rng, lights=False)
    cast.person(
        Drive(
            path=Path(np.linspace([length - 3.0, 1.9, 0.0], [-60.0, 2.6, 0.0], 12)),
            speed=SpeedProfile(start_m_s=0.8),
        ),
        rng,
    )
    builder = Builder()
    builder.T = SE3(np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3))
    door_face(builder, 102)
    if is_patched:
        sheet = [[-0.28, -0.022, 1.05], [0.28, -0.022, 1.05], [0.28, -0.022, 1.61], [-0.28, -0.022, 1.61]]
        builder.quad(materials.picture(signs.adversarial_patch, 5), sheet)
    door = Actor(
        id=len(cast.actors) + 1, label="door", dimensions_m=(0.16, 1.08, 2.13),
        motion=Parked(T=SE3.from_translation([length - 0.22, -1.2, 0.0])), parts=(Part(meshes=builder.meshes()),),
        is_patched=is_patched,
    )  # fmt: skip
    return (*cast.actors, door)
