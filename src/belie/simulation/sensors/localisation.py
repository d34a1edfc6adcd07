"""A localisation in a map, as from LiDAR: positions of the body with a small, wandering error."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from belie.simulation.sensors.position import PositionSensor
from belie.simulation.sensors.sampling import Arrival, Sampling
from belie.types import Settings


class LocalisationSettings(Settings):
    """Errors of a localisation in a map.

    >>> LocalisationSettings().wander_m
    0.05
    """

    rate_hz: float = Field(10.0, description="poses; 0 leaves the sensor out [Hz]", ge=0.0, le=200.0)
    wander_m: float = Field(
        0.05,
        description="wandering error, standard deviation each axis; LiDAR localisation reaches 5 to 10 cm "
        "(Wan et al., ICRA 2018, arXiv:1711.05805) [m]",
        ge=0.0,
    )
    correlation_s: float = Field(
        5.0, description="time in which it is forgotten: some tens of metres of new surroundings [s]", gt=0.0
    )
    white_m: float = Field(
        0.01, description="error that is new with every pose: a LiDAR's range noise [m]", ge=0.0
    )
    arrival: Arrival = Arrival(delay_ms=40.0, jitter_ms=12.0)


def localisation(
    settings: LocalisationSettings, *, start_ns: int, seed: int, source: str = "/localization/pose"
) -> PositionSensor:
    """Positions of the body's origin in the frame ``map``, which is the world.

    Examples
    --------
    >>> from belie.geometry import SE3
    >>> class Standing:
    ...     def T_world_body(self, t_s): return SE3.from_translation([3.0, 4.0, 0.0])
    ...     def twist(self, t_s): return np.zeros(3), np.zeros(3)
    >>> exact = LocalisationSettings(wander_m=0, white_m=0)
    >>> localisation(exact, start_ns=0, seed=1).claims_until(Standing(), 0.0)[0].position_m
    array([3., 4., 0.])
    """
    s = settings
    return PositionSensor(
        source=source,
        frame_id="map",
        kind="localisation",
        sampling=Sampling(rate_hz=s.rate_hz, start_ns=start_ns),
        seed=seed,
        wander_m=np.full(3, s.wander_m),
        correlation_s=s.correlation_s,
        white_m=s.white_m,
        arrival=s.arrival,
    )
