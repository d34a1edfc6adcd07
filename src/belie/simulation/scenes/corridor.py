"""A corridor indoors for a small robot on wheels: doors, blank walls, clutter; the camera is 0.3 m above the floor."""

from __future__ import annotations

import numpy as np

from belie.geometry import SE3
from belie.simulation import materials
from belie.simulation.meshes.builder import Builder
from belie.simulation.motion import Drive, Parked, Path, Ramp, SpeedProfile, Unrest, walk
from belie.simulation.scenes import traffic
from belie.simulation.scenes.common import centre_line, mount, require_manoeuvre
from belie.simulation.scenes.road import strip
from belie.simulation.textures import signs
from belie.simulation.world import Actor, Colour, Lane, Part, World

MANOEUVRES = ("straight", "curve", "stop-and-go")
_HALF_M, _HEIGHT_M = 1.15, 2.6
_BEHIND_M = 3.0
_SPEED_M_S = 1.1
_BLANK_M = (9.0, 15.0)  # no door, no board here: hard for visual odometry


def build(*, seed: int, manoeuvre: str = "straight", duration_s: float = 20.0) -> World:
    """Build a corridor; ``curve`` weaves through the clutter.

    Raises
    ------
    ValueError
        On an unknown manoeuvre.

    Examples
    --------
    >>> build(seed=1, duration_s=3.0).is_indoors
    True
    """
    require_manoeuvre(manoeuvre, MANOEUVRES)
    length = _BEHIND_M + max(12.0, _SPEED_M_S * duration_s) + 12.0
    ways = np.arange(0.0, length + 1.0, 1.0)
    middle = Path(np.column_stack([ways, np.zeros_like(ways), np.zeros_like(ways)]))
    sway = (
        0.36 * np.sin(2.0 * np.pi * (ways - _BEHIND_M) / 7.5)
        if manoeuvre == "curve"
        else 0.03 * np.sin(ways / 1.7)
    )
    track = Path(np.column_stack([ways, sway, np.zeros_like(ways)]))
    ramps: tuple[Ramp, ...] = ()
    if manoeuvre == "stop-and-go":
        ramps = (
            Ramp(start_s=3.0, duration_s=1.5, change_m_s=-_SPEED_M_S),
            Ramp(start_s=6.5, duration_s=1.5, change_m_s=_SPEED_M_S),
        )
    speed = SpeedProfile(start_m_s=_SPEED_M_S, ramps=ramps)
    builder = Builder()
    _shell(builder, middle, length)
    lamps = _ceiling_lights(builder, length)
    _doors(builder, length, np.random.default_rng([seed, 301]))
    _clutter(builder, length, np.random.default_rng([seed, 302]))
    drive = Drive(path=track, speed=speed, start_m=_BEHIND_M)
    return World(
        static=builder.meshes(),
        actors=_actors(length, seed),
        ego=Unrest(
            drive, seed=seed, heave_m=0.0012, roll_rad=0.003, pitch_rad=0.003, slowest_hz=2.0, fastest_hz=7.0
        ),
        T_body_cam=mount(0.18, 0.0, 0.30),
        lane=Lane(centre_m=centre_line(track, 0.25), half_width_m=0.5, speed_m_s=_SPEED_M_S),
        lamps=np.array(lamps),
        is_indoors=True,
        shadow_reach_m=20.0,
        headlights_m=(0.2, 0.0, 0.35),
    )


