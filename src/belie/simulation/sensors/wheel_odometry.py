"""Odometry from the wheels: distance and heading add up, and so do their errors."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from belie.geometry import SE3
from belie.simulation.sensors.sampling import Arrival, Motion, Sampling, generator
from belie.types import Claim, MotionClaim, PoseClaim, Settings


class WheelOdometrySettings(Settings):
    """Errors of an odometry that adds up its steps.

    >>> WheelOdometrySettings().rate_hz
    50.0
    """

    rate_hz: float = Field(50.0, description="messages; 0 leaves the sensor out [Hz]", ge=0.0, le=500.0)
    planar: bool = Field(
        True,
        description="wheels: forward motion and heading on a plane; false: all six degrees of freedom, as a "
        "drone's optical flow and inertial sensors give them",
    )
    scale: float = Field(
        0.005,
        description="error of the distance, standard deviation, constant over a drive: tyre diameter changes with "
        "pressure, load and wear (Borenstein and Feng, IEEE T-RA 12(6), 1996); typical [1]",
        ge=0.0,
    )
    distance_noise_m_rt_m: float = Field(
        0.004,
        description="random error of the distance, uneven ground (Thrun et al., Probabilistic Robotics, 5.4: "
        "variance grows with distance); typical [m per sqrt(m)]",
        ge=0.0,
    )
    slip_s2_m: float = Field(
        0.003,
        description="longitudinal slip per acceleration: a typical slip stiffness of 20 to 30 wheel loads, "
        "shared over four wheels [1 per m/s²]",
        ge=0.0,
    )
    heading_noise_deg_rt_m: float = Field(
        0.03, description="random error of the heading [deg per sqrt(m)]", ge=0.0
    )
    heading_drift_deg_m: float = Field(
        0.005,
        description="constant drift of the heading, standard deviation: unequal wheel diameters; typical: "
        "5 deg in a kilometre [deg/m]",
        ge=0.0,
    )
    yaw_scale: float = Field(
        0.01, description="relative error of a turn, standard deviation: the effective track [1]", ge=0.0
    )
    standstill_noise_m: float = Field(
        0.0001, description="noise of a step, moving or not: encoder ticks [m]", ge=0.0
    )
    arrival: Arrival = Arrival(delay_ms=8.0, jitter_ms=3.0)


class WheelOdometry:
    """Adds up the true steps with errors, from the identity on; pose and twist in one message.

    Examples
    --------
    >>> class Driving:
    ...     def T_world_body(self, t_s): return SE3.from_translation([5.0 * t_s, 0.0, 0.3])
    ...     def twist(self, t_s): return np.array([5.0, 0.0, 0.0]), np.zeros(3)
    >>> perfect = WheelOdometrySettings(scale=0, distance_noise_m_rt_m=0, heading_noise_deg_rt_m=0,
    ...                                 heading_drift_deg_m=0, standstill_noise_m=0)
    >>> claims = WheelOdometry(perfect, start_ns=0, seed=1).claims_until(Driving(), 2.0)
    >>> claims[-2].T_odom_body.t.round(6), claims[-1].linear_m_s.round(6)
    (array([10.,  0.,  0.]), array([5., 0., 0.]))
    """

    def __init__(
        self, settings: WheelOdometrySettings, *, start_ns: int, seed: int, source: str = "/odom"
    ) -> None:
        s = self._settings = settings
        self._source = source
        self._sampling = Sampling(rate_hz=s.rate_hz, start_ns=start_ns)
        self._rng = rng = generator(seed, source)
        self._gain = 1.0 + s.scale * rng.normal()
        self._yaw_gain = 1.0 + s.yaw_scale * rng.normal()
        self._drift_rad_m = math.radians(s.heading_drift_deg_m) * rng.normal()
        self._T_odom_body = SE3.identity()
        self._T_world_last: SE3 | None = None
        self._speed_m_s = 0.0

    def claims_until(self, motion: Motion, stop_s: float) -> list[Claim]:
        """The messages up to `stop_s` that were not handed out before: a pose and a twist each."""
        claims: list[Claim] = []
        for t_s in self._sampling.until(stop_s):
            claims += self._message(motion, t_s)
        return claims

    def _message(self, motion: Motion, t_s: float) -> tuple[PoseClaim, MotionClaim]:
        s, dt = self._settings, 1.0 / self._settings.rate_hz
        T_world_body = _level(motion.T_world_body(t_s)) if s.planar else motion.T_world_body(t_s)
        if self._T_world_last is None:
            linear, angular = motion.twist(t_s)
            self._speed_m_s = float(np.linalg.norm(linear))
            rates = np.concatenate([linear, angular]) * ([1, 0, 0, 0, 0, 1] if s.planar else [1] * 6)
        else:
            step = self._measured(self._T_world_last.inverse() @ T_world_body, dt)
            self._T_odom_body = self._T_odom_body @ SE3.exp(step)
            rates = step / dt
        self._T_world_last = T_world_body
        stamp_ns = self._sampling.stamp_ns(t_s)
        received_ns = s.arrival.received_ns(stamp_ns, self._rng)
        pose = PoseClaim(
            source=self._source,
            frame_id="odom",
            stamp_ns=stamp_ns,
            received_ns=received_ns,
            T_odom_body=self._T_odom_body,
        )
        twist = MotionClaim(
            source=self._source,
            kind="twist",
            stamp_ns=stamp_ns,
            received_ns=received_ns,
            linear_m_s=rates[:3],
            angular_rad_s=rates[3:],
        )
        return pose, twist

    def _measured(self, T_last_now: SE3, dt: float) -> np.ndarray:
        """The true step with errors, as a twist (6,) over the step."""
        s, rng = self._settings, self._rng
        step = T_last_now.log()
        distance_m = float(np.linalg.norm(step[:3]))
        speed_m_s = distance_m / dt
        slip = s.slip_s2_m * (speed_m_s - self._speed_m_s) / dt
        self._speed_m_s = speed_m_s
        ahead = step[:3] / distance_m if distance_m > 1e-9 else np.array([1.0, 0.0, 0.0])
        noise_m = s.distance_noise_m_rt_m * math.sqrt(distance_m) * rng.normal()
        step[:3] = (self._gain + slip) * step[:3] + noise_m * ahead
        step[5] = self._yaw_gain * step[5] + self._drift_rad_m * distance_m
        turned = math.radians(s.heading_noise_deg_rt_m) * math.sqrt(distance_m)
        if s.planar:
            step[0] += s.standstill_noise_m * rng.normal()
            step[5] += turned * rng.normal()
        else:
            step[:3] += s.standstill_noise_m * rng.normal(size=3)
            step[3:] += turned * rng.normal(size=3)
        return step


def _level(T_world_body: SE3) -> SE3:
    """The pose of the body's shadow on the ground plane: x, y and heading."""
    ahead = T_world_body.R[:, 0]
    yaw = math.atan2(ahead[1], ahead[0])
    cosine, sine = math.cos(yaw), math.sin(yaw)
    R = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return SE3(R, np.array([T_world_body.t[0], T_world_body.t[1], 0.0]))
