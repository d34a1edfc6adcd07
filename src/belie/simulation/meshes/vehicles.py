"""Cars, vans, trucks and buses: a lofted body with windows, lamps, plates, mirrors and rolling wheels."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from belie.geometry import FloatArray
from belie.simulation import materials
from belie.simulation.meshes.builder import Builder
from belie.simulation.meshes.vehicle_bodies import BODIES, Body, section_at
from belie.simulation.textures import signs, vehicles
from belie.simulation.world import Colour, Glow, Material, Part

_OUT_M = 0.008  # windows stand this far off the sheet metal that they cover


def _ring(section: Sequence[float] | FloatArray, x: float, side: float) -> FloatArray:
    """One half of a cross-section from the underside to the middle of the roof, shape (7, 3)."""
    w, bottom, belt, roof, roof_w = (float(v) for v in section)
    middle = bottom + 0.45 * (belt - bottom)
    round_off = min(0.10, 0.25 * (roof - belt))
    y = np.array([0.86 * w, 0.97 * w, w, 0.965 * w, roof_w, 0.82 * roof_w, 0.0])
    z = np.array([bottom, bottom + 0.1, middle, belt, roof - round_off, roof, roof + 0.03])
    return np.column_stack([np.full(7, x), side * y, z])


@lru_cache(maxsize=128)
def vehicle_parts(kind: str, paint: Colour, number: int, *, rolls: bool = True) -> tuple[Part, ...]:
    """Body and wheels of a vehicle; it stands on z = 0, its middle at x = 0, front at +x. One part if it never rolls.

    >>> from belie.simulation.meshes.vehicle_bodies import PAINTS
    >>> len(vehicle_parts("car", PAINTS[0], 1)), len(vehicle_parts("car", PAINTS[0], 1, rolls=False))
    (5, 1)
    """
    body = BODIES[kind]
    builder = Builder()
    _sheet_metal(builder, kind, body, paint)
    _glass(builder, body)
    _fittings(builder, kind, body, number)
    builder.contact(materials.blob(), (1.04 * body.length_m + 0.3, body.dimensions_m[1] + 0.5))
    places = [(x, side * (body.sections[1][1] - 0.02), side) for x in body.wheels_x for side in (-1.0, 1.0)]
    if not rolls:
        for x, y, side in places:
            _wheel(builder, x, y, side, body.wheel_m)
        return (Part(meshes=builder.meshes()),)
    wheels = []
    for x, y, side in places:
        wheel = Builder()
        _wheel(wheel, x, y, side, body.wheel_m)
        wheels.append(
            Part(meshes=wheel.meshes(), pivot_m=(x, y, body.wheel_m), rolling_radius_m=body.wheel_m)
        )
    return (Part(meshes=builder.meshes()), *wheels)


def _sheet_metal(builder: Builder, kind: str, body: Body, paint: Colour) -> None:
    rear, length = body.sections[0][0], body.length_m
    shares = tuple(round((x - rear) / length, 3) for x in body.wheels_x)
    side_material = materials.surface(
        vehicles.side, kind, shares, round(body.wheel_m / length, 4), gloss=0.22
    )
    plain = materials.surface(vehicles.sheet, gloss=0.3)
    xs = np.array([s[0] for s in body.sections])
    for side in (-1.0, 1.0):
        rings = np.stack([_ring(s[1:], s[0], side) for s in body.sections], axis=1)  # (7, S, 3)
        if side > 0:
            rings = rings[:, ::-1]  # outside stays outside
        columns = (rings[0, :, 0] - rear) / length
        lower = rings[:4]
        share = (lower[..., 2] - lower[:1, :, 2]) / (lower[3:, :, 2] - lower[:1, :, 2])
        uv = np.stack([np.broadcast_to(columns, share.shape), 1.0 - share], axis=2)
        builder.grid(side_material, lower, uv, paint, np.array([0.45, 0.6, 0.85, 1.0])[:, None])
        builder.grid(plain, rings[3:5], rings[3:5, :, [0, 2]], paint)
        builder.grid(plain, rings[4:], rings[4:, :, [0, 1]], paint)
    for index, normal_x in ((0, -1.0), (len(xs) - 1, 1.0)):
        _end(builder, kind, body, index, normal_x, paint)


def _end(builder: Builder, kind: str, body: Body, index: int, normal_x: float, paint: Colour) -> None:
    section = body.sections[index]
    right, left = _ring(section[1:], section[0], -1.0), _ring(section[1:], section[0], 1.0)
    outline = np.concatenate([right, left[-2::-1]])
    middle = outline.mean(axis=0)
    points = np.concatenate([[middle], outline])
    width, low, high = section[1], outline[:, 2].min(), outline[:, 2].max()
    uv = np.column_stack([0.5 + points[:, 1] / (2.0 * width), 1.0 - (points[:, 2] - low) / (high - low)])
    triangles = [[0, k, k % len(outline) + 1] for k in range(1, len(outline) + 1)]
    material = materials.surface(vehicles.end, kind, normal_x > 0, gloss=0.15)
    builder.surface(material, points, np.tile([normal_x, 0.0, 0.0], (len(points), 1)), uv, triangles, paint)


def _glass(builder: Builder, body: Body) -> None:
    glass = materials.surface(vehicles.glass, gloss=0.7)
    for x0, x1 in body.windows:
        for side in (-1.0, 1.0):
            corners = []
            for x, share in ((x0, 0.06), (x1, 0.06), (x1, 0.90), (x0, 0.90)):
                ring = _ring(section_at(body, x), x, side)
                # A window narrows towards the roof, where the pillars lean.
                corners.append(ring[3] + share * (ring[4] - ring[3]) + [0.0, side * _OUT_M, 0.0])
            order = corners if side < 0 else [corners[1], corners[0], corners[3], corners[2]]
            builder.quad(glass, np.array(order))
    first, last = body.cabin
    pairs = [(last, last + 1, 1.0)]
    if body.has_rear_window:
        pairs.append((first, first - 1, -1.0))
    for upper, lower, ahead in pairs:
        _screen(builder, glass, body, upper, lower, ahead)


def _screen(builder: Builder, glass: Material, body: Body, upper: int, lower: int, ahead: float) -> None:
    """Windscreen or rear window: between the roof's edge and the bonnet or boot."""
    a, b = body.sections[lower], body.sections[upper]
    foot = np.array([a[0], 0.0, a[4] + 0.03])
    head = np.array([b[0], 0.0, b[4] + 0.03])
    if abs(a[0] - b[0]) < 0.2:  # upright: in the rear wall, above its belt
        foot, head = np.array([a[0], 0.0, a[3] + 0.1]), np.array([a[0], 0.0, a[4] - 0.12])
    span = head - foot
    outward = np.cross(span, [0.0, ahead, 0.0])
    outward *= -1.0 if outward[0] * ahead < 0 else 1.0
    outward /= np.linalg.norm(outward)
    lower_w, upper_w = 0.90 * a[5], 0.92 * b[5]
    out = 0.035 * outward
    y = np.array([0.0, 1.0, 0.0])
    corners = [
        foot + 0.08 * span - ahead * lower_w * y + out,
        foot + 0.08 * span + ahead * lower_w * y + out,
        foot + 0.90 * span + ahead * upper_w * y + out,
        foot + 0.90 * span - ahead * upper_w * y + out,
    ]
    if ahead < 0:
        corners = [corners[1], corners[0], corners[3], corners[2]]
        corners = [corners[1], corners[0], corners[3], corners[2]]
    builder.quad(glass, np.array(corners))