def _shell(builder: Builder, path: Path, length: float) -> None:
    span, h, z = (0.0, length), _HALF_M, _HEIGHT_M
    floor = [(-h, 0.0), (-h + 0.3, 0.0), (0.0, 0.0), (h - 0.3, 0.0), (h, 0.0)]
    strip(builder, materials.vinyl(), path, span, floor, 3.0, sky=(0.6, 0.9, 1.0, 0.9, 0.6))
    wall = materials.indoor_wall()
    heights, sky = (0.0, 0.35, 1.3, 2.2, z), (0.6, 0.9, 1.0, 0.95, 0.75)
    for side in (1.0, -1.0):
        order = slice(None) if side > 0 else slice(None, None, -1)
        profile = [(side * h, up) for up in heights][order]
        strip(builder, wall, path, span, profile, 4.0, sky=sky[order], upright=True)
        skirting = [(side * (h - 0.012), 0.0), (side * (h - 0.012), 0.10)][order]
        strip(builder, materials.metal(), path, span, skirting, 1.0, colour=(0.25, 0.27, 0.30), upright=True)
    strip(builder, materials.ceiling(), path, span, [(h, z), (0.0, z), (-h, z)], 2.4, sky=(0.7, 1.0, 0.7))
    corners = [[length, h, 0.0], [length, -h, 0.0], [length, -h, z], [length, h, z]]
    builder.quad(wall, corners, np.array([[0, 0], [0.6, 0], [0.6, -0.65], [0, -0.65]]), sky=0.8)
    builder.tube(
        materials.metal(),
        (0.0, h - 0.14, z - 0.14),
        (length, h - 0.14, z - 0.14),
        (0.055, 0.055),
        (0.75, 0.72, 0.68),
        10,
    )


def _ceiling_lights(builder: Builder, length: float) -> list[tuple[float, float, float, float]]:
    lamps = []
    for x in np.arange(1.2, length, 3.6):
        z = _HEIGHT_M - 0.012
        face = [[x - 0.6, 0.15, z], [x + 0.6, 0.15, z], [x + 0.6, -0.15, z], [x - 0.6, -0.15, z]]
        builder.quad(materials.light_panel(), face)
        lamps.append((float(x), 0.0, 2.4, 0.8))
    return lamps


def _wall_frame(x: float, side: float) -> SE3:
    """Frame on a wall: x runs to the right as one looks at it, z up, -y into the room."""
    turn = 1.0 if side > 0 else -1.0
    R = np.array([[turn, 0.0, 0.0], [0.0, turn, 0.0], [0.0, 0.0, 1.0]])
    return SE3(R, np.array([x, side * _HALF_M, 0.0]))


def _doors(builder: Builder, length: float, rng: np.random.Generator) -> None:
    """Doors with frames, name plates, boards with notices, extinguishers."""
    for side in (-1.0, 1.0):
        x = 1.5 + float(rng.uniform(0.0, 1.5))
        while x < length - 1.5:
            if not _BLANK_M[0] < x < _BLANK_M[1]:
                builder.T = _wall_frame(x, side)
                kind = rng.random()
                if kind < 0.62:
                    door_face(builder, int(rng.integers(101, 140)))
                elif kind < 0.84:
                    _notice_board(builder, rng)
                else:
                    _extinguisher(builder)
                builder.T = SE3.identity()
            x += float(rng.uniform(1.7, 3.4))


def door_face(builder: Builder, number: int) -> None:
    """Add a door with its frame on a wall."""
    w, h = 0.46, 2.06
    builder.quad(
        materials.office_door(number), [[-w, -0.015, 0.0], [w, -0.015, 0.0], [w, -0.015, h], [-w, -0.015, h]]
    )
    frame: Colour = (0.34, 0.36, 0.38)
    for x in (-w - 0.04, w + 0.04):
        builder.box(materials.metal(), (x, -0.025, 0.5 * h), (0.08, 0.09, h), frame)
    builder.box(materials.metal(), (0.0, -0.025, h + 0.03), (2 * w + 0.16, 0.09, 0.08), frame)


