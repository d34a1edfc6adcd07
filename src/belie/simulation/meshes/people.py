"""People who walk: head, trunk, arms and legs that swing."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from belie.simulation import materials
from belie.simulation.meshes.builder import Builder
from belie.simulation.world import Colour, Material, Part

HEIGHT_M = 1.76
_SKINS: tuple[Colour, ...] = ((0.80, 0.60, 0.48), (0.56, 0.38, 0.28), (0.36, 0.24, 0.18), (0.90, 0.72, 0.60))
_TOPS: tuple[Colour, ...] = (
    (0.62, 0.12, 0.12),
    (0.14, 0.24, 0.46),
    (0.86, 0.84, 0.78),
    (0.20, 0.36, 0.24),
    (0.75, 0.58, 0.14),
    (0.14, 0.14, 0.16),
)
_TROUSERS: tuple[Colour, ...] = (
    (0.14, 0.17, 0.28),
    (0.12, 0.12, 0.13),
    (0.42, 0.36, 0.28),
    (0.32, 0.33, 0.35),
)
_HAIR: tuple[Colour, ...] = ((0.10, 0.08, 0.07), (0.30, 0.19, 0.10), (0.62, 0.50, 0.30), (0.45, 0.44, 0.43))


@lru_cache(maxsize=32)
def person_parts(seed: int) -> tuple[Part, ...]:
    """A person who stands on z = 0 and looks along x."""
    rng = np.random.default_rng([seed, 17])
    skin, top, trousers, hair = (c[int(rng.integers(len(c)))] for c in (_SKINS, _TOPS, _TROUSERS, _HAIR))
    cloth = materials.cloth()
    trunk = Builder()
    # Height, half depth, half width from the hips to the neck.
    _loft(
        trunk,
        cloth,
        (
            (0.82, 0.11, 0.165),
            (0.95, 0.115, 0.165),
            (1.10, 0.105, 0.15),
            (1.30, 0.125, 0.19),
            (1.42, 0.11, 0.20),
            (1.49, 0.06, 0.09),
            (1.56, 0.055, 0.06),
        ),
        top,
    )
    _ellipsoid(trunk, cloth, (0.015, 0.0, 1.655), (0.095, 0.078, 0.118), skin)
    _ellipsoid(trunk, cloth, (-0.012, 0.0, 1.685), (0.098, 0.086, 0.105), hair)
    if rng.random() < 0.5:  # a rucksack
        r, g, b = (float(v) for v in rng.uniform(0.1, 0.6, 3))
        trunk.box(cloth, (-0.19, 0.0, 1.22), (0.16, 0.28, 0.42), (r, g, b))
    trunk.contact(materials.blob(), (0.75, 0.65))
    parts = [Part(meshes=trunk.meshes())]
    for side in (-1.0, 1.0):
        leg, arm = Builder(), Builder()
        y = side * 0.095
        leg.tube(cloth, (0.0, y, 0.46), (0.0, y, 0.90), (0.062, 0.092), trousers, 10, (1.0, 2.0))
        leg.tube(cloth, (-0.015, y, 0.08), (0.0, y, 0.47), (0.046, 0.064), trousers, 10, (1.0, 2.0))
        leg.box(cloth, (0.04, y, 0.045), (0.26, 0.095, 0.09), (0.08, 0.07, 0.07))
        phase = 0.0 if side > 0 else np.pi
        parts.append(Part(meshes=leg.meshes(), pivot_m=(0.0, y, 0.88), swing_rad=0.48, phase_rad=phase))
        y = side * 0.245
        arm.tube(cloth, (0.0, y, 1.12), (0.0, side * 0.205, 1.42), (0.042, 0.055), top, 8)
        arm.tube(cloth, (0.06, y, 0.87), (0.0, y, 1.13), (0.034, 0.042), top, 8)
        _ellipsoid(arm, cloth, (0.07, y, 0.82), (0.04, 0.03, 0.06), skin)
        parts.append(
            Part(meshes=arm.meshes(), pivot_m=(0.0, y, 1.40), swing_rad=0.42, phase_rad=phase + np.pi)
        )
    return tuple(parts)


def _loft(
    builder: Builder, material: Material, sections: tuple[tuple[float, float, float], ...], colour: Colour
) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 15)
    points = np.array([[[d * np.cos(a), w * np.sin(a), z] for a in angles] for z, d, w in sections])
    uv = np.stack(np.meshgrid(np.linspace(0, 2, 15), np.linspace(2, 0, len(sections))), axis=2)
    builder.grid(material, points, uv, colour)


def _ellipsoid(
    builder: Builder,
    material: Material,
    middle: tuple[float, float, float],
    radii: tuple[float, float, float],
    colour: Colour,
) -> None:
    latitude, angles = np.linspace(-np.pi / 2 + 0.05, np.pi / 2 - 0.05, 9), np.linspace(0.0, 2.0 * np.pi, 15)
    unit = np.array(
        [[[np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)] for a in angles] for b in latitude]
    )
    uv = np.stack(np.meshgrid(np.linspace(0, 1, 15), np.linspace(1, 0, 9)), axis=2)
    builder.grid(material, np.array(middle) + unit * np.array(radii), uv, colour)