def _fittings(builder: Builder, kind: str, body: Body, number: int) -> None:
    front, rear = body.sections[-1], body.sections[0]
    plate = materials.picture(signs.plate, number)
    for side in (-1.0, 1.0):
        lamp_y = side * 0.80 * body.sections[-2][1]
        builder.box(
            materials.lamp((0.86, 0.88, 0.88), 1.0),
            (body.sections[-2][0] + 0.01, lamp_y, body.lamp_z[0]),
            (0.16, 0.30, 0.15),
        )
        tail_y = side * 0.84 * body.sections[1][1]
        builder.box(
            materials.lamp((0.55, 0.03, 0.03), 0.9),
            (body.sections[0][0] + 0.06, tail_y, body.lamp_z[1]),
            (0.16, 0.22, 0.26),
        )
        mirror_x = body.windows[-1][1] - 0.05
        width = float(section_at(body, mirror_x)[0])
        belt = float(section_at(body, mirror_x)[2])
        builder.box(
            materials.metal(),
            (mirror_x, side * (width + 0.06), belt + 0.08),
            (0.14, 0.2, 0.15),
            (0.13, 0.13, 0.14),
        )
    z = 0.5 if kind in ("car", "van") else 0.72
    for x, ahead in ((front[0] + 0.02, 1.0), (rear[0] - 0.02, -1.0)):
        y = ahead * 0.26
        builder.quad(plate, [[x, -y, z - 0.06], [x, y, z - 0.06], [x, y, z + 0.06], [x, -y, z + 0.06]])
    if kind == "truck":
        for y, ahead in ((-1.262, 1.0), (1.262, -1.0)):
            board = np.array(
                [[-3.0 * ahead, y, 2.0], [0.8 * ahead, y, 2.0], [0.8 * ahead, y, 3.0], [-3.0 * ahead, y, 3.0]]
            )
            builder.quad(
                materials.picture(signs.board, "NORDFRACHT"),
                board + ([-1.1, 0.0, 0.0] if ahead < 0 else [0.0] * 3),
            )
    width = 2.0 * body.sections[1][1] - 0.35
    builder.box(materials.metal(), (0.0, 0.0, 0.30), (body.length_m - 0.5, width, 0.2), (0.05, 0.05, 0.05))