def _notice_board(builder: Builder, rng: np.random.Generator) -> None:
    builder.box(materials.bark(), (0.0, -0.015, 1.45), (1.1, 0.03, 0.8), (1.0, 0.72, 0.5))
    for k in range(4):
        x, z = -0.38 + 0.25 * k, 1.45 + float(rng.uniform(-0.14, 0.14))
        paper = [
            [x - 0.1, -0.034, z - 0.14],
            [x + 0.1, -0.034, z - 0.14],
            [x + 0.1, -0.034, z + 0.14],
            [x - 0.1, -0.034, z + 0.14],
        ]
        builder.quad(materials.picture(signs.poster, int(rng.integers(8))), paper)


def _extinguisher(builder: Builder) -> None:
    builder.tube(
        materials.metal(), (0.0, -0.1, 0.55), (0.0, -0.1, 1.0), (0.075, 0.075), (0.75, 0.06, 0.05), 12
    )
    builder.tube(
        materials.metal(), (0.0, -0.1, 1.0), (0.0, -0.1, 1.08), (0.075, 0.02), (0.12, 0.12, 0.12), 12
    )
    sheet = [[-0.1, -0.01, 1.3], [0.1, -0.01, 1.3], [0.1, -0.01, 1.5], [-0.1, -0.01, 1.5]]
    builder.quad(materials.picture(signs.board, "F"), sheet, colour=(1.0, 0.3, 0.3))


def _clutter(builder: Builder, length: float, rng: np.random.Generator) -> None:
    """Boxes, bins and chairs along the walls."""
    x = 2.2
    while x < length - 1.0:
        side = float(rng.choice([-1.0, 1.0]))
        kind = rng.random()
        deep = float(rng.uniform(0.26, 0.42))
        builder.T = SE3(np.eye(3), np.array([x, side * (_HALF_M - 0.5 * deep - 0.04), 0.0]))
        if _BLANK_M[0] < x < _BLANK_M[1] - 1.0:
            pass
        elif kind < 0.55:
            top = 0.0
            for k in range(int(rng.integers(1, 4))):
                size = deep * (1.0 - 0.16 * k)
                tall = float(rng.uniform(0.22, 0.36))
                builder.box(
                    materials.cardboard(int(rng.integers(1, 4))),
                    (0.0, 0.0, top + 0.5 * tall),
                    (size * 1.25, size, tall),
                    sky_below=0.6,
                )
                top += tall
        elif kind < 0.8:
            builder.tube(
                materials.metal(), (0, 0, 0), (0, 0, 0.42), (0.13, 0.16), (0.2, 0.3, 0.42), 14, sky_foot=0.5
            )
        else:
            _chair(builder)
        builder.T = SE3.identity()
        x += float(rng.uniform(1.4, 3.2))


def _chair(builder: Builder) -> None:
    for x in (-0.19, 0.19):
        for y in (-0.17, 0.17):
            builder.tube(
                materials.metal(), (x, y, 0.0), (0.9 * x, 0.9 * y, 0.45), (0.014, 0.014), (0.3, 0.3, 0.32), 6
            )
    builder.box(materials.cloth(), (0.0, 0.0, 0.46), (0.44, 0.40, 0.05), (0.15, 0.28, 0.45))
    builder.box(materials.cloth(), (-0.20, 0.0, 0.74), (0.04, 0.38, 0.34), (0.15, 0.28, 0.45))


def _actors(length: float, seed: int) -> tuple[Actor, ...]:
    """A person who comes along, and the door at the end."""
    cast = traffic.Cast()
    rng = np.random.default_rng([seed, 310])
    left = 0.55 if rng.random() < 0.5 else -0.55
    cast.person(walk([(length - 1.5, left), (-40.0, left)], speed_m_s=0.9), rng)
    builder = Builder()
    builder.T = SE3(np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3))
    door_face(builder, 100)
    T = SE3(np.eye(3), np.array([length, 0.0, 0.0]))
    door = Actor(
        id=len(cast.actors) + 1, label="door", dimensions_m=(0.16, 1.08, 2.13), motion=Parked(T=T),
        parts=(Part(meshes=builder.meshes()),),
    )  # fmt: skip
    return (*cast.actors, door)
