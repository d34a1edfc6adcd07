"""The light of a weather, as the programs' uniforms."""

from __future__ import annotations

import numpy as np

from belie.geometry import SE3, FloatArray
from belie.simulation.weather import Weather
from belie.simulation.world import World

_SUN = 2.6  # the sun against the sky: a clear day's shadows are about a quarter as bright
_STREET_LAMP = (1.15, 0.80, 0.42)  # sodium
_CEILING_LAMP = (0.62, 0.62, 0.58)
_INDOOR_SKY, _INDOOR_BOUNCE = 0.20, 0.16
_INDOORS_AT_NIGHT = 0.12  # the ceiling's lights are off but for the emergency ones
_DIPPED = np.array([0.99939, 0.0, -0.03503])  # 2 deg down


def light_uniforms(
    world: World, weather: Weather, towards_sun: FloatArray, T_world_cam: SE3
) -> dict[str, object]:
    """Colours and directions of all light that falls on a world."""
    w = weather
    values: dict[str, object] = {
        "sun_direction": tuple(towards_sun),
        "sun_light": tuple(_SUN * v for v in w.sun),
        "sky_light": w.sky,
        "bounce_light": w.bounce,
        "fog_light": w.fog,
        "extinction": w.extinction_per_m,
        "exposure": w.exposure,
        "lamp_light": _STREET_LAMP,
    }
    if world.is_indoors:
        dim = _INDOORS_AT_NIGHT if w.is_dark else 1.0
        values["sky_light"] = (_INDOOR_SKY * dim,) * 3
        values["bounce_light"] = (_INDOOR_BOUNCE * dim,) * 3
        values["lamp_light"] = tuple(v * dim for v in _CEILING_LAMP)
    if world.headlights_m is not None:
        T_world_body = T_world_cam @ world.T_body_cam.inverse()
        values["headlight"] = tuple(T_world_body.apply(np.array([world.headlights_m]))[0])
        values["headlight_direction"] = tuple(T_world_body.R @ _DIPPED)
        values["headlight_power"] = world.headlight_power
    return values
