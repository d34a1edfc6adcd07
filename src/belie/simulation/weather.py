"""Light, rain and fog: one row of `WEATHERS` for each weather of the paper, and some more."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

_CONTRAST_AT_VISIBILITY = (
    0.05  # Koschmieder's threshold, as the WMO takes it for meteorological optical range
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Weather:
    """One weather. Colours are linear RGB; 1 is a white sheet in full sun.

    Parameters
    ----------
    name : str
        As in a scenario.
    visibility_m : float or None
        Distance at which 5 % of a contrast is left; None: clear.
    is_dark : bool
        Night: lamps and headlights are on.
    sun_elevation_deg, sun_azimuth_deg : float
        Where the sun stands; azimuth against the direction in which one looks, left positive.
    sun, sky, bounce, fog : tuple of float
        Light of the sun, of the sky from above, of the ground from below; colour of fog and horizon.
    clouds : float
        0 blue, 1 overcast.
    wetness : float
        0 dry, 1 puddles.
    rain_mm_h : float
        Strength of the rain.
    glare : float
        How much the sun dazzles.
    exposure : float
        Gain of the picture.
    exposure_ms : float
        Time for which each row is exposed.
    noise : float
        Standard deviation of the sensor's noise at mid-grey, in levels of 255.

    Examples
    --------
    >>> round(WEATHERS["heavy-fog"].extinction_per_m, 4)
    0.0666
    >>> WEATHERS["sunny"].extinction_per_m
    0.0
    """

    name: str
    visibility_m: float | None
    is_dark: bool
    sun_elevation_deg: float
    sun_azimuth_deg: float
    sun: tuple[float, float, float]
    sky: tuple[float, float, float]
    bounce: tuple[float, float, float]
    fog: tuple[float, float, float]
    clouds: float
    wetness: float
    rain_mm_h: float
    glare: float
    exposure: float
    exposure_ms: float
    noise: float

    @property
    def extinction_per_m(self) -> float:
        """Koschmieder's extinction coefficient."""
        return -math.log(_CONTRAST_AT_VISIBILITY) / self.visibility_m if self.visibility_m else 0.0


_SUNNY = Weather(
    name="sunny",
    visibility_m=None,
    is_dark=False,
    sun_elevation_deg=48.0,
    sun_azimuth_deg=62.0,
    sun=(1.0, 0.94, 0.84),
    sky=(0.40, 0.47, 0.58),
    bounce=(0.17, 0.15, 0.13),
    fog=(0.62, 0.72, 0.84),
    clouds=0.35,
    wetness=0.0,
    rain_mm_h=0.0,
    glare=0.0,
    exposure=1.25,
    exposure_ms=1.0,
    noise=1.2,
)
_OVERCAST: dict[str, Any] = {
    "sun": (0.0, 0.0, 0.0),
    "sky": (0.62, 0.65, 0.7),
    "bounce": (0.25, 0.25, 0.25),
    "clouds": 1.0,
}
_NIGHT: dict[str, Any] = {
    "is_dark": True,
    "sun": (0.0, 0.0, 0.0),
    "sky": (0.026, 0.030, 0.046),
    "bounce": (0.020, 0.018, 0.016),
    "fog": (0.026, 0.026, 0.032),
    "clouds": 0.6,
    "exposure": 1.7,
    "exposure_ms": 8.0,
    "noise": 3.5,
}

WEATHERS: Mapping[str, Weather] = MappingProxyType(
    {
        weather.name: weather
        for weather in (
            _SUNNY,
            replace(
                _SUNNY,
                name="light-rain",
                **{
                    **_OVERCAST,
                    "visibility_m": 900.0,
                    "wetness": 0.75,
                    "rain_mm_h": 4.0,
                    "fog": (0.55, 0.59, 0.64),
                },
                exposure_ms=3.0,
                noise=1.8,
            ),
            replace(_SUNNY, name="night", **_NIGHT),
            replace(
                _SUNNY,
                name="rainy-night",
                **{**_NIGHT, "visibility_m": 500.0, "wetness": 1.0, "rain_mm_h": 9.0},
            ),
            replace(
                _SUNNY,
                name="light-fog",
                **{**_OVERCAST, "visibility_m": 150.0, "fog": (0.46, 0.475, 0.50)},
                exposure_ms=3.0,
                noise=1.6,
            ),
            replace(
                _SUNNY,
                name="heavy-fog",
                **{**_OVERCAST, "visibility_m": 45.0, "fog": (0.43, 0.44, 0.455)},
                exposure_ms=4.0,
                noise=1.8,
            ),
            replace(
                _SUNNY,
                name="low-sun",
                sun_elevation_deg=9.0,
                sun_azimuth_deg=7.0,
                sun=(1.25, 0.78, 0.42),
                sky=(0.30, 0.31, 0.38),
                bounce=(0.16, 0.12, 0.09),
                fog=(0.92, 0.70, 0.50),
                visibility_m=2500.0,
                glare=1.0,
                exposure=1.15,
                exposure_ms=1.5,
            ),
        )
    }
)
