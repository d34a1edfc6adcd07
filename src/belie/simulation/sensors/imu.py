"""An inertial sensor: angular rate and specific force with bias, random walk and noise, as the BMI055 has them."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from belie.geometry import FloatArray
from belie.simulation.sensors.sampling import Arrival, Motion, Sampling, generator
from belie.types import Claim, MotionClaim, Settings

GRAVITY_M_S2 = np.array([0.0, 0.0, 9.80665])


class ImuSettings(Settings):
    """Errors of an inertial sensor; the defaults are those of Bosch's BMI055, as in a RealSense D435i.

    >>> ImuSettings().rate_hz
    200.0
    """

    rate_hz: float = Field(200.0, description="measurements; 0 leaves the sensor out [Hz]", ge=0.0, le=1000.0)
    gyro_noise_deg_s_rt_hz: float = Field(
        0.014, description="noise density of the angular rate; BMI055 [deg/s per sqrt(Hz)]", ge=0.0
    )
    gyro_walk_deg_s2_rt_hz: float = Field(
        0.0011,
        description="random walk of its bias; 1.9e-5 rad/s², measured on a D435i (ORB-SLAM3, issue 125) "
        "[deg/s² per sqrt(Hz)]",
        ge=0.0,
    )
    gyro_bias_deg_s: float = Field(
        0.33,
        description="bias at the start, standard deviation; BMI055's typical offset of 1 deg/s taken as three of them "
        "[deg/s]",
        ge=0.0,
    )
    gyro_scale: float = Field(
        0.0033,
        description="error of its scale, standard deviation; typical of such sensors [1]",
        ge=0.0,
    )
    accelerometer_noise_m_s2_rt_hz: float = Field(
        0.00147,
        description="noise density of the force; 150 µg, BMI055 [m/s² per sqrt(Hz)]",
        ge=0.0,
    )
    accelerometer_walk_m_s3_rt_hz: float = Field(
        6.3e-5,
        description="random walk of its bias; measured on a D435i with Kalibr (VINS-Mono, issue 472) "
        "[m/s³ per sqrt(Hz)]",
        ge=0.0,
    )
    accelerometer_bias_m_s2: float = Field(
        0.23,
        description="bias at the start, standard deviation; 70 mg, typical of such sensors, taken as three of them "
        "[m/s²]",
        ge=0.0,
    )
    arrival: Arrival = Arrival(delay_ms=2.0, jitter_ms=0.8)


class Imu:
    """An inertial sensor at the body's origin, in body axes.

    Noise densities become samples by ``sigma = density * sqrt(rate)``, random walks by ``density * sqrt(dt)``
    (Kalibr's wiki, "IMU Noise Model").

    Examples
    --------
    >>> from belie.geometry import SE3
    >>> class Standing:
    ...     def T_world_body(self, t_s): return SE3.identity()
    ...     def twist(self, t_s): return np.zeros(3), np.zeros(3)
    >>> claims = Imu(ImuSettings(), start_ns=0, seed=1).claims_until(Standing(), 1.0)
    >>> len(claims), bool(abs(claims[0].acceleration_m_s2[2] - 9.8) < 1.0)
    (201, True)
    """

    def __init__(self, settings: ImuSettings, *, start_ns: int, seed: int, source: str = "/imu/data") -> None:
        s = self._settings = settings
        self._source = source
        self._sampling = Sampling(rate_hz=s.rate_hz, start_ns=start_ns)
        self._rng = rng = generator(seed, source)
        self._gyro_bias = math.radians(s.gyro_bias_deg_s) * rng.normal(size=3)
        self._gain = 1.0 + s.gyro_scale * rng.normal(size=3)
        self._force_bias = s.accelerometer_bias_m_s2 * rng.normal(size=3)
        self._velocity: FloatArray | None = None
        self._gyro_sigma = math.radians(s.gyro_noise_deg_s_rt_hz) * math.sqrt(s.rate_hz)
        self._force_sigma = s.accelerometer_noise_m_s2_rt_hz * math.sqrt(s.rate_hz)

    def claims_until(self, motion: Motion, stop_s: float) -> list[Claim]:
        """The measurements up to `stop_s` that were not handed out before."""
        return [self._measure(motion, t_s) for t_s in self._sampling.until(stop_s)]

    def _measure(self, motion: Motion, t_s: float) -> MotionClaim:
        s, rng = self._settings, self._rng
        walk = math.sqrt(1.0 / s.rate_hz)
        self._gyro_bias = self._gyro_bias + math.radians(s.gyro_walk_deg_s2_rt_hz) * walk * rng.normal(size=3)
        self._force_bias = self._force_bias + s.accelerometer_walk_m_s3_rt_hz * walk * rng.normal(size=3)
        linear, angular = motion.twist(t_s)
        R_world_body = motion.T_world_body(t_s).R
        velocity = R_world_body @ linear
        force = specific_force(R_world_body, velocity, self._velocity, 1.0 / s.rate_hz)
        self._velocity = velocity
        stamp_ns = self._sampling.stamp_ns(t_s)
        covariance = np.zeros((6, 6))
        covariance[3:, 3:] = self._gyro_sigma**2 * np.eye(3)
        return MotionClaim(
            source=self._source,
            kind="imu",
            stamp_ns=stamp_ns,
            received_ns=s.arrival.received_ns(stamp_ns, rng),
            angular_rad_s=self._gain * angular + self._gyro_bias + self._gyro_sigma * rng.normal(size=3),
            acceleration_m_s2=force + self._force_bias + self._force_sigma * rng.normal(size=3),
            covariance=covariance if self._gyro_sigma > 0.0 else None,
        )


def specific_force(
    R_world_body: FloatArray, velocity: FloatArray, velocity_before: FloatArray | None, interval_s: float
) -> FloatArray:
    """What an ideal accelerometer feels over an interval: acceleration less gravity, in body axes.

    The past alone is asked for, so that it can be felt while driving; before the start the body moved evenly.

    Parameters
    ----------
    R_world_body : array (3, 3)
        Attitude at the interval's end.
    velocity, velocity_before : array (3,)
        Of the body, world axes, at the interval's end and beginning (None: the same).
    interval_s : float
        Its length.

    Examples
    --------
    >>> specific_force(np.eye(3), np.array([0.1, 0.0, 0.0]), np.zeros(3), 0.1)
    array([1.     , 0.     , 9.80665])
    """
    before = velocity if velocity_before is None else velocity_before
    return np.asarray(R_world_body.T @ ((velocity - before) / interval_s + GRAVITY_M_S2))
