"""What all sensors share: when they measure, when it arrives, their random numbers, and slowly wandering errors."""

from __future__ import annotations

import math
import zlib
from typing import Protocol

import numpy as np
from pydantic import Field, model_validator

from belie.geometry import SE3, FloatArray
from belie.types import Settings

NS_PER_S = 1_000_000_000


class Motion(Protocol):
    """How a body moves; `belie.simulation.motion` has motions that are known, the closed loop one that is driven."""

    def T_world_body(self, t_s: float) -> SE3:
        """Where the body is, seconds from the start."""
        ...

    def twist(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Linear (m/s) and angular (rad/s) velocity in body axes, shapes (3,)."""
        ...


class Arrival(Settings):
    """How late a sensor's messages are received.

    >>> Arrival(delay_ms=10, jitter_ms=2).received_ns(0, np.random.default_rng(0)) / 1e6
    10.547847
    """

    delay_ms: float = Field(
        description="from the measurement to its arrival, on average [ms]", ge=1.0, le=60.0
    )
    jitter_ms: float = Field(description="the delay varies evenly by up to this [ms]", ge=0.0)

    @model_validator(mode="after")
    def _later(self) -> Arrival:
        if self.jitter_ms >= self.delay_ms:
            raise ValueError("jitter_ms must be less than delay_ms: nothing arrives before it is measured")
        return self

    def received_ns(self, stamp_ns: int, rng: np.random.Generator) -> int:
        """When a message of that stamp is received, ns."""
        return stamp_ns + round((self.delay_ms + self.jitter_ms * rng.uniform(-1.0, 1.0)) * 1e6)


class Sampling:
    """The moments at which a sensor measures, handed out in order and once.

    Examples
    --------
    >>> sampling = Sampling(rate_hz=50.0, start_ns=1000)
    >>> sampling.until(0.05)
    [0.0, 0.02, 0.04]
    >>> sampling.until(0.06), sampling.stamp_ns(0.06)
    ([0.06], 60001000)
    """

    def __init__(self, *, rate_hz: float, start_ns: int) -> None:
        self.rate_hz, self.start_ns = rate_hz, start_ns
        self._next = 0

    def until(self, stop_s: float) -> list[float]:
        """Seconds since the start of every measurement up to `stop_s` that was not handed out before."""
        due = []
        # Half a nanosecond: k / rate is not exact, and a measurement at the very moment belongs to it.
        while self.rate_hz > 0.0 and self._next / self.rate_hz <= stop_s + 5e-10:
            due.append(self._next / self.rate_hz)
            self._next += 1
        return due

    def stamp_ns(self, t_s: float) -> int:
        """Header stamp of a moment, ns."""
        return self.start_ns + round(t_s * NS_PER_S)


def generator(seed: int, source: str) -> np.random.Generator:
    """Random numbers of one sensor: independent of all others, and the same for the same seed.

    >>> bool(generator(1, "/imu").normal() == generator(1, "/imu").normal())
    True
    """
    return np.random.default_rng([seed, zlib.crc32(source.encode())])


class GaussMarkov:
    """A first-order Gauss-Markov process for each axis: an error that wanders, and forgets within a time.

    ``x(t + dt) = e^(-dt / tau) x(t) + sqrt(1 - e^(-2 dt / tau)) sigma n``; stationary from the first sample on
    (Brown and Hwang, *Introduction to Random Signals and Applied Kalman Filtering*, section 3.6).

    Examples
    --------
    >>> wander = GaussMarkov(np.array([2.0]), 10.0, np.random.default_rng(0))
    >>> draws = np.array([wander.at(100.0 * k) for k in range(2000)])
    >>> bool(abs(draws.std() - 2.0) < 0.1)
    True
    """

    def __init__(self, sigma: FloatArray, tau_s: float, rng: np.random.Generator) -> None:
        self._sigma, self._tau_s, self._rng = sigma, tau_s, rng
        self._t_s = 0.0
        self._value = sigma * rng.normal(size=sigma.shape)

    def at(self, t_s: float) -> FloatArray:
        """The error at `t_s`, which never runs backwards; shape of sigma."""
        kept = math.exp(-(t_s - self._t_s) / self._tau_s)
        fresh = self._rng.normal(size=self._sigma.shape)
        self._value = kept * self._value + math.sqrt(1.0 - kept * kept) * self._sigma * fresh
        self._t_s = t_s
        return self._value
