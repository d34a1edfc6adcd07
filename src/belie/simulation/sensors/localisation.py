"""A localisation in a map, as from LiDAR: positions of the body with a small, wandering error."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from belie.simulation.sensors.sampling import Arrival, GaussMarkov, Motion, Sampling, generator
from belie.types import Claim, PositionClaim, Settings


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


class Localisation:
    """Positions of the body's origin in the frame ``map``, which is the world.

    Examples
    --------
    >>> from belie.geometry import SE3
    >>> class Standing:
    ...     def T_world_body(self, t_s): return SE3.from_translation([3.0, 4.0, 0.0])
    ...     def twist(self, t_s): return np.zeros(3), np.zeros(3)
    >>> exact = LocalisationSettings(wander_m=0, white_m=0)
    >>> Localisation(exact, start_ns=0, seed=1).claims_until(Standing(), 0.0)[0].position_m
    array([3., 4., 0.])
    """

    def __init__(
        self, settings: LocalisationSettings, *, start_ns: int, seed: int, source: str = "/localization/pose"
    ) -> None:
        s = self._settings = settings
        self._source = source
        self._sampling = Sampling(rate_hz=s.rate_hz, start_ns=start_ns)
        self._rng = generator(seed, source)
        self._wander = GaussMarkov(np.full(3, s.wander_m), s.correlation_s, self._rng)
        variance = s.wander_m**2 + s.white_m**2
        self._covariance = variance * np.eye(3) if variance > 0.0 else None

    def claims_until(self, motion: Motion, stop_s: float) -> list[Claim]:
        """The positions up to `stop_s` that were not handed out before."""
        return [self._position(motion, t_s) for t_s in self._sampling.until(stop_s)]

    def _position(self, motion: Motion, t_s: float) -> PositionClaim:
        s = self._settings
        stamp_ns = self._sampling.stamp_ns(t_s)
        error = self._wander.at(t_s) + s.white_m * self._rng.normal(size=3)
        return PositionClaim(
            source=self._source,
            frame_id="map",
            kind="localisation",
            stamp_ns=stamp_ns,
            received_ns=s.arrival.received_ns(stamp_ns, self._rng),
            position_m=motion.T_world_body(t_s).t + error,
            covariance=self._covariance,
        )
