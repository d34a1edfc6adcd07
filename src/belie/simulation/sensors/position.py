"""What GNSS and localisation share: a position of a point on the body, with errors old and new."""

from __future__ import annotations

from typing import Literal

import numpy as np

from belie.geometry import FloatArray
from belie.simulation.sensors.sampling import Arrival, GaussMarkov, Motion, Sampling, generator
from belie.types import Claim, PositionClaim


class PositionSensor:
    """Positions in the world's axes, with the covariance of their true errors.

    Parameters
    ----------
    source, frame_id, kind : str
        Of the claims.
    sampling : Sampling
        When it measures.
    seed : int
        Of its errors.
    wander_m : array (3,)
        Standard deviation of the wandering error, each axis.
    correlation_s : float
        Time in which that is forgotten.
    white_m : float
        Standard deviation of the error that is new every time, each axis.
    arrival : Arrival
        How late its messages come.
    lever_m : array (3,), optional
        Which point of the body, body axes; by default its origin.
    """

    def __init__(
        self,
        *,
        source: str,
        frame_id: str,
        kind: Literal["gnss", "localisation"],
        sampling: Sampling,
        seed: int,
        wander_m: FloatArray,
        correlation_s: float,
        white_m: float,
        arrival: Arrival,
        lever_m: FloatArray | None = None,
    ) -> None:
        self._source, self._frame_id = source, frame_id
        self._kind: Literal["gnss", "localisation"] = kind
        self._sampling, self._arrival, self._lever_m = sampling, arrival, lever_m
        self._rng = generator(seed, source)
        self._wander, self._white_m = GaussMarkov(wander_m, correlation_s, self._rng), white_m
        variance = wander_m**2 + white_m**2
        self._covariance = np.diag(variance) if variance.min() > 0.0 else None

    def claims_until(self, motion: Motion, stop_s: float) -> list[Claim]:
        """The positions up to `stop_s` that were not handed out before."""
        return [self._position(motion, t_s) for t_s in self._sampling.until(stop_s)]

    def _position(self, motion: Motion, t_s: float) -> PositionClaim:
        T_world_body = motion.T_world_body(t_s)
        lever_m = np.zeros(3) if self._lever_m is None else self._lever_m
        stamp_ns = self._sampling.stamp_ns(t_s)
        error = self._wander.at(t_s) + self._white_m * self._rng.normal(size=3)
        return PositionClaim(
            source=self._source,
            frame_id=self._frame_id,
            kind=self._kind,
            stamp_ns=stamp_ns,
            received_ns=self._arrival.received_ns(stamp_ns, self._rng),
            position_m=T_world_body.t + T_world_body.R @ lever_m + error,
            covariance=self._covariance,
            lever_m=self._lever_m,
        )
