"""WGS84 latitude, longitude and height to local east-north-up metres, and back.

Formulas: Hofmann-Wellenhof, Lichtenegger, Wasle, *GNSS*, section 8.2 (geodetic to ECEF, ECEF to ENU).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from belie.geometry import FloatArray

_SEMI_MAJOR_M = 6378137.0
_FLATTENING = 1.0 / 298.257223563
_ECCENTRICITY2 = _FLATTENING * (2.0 - _FLATTENING)


@dataclass(frozen=True, slots=True, kw_only=True)
class GeodeticPoint:
    """A point on WGS84: degrees, and metres above the ellipsoid.

    >>> GeodeticPoint(latitude_deg=48.1, longitude_deg=11.5, altitude_m=520.0).altitude_m
    520.0
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


def ecef_m(point: GeodeticPoint) -> FloatArray:
    """Earth-centred, earth-fixed coordinates, shape (3,), metres.

    >>> ecef_m(GeodeticPoint(latitude_deg=0.0, longitude_deg=0.0, altitude_m=0.0))
    array([6378137.,       0.,       0.])
    """
    latitude, longitude = math.radians(point.latitude_deg), math.radians(point.longitude_deg)
    sine, cosine = math.sin(latitude), math.cos(latitude)
    normal_m = _SEMI_MAJOR_M / math.sqrt(1.0 - _ECCENTRICITY2 * sine * sine)
    ring_m = (normal_m + point.altitude_m) * cosine
    z_m = (normal_m * (1.0 - _ECCENTRICITY2) + point.altitude_m) * sine
    return np.array([ring_m * math.cos(longitude), ring_m * math.sin(longitude), z_m])


def geodetic(position_ecef_m: FloatArray) -> GeodeticPoint:
    """The inverse of `ecef_m`, to better than a nanometre.

    >>> home = GeodeticPoint(latitude_deg=48.1, longitude_deg=11.5, altitude_m=520.0)
    >>> back = geodetic(ecef_m(home))
    >>> round(back.latitude_deg, 12), round(back.longitude_deg, 12), round(back.altitude_m, 6)
    (48.1, 11.5, 520.0)
    """
    x, y, z = (float(v) for v in position_ecef_m)
    ring_m = math.hypot(x, y)
    latitude = math.atan2(z, ring_m * (1.0 - _ECCENTRICITY2))
    normal_m = _SEMI_MAJOR_M
    # Each round shrinks the error by about the eccentricity squared (0.0067): ten are past float64.
    for _ in range(10):
        sine = math.sin(latitude)
        normal_m = _SEMI_MAJOR_M / math.sqrt(1.0 - _ECCENTRICITY2 * sine * sine)
        latitude = math.atan2(z + _ECCENTRICITY2 * normal_m * sine, ring_m)
    altitude_m = (
        ring_m * math.cos(latitude) + z * math.sin(latitude) - _SEMI_MAJOR_M * _SEMI_MAJOR_M / normal_m
    )
    return GeodeticPoint(
        latitude_deg=math.degrees(latitude),
        longitude_deg=math.degrees(math.atan2(y, x)),
        altitude_m=altitude_m,
    )


def _R_enu_ecef(origin: GeodeticPoint) -> FloatArray:
    latitude, longitude = math.radians(origin.latitude_deg), math.radians(origin.longitude_deg)
    sin_lat, cos_lat = math.sin(latitude), math.cos(latitude)
    sin_lon, cos_lon = math.sin(longitude), math.cos(longitude)
    return np.array(
        [
            [-sin_lon, cos_lon, 0.0],
            [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
            [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat],
        ]
    )


def enu_m(point: GeodeticPoint, origin: GeodeticPoint) -> FloatArray:
    """Position of `point` in east-north-up metres about `origin`, shape (3,).

    >>> origin = GeodeticPoint(latitude_deg=48.0, longitude_deg=11.0, altitude_m=500.0)
    >>> north = GeodeticPoint(latitude_deg=48.001, longitude_deg=11.0, altitude_m=500.0)
    >>> enu_m(north, origin).round(1)
    array([  0. , 111.2,  -0. ])
    """
    return np.asarray(_R_enu_ecef(origin) @ (ecef_m(point) - ecef_m(origin)))


def geodetic_of_enu(position_enu_m: FloatArray, origin: GeodeticPoint) -> GeodeticPoint:
    """The inverse of `enu_m`.

    >>> origin = GeodeticPoint(latitude_deg=48.0, longitude_deg=11.0, altitude_m=500.0)
    >>> enu_m(geodetic_of_enu(np.array([3.0, 4.0, 5.0]), origin), origin).round(6)
    array([3., 4., 5.])
    """
    return geodetic(ecef_m(origin) + _R_enu_ecef(origin).T @ position_enu_m)
