"""What stands along streets: lamps, signs, traffic lights, benches, bins, bollards."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from belie.geometry import FloatArray
from belie.simulation import materials
from belie.simulation.meshes.builder import Builder
from belie.simulation.textures import signs
from belie.simulation.world import Colour, Glow, Part

_STEEL: Colour = (0.46, 0.48, 0.50)
_DARK: Colour = (0.10, 0.11, 0.12)
LAMP_HEIGHT_M = 6.2


def street_lamp(
    builder: Builder, foot: FloatArray, towards: FloatArray
) -> tuple[Glow, tuple[float, float, float, float]]:
    """Add a lamp whose arm reaches towards the road (unit vector, shape (3,)); gives its glow and its light."""
    base, knee, top = foot, foot + np.array([0.0, 0.0, 1.0]), foot + np.array([0.0, 0.0, LAMP_HEIGHT_M])
    builder.tube(materials.metal(), tuple(base), tuple(knee), (0.11, 0.10), _DARK, 8, sky_foot=0.5)
    builder.tube(materials.metal(), tuple(knee), tuple(top), (0.075, 0.05), _DARK, 8)
    head = top + 1.3 * towards + [0.0, 0.0, 0.15]
    builder.tube(materials.metal(), tuple(top), tuple(head), (0.05, 0.04), _DARK, 6)
    builder.box(materials.metal(), (*head[:2].tolist(), float(head[2]) + 0.05), (0.55, 0.55, 0.10), _DARK)
    builder.box(
        materials.lamp((0.90, 0.86, 0.74), 1.0),
        (*head[:2].tolist(), float(head[2]) - 0.03),
        (0.42, 0.42, 0.06),
    )
    x, y, z = (float(v) for v in head)
    return Glow(position_m=(x, y, z - 0.1), colour=(1.0, 0.80, 0.48), radius_m=1.5), (x, y, z, 1.0)


def _post(x_m: float, height_m: float, radii_m: tuple[float, float], colour: Colour) -> Part:
    builder = Builder()
    builder.tube(materials.metal(), (x_m, 0.0, 0.0), (x_m, 0.0, height_m), radii_m, colour, 8, sky_foot=0.5)
    return Part(meshes=builder.meshes(), is_mount=True)


@lru_cache(maxsize=16)
def sign_parts(kind: str, *, patched: bool = False) -> tuple[Part, ...]:
    """A traffic sign on its post, facing +x: ``stop``, or ``30``, ``50`` … for a speed limit."""
    builder = Builder()
    size = 0.42 if kind == "stop" else 0.34
    material = (
        materials.sign(signs.stop_sign, patched)
        if kind == "stop"
        else materials.sign(signs.speed_sign, int(kind))
    )
    z = _SIGN_TOP_M - size
    for x, side, tint in ((0.045, 1.0, (1.0, 1.0, 1.0)), (0.040, -1.0, (0.40, 0.40, 0.40))):
        y = side * size
        builder.quad(
            material, [[x, -y, z - size], [x, y, z - size], [x, y, z + size], [x, -y, z + size]], colour=tint
        )
    return _post(0.0, _SIGN_TOP_M, (0.035, 0.035), _STEEL), Part(meshes=builder.meshes())


_SIGN_TOP_M = 2.75
SIGN_DIMENSIONS_M = {"stop": (0.12, 0.84, 0.84), "speed": (0.12, 0.68, 0.68)}
SIGN_BASE_M = {name: _SIGN_TOP_M - height for name, (_, _, height) in SIGN_DIMENSIONS_M.items()}
LIGHT_DIMENSIONS_M = (0.55, 0.52, 1.25)
LIGHT_BASE_M = 2.825


def traffic_light_parts(cycle: tuple[tuple[str, tuple[float, float]], ...]) -> tuple[Part, ...]:
    """A traffic light facing +x; `cycle` lists which colour burns from when to when (s)."""
    builder = Builder()
    builder.box(materials.metal(), (0.02, 0.0, 3.45), (0.26, 0.34, 1.05), (0.07, 0.08, 0.07))
    builder.box(materials.metal(), (-0.12, 0.0, 3.45), (0.02, 0.52, 1.25), (0.06, 0.06, 0.06))
    colours: dict[str, tuple[float, Colour]] = {
        "red": (3.78, (0.95, 0.06, 0.05)),
        "amber": (3.45, (0.98, 0.62, 0.06)),
        "green": (3.12, (0.10, 0.90, 0.45)),
    }
    for z, colour in colours.values():
        red, green, blue = (0.16 * c + 0.02 for c in colour)
        builder.disc(materials.metal(), (0.155, 0.0, z), (1.0, 0.0, 0.0), 0.11, (red, green, blue))
        builder.box(materials.metal(), (0.21, 0.0, z + 0.125), (0.13, 0.26, 0.015), _DARK)
    parts = [_post(-0.12, 4.0, (0.07, 0.055), _DARK), Part(meshes=builder.meshes())]
    for name, (z, colour) in colours.items():
        lit = Builder()
        lit.disc(materials.bright_lamp(colour), (0.16, 0.0, z), (1.0, 0.0, 0.0), 0.105)
        spans = tuple(span for other, span in cycle if other == name)
        if spans:
            parts.append(Part(meshes=lit.meshes(), shown_s=spans))
    return tuple(parts)


def bench(builder: Builder) -> None:
    """Add a bench at the origin, facing +y."""
    for y, z in ((0.05, 0.45), (-0.08, 0.45), (-0.21, 0.46), (-0.30, 0.62), (-0.33, 0.76)):
        builder.box(materials.bark(), (0.0, y, z), (1.7, 0.11, 0.04), (0.9, 0.75, 0.55))
    for x in (-0.7, 0.7):
        builder.box(materials.metal(), (x, -0.1, 0.22), (0.06, 0.42, 0.44), _DARK, sky_below=0.5)


def bin_(builder: Builder, colour: Colour) -> None:
    """Add a litter bin at the origin."""
    builder.tube(materials.metal(), (0.0, 0.0, 0.0), (0.0, 0.0, 0.85), (0.20, 0.24), colour, 12, sky_foot=0.5)
    builder.tube(materials.metal(), (0.0, 0.0, 0.85), (0.0, 0.0, 0.90), (0.26, 0.20), _DARK, 12)
    builder.disc(materials.metal(), (0.0, 0.0, 0.88), (0.0, 0.0, 1.0), 0.22, _DARK)


def bollard(builder: Builder) -> None:
    """Add a bollard at the origin."""
    builder.tube(materials.metal(), (0.0, 0.0, 0.0), (0.0, 0.0, 0.86), (0.07, 0.06), _DARK, 10, sky_foot=0.5)
    builder.tube(
        materials.metal(), (0.0, 0.0, 0.70), (0.0, 0.0, 0.80), (0.068, 0.066), (0.85, 0.85, 0.82), 10
    )
    builder.disc(materials.metal(), (0.0, 0.0, 0.86), (0.0, 0.0, 1.0), 0.06, _DARK)


def board(builder: Builder, words: str, width_m: float, z: float) -> None:
    """Add a direction board on two posts, facing -x, its middle above the origin."""
    for y in (-0.35 * width_m, 0.35 * width_m):
        builder.tube(
            materials.metal(), (0.08, y, 0.0), (0.08, y, z + 0.25 * width_m), (0.06, 0.06), _STEEL, 8
        )
    half, tall = 0.5 * width_m, 0.25 * width_m
    face = np.array(
        [[0.0, half, z - tall], [0.0, -half, z - tall], [0.0, -half, z + tall], [0.0, half, z + tall]]
    )
    builder.quad(materials.picture(signs.board, words), face)
