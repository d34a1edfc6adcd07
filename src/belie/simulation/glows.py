"""Lamps that are seen as such: bright points with a halo, which fog and rain widen."""

from __future__ import annotations

import numpy as np

from belie.geometry import FloatArray
from belie.simulation.placed import Placed
from belie.simulation.still import stands
from belie.simulation.weather import Weather
from belie.simulation.world import Glow, World

_IDENTITY = np.eye(4)


def glow_sprites(world: World, placed: list[Placed], weather: Weather, eye: FloatArray) -> FloatArray:
    """Middle, light and radius of each visible glow, shape (N, 7): none by day, faint ones in fog and rain."""
    if weather.is_dark:
        strength = 1.0
    elif weather.clouds >= 1.0:
        strength = 0.45  # dipped beams are on, street lamps are not
    else:
        return np.zeros((0, 7))
    wide = 1.0 + 1.2 * min(1.0, 60.0 * weather.extinction_per_m) + 0.25 * (weather.rain_mm_h > 0.0)
    lit = [(glow, _IDENTITY) for glow in world.glows] if weather.is_dark else []
    lit += [
        (glow, actor.motion.T_world_body(0.0).matrix())
        for actor in world.actors
        if stands(actor)
        for glow in actor.glows
    ]
    lit += [(glow, body.T_world_obj) for body in placed for glow in body.actor.glows]
    rows = [_sprite(glow, model, weather, eye, strength, wide) for glow, model in lit]
    return np.array([row for row in rows if row is not None]).reshape(-1, 7)


def _sprite(
    glow: Glow, model: FloatArray, weather: Weather, eye: FloatArray, strength: float, wide: float
) -> FloatArray | None:
    centre = model[:3, :3] @ np.array(glow.position_m) + model[:3, 3]
    offset = eye - centre
    distance = float(np.linalg.norm(offset))
    if not 0.5 < distance < 300.0:
        return None
    facing = model[:3, :3] @ np.array(glow.facing)
    seen = max(0.0, float(facing @ offset) / distance) ** 1.5 if any(glow.facing) else 1.0
    light = strength * seen * np.exp(-weather.extinction_per_m * distance)
    if light < 0.02:
        return None
    return np.array([*centre, *(light * np.array(glow.colour)), glow.radius_m * wide])
