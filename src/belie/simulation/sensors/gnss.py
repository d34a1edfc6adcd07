"""A satellite receiver: positions in ENU metres with an error that wanders, and its covariance."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from belie.simulation.sensors.position import PositionSensor
from belie.simulation.sensors.sampling import Arrival, Sampling
from belie.types import Settings


class GnssSettings(Settings):
    """Errors of a satellite receiver; the defaults are those of one with corrections (RTK), as on test vehicles.

    >>> GnssSettings().rate_hz
    10.0
    """

    rate_hz: float = Field(10.0, description="fixes; 0 leaves the sensor out [Hz]", ge=0.0, le=100.0)
    horizontal_m: float = Field(
        0.02,
        description="wandering error east and north, standard deviation each; u-blox's ZED-F9P with corrections from a "
        "base 10 km away: 0.01 m + 1 ppm CEP, divided by 1.18 (without corrections 1.5 m CEP: set 1.27) [m]",
        ge=0.0,
    )
    vertical_m: float = Field(
        0.04,
        description="the same upwards: about twice the horizontal, from the geometry of the sky [m]",
        ge=0.0,
    )
    correlation_s: float = Field(
        60.0,
        description="time in which that error is forgotten; as PX4's simulator (gazebo_gps_plugin) has it [s]",
        gt=0.0,
    )
    white_m: float = Field(
        0.005,
        description="error that is new with every fix: noise of the carrier phase [m, each axis]",
        ge=0.0,
    )
    antenna_m: tuple[float, float, float] = Field(
        (-0.4, 0.0, 1.5), description="place of the antenna on the body, body axes: on the roof [m]"
    )
    latitude_deg: float = Field(48.1374, description="where the world's origin lies [deg]", ge=-89.0, le=89.0)
    longitude_deg: float = Field(
        11.5755, description="where the world's origin lies [deg]", ge=-180.0, le=180.0
    )
    altitude_m: float = Field(520.0, description="where the world's origin lies [m]")
    arrival: Arrival = Arrival(delay_ms=45.0, jitter_ms=10.0)


def gnss(settings: GnssSettings, *, start_ns: int, seed: int, source: str = "/gnss/fix") -> PositionSensor:
    """Fixes of an antenna on the body, ENU about the world's origin.

    Examples
    --------
    >>> from belie.geometry import SE3
    >>> class Standing:
    ...     def T_world_body(self, t_s): return SE3.from_translation([3.0, 4.0, 0.0])
    ...     def twist(self, t_s): return np.zeros(3), np.zeros(3)
    >>> exact = GnssSettings(horizontal_m=0, vertical_m=0, white_m=0)
    >>> gnss(exact, start_ns=0, seed=1).claims_until(Standing(), 0.0)[0].position_m
    array([2.6, 4. , 1.5])
    """
    s = settings
    return PositionSensor(
        source=source,
        frame_id="enu",
        kind="gnss",
        sampling=Sampling(rate_hz=s.rate_hz, start_ns=start_ns),
        seed=seed,
        wander_m=np.array([s.horizontal_m, s.horizontal_m, s.vertical_m]),
        correlation_s=s.correlation_s,
        white_m=s.white_m,
        arrival=s.arrival,
        lever_m=np.array(s.antenna_m),
    )