def _wheel(builder: Builder, x: float, y: float, side: float, radius: float) -> None:
    wide = 0.22
    builder.disc(materials.surface(vehicles.wheel), (x, y, radius), (0.0, side, 0.0), radius)
    builder.tube(
        materials.metal(),
        (x, y, radius),
        (x, y - side * wide, radius),
        (radius, radius),
        (0.09, 0.09, 0.09),
        20,
    )


def vehicle_glows(kind: str) -> tuple[Glow, ...]:
    """Its head and tail lamps."""
    body = BODIES[kind]
    lamps = []
    for side in (-1.0, 1.0):
        y = side * 0.80 * body.sections[-2][1]
        lamps.append(
            Glow(
                position_m=(body.sections[-1][0] + 0.12, y, body.lamp_z[0]),
                colour=(1.0, 0.95, 0.82),
                radius_m=0.75,
                facing=(1.0, 0.0, 0.0),
            )
        )
        lamps.append(
            Glow(
                position_m=(body.sections[0][0] - 0.12, y, body.lamp_z[1]),
                colour=(0.8, 0.06, 0.04),
                radius_m=0.35,
                facing=(-1.0, 0.0, 0.0),
            )
        )
    return tuple(lamps)


def brake_lamps(kind: str, spans_s: tuple[tuple[float, float], ...]) -> Part:
    """Tail lamps that burn during some spans of time."""
    body, builder = BODIES[kind], Builder()
    for side in (-1.0, 1.0):
        y = side * 0.84 * body.sections[1][1]
        builder.box(
            materials.bright_lamp((1.0, 0.10, 0.07)),
            (body.sections[0][0] + 0.05, y, body.lamp_z[1]),
            (0.18, 0.23, 0.27),
        )
    return Part(meshes=builder.meshes(), shown_s=spans_s)
