"""How positions are related to the odometry: rotation, scale, offset, antenna, delay, and their drift.

    p = m + o + R_map_odom R_odom_body l - v d + c + noise,    m <- m + R_map_odom Δq (1 + e)

m is the dead-reckoned position, Δq the odometry's displacement since the last claim, o the error of m, e
that of the scale, l the lever arm's, d the delay at velocity v, c the slow noise of the position
(Gauss-Markov). The rotation error α turns what is travelled *from now on*, so the pivot is always here and a
distant origin does no harm. An error-state Kalman filter (Sola, "Quaternion kinematics for the error-state
Kalman filter", 2017) carries it.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from belie.checks.position_settings import PositionSettings
from belie.checks.systematic import SystematicErrors
from belie.geometry import SE3, FloatArray, skew, so3_exp

ROTATION, SCALE, OFFSET, SLOW = slice(0, 3), 3, slice(4, 7), slice(7, 10)
LEVER, DELAY = slice(10, 13), 13
_PARAMETERS = 14
_UNBOUNDED = 1e6
_BLIND_HEADING_DEG = 5.0
_MEMORY_INTERVAL_S = 0.5
_MEMORIES = 120


@dataclass(frozen=True, slots=True, kw_only=True)
class _Memory:
    """The filter after some believed claim."""

    stamp_ns: int
    R_map_odom: FloatArray
    T_odom_body: SE3
    position_m: FloatArray
    mean: FloatArray
    covariance: FloatArray


class Alignment:
    """Predicts the next position from the odometry, with everything that is uncertain about it.

    Parameters
    ----------
    settings : PositionSettings
    R_map_odom : array (3, 3)
        First estimate of the rotation from odometry to the position's frame.
    rotation_sigma_rad : array (3,)
        Its standard deviation about the axes of the position's frame.
    position_m, T_odom_body
        The first position, shape (3,), and the odometry at that time.
    offset_sigma_m : array (3,)
        How far off that position may be.
    lever_sigma_m : float
        Error of the place on the body at which the position is taken.

    Examples
    --------
    >>> alignment = Alignment(PositionSettings(), np.eye(3), np.zeros(3), np.zeros(3), SE3.identity(),
    ...                       offset_sigma_m=np.ones(3), lever_sigma_m=0.0)
    >>> alignment.advance(SE3.from_translation([1.0, 0, 0]), 0.1, np.full(3, 0.1))
    >>> alignment.residual(np.array([1.5, 0.0, 0.0]))
    array([0.5, 0. , 0. ])
    """

    def __init__(
        self,
        settings: PositionSettings,
        R_map_odom: FloatArray,
        rotation_sigma_rad: FloatArray,
        position_m: FloatArray,
        T_odom_body: SE3,
        *,
        offset_sigma_m: FloatArray,
        lever_sigma_m: float,
    ) -> None:
        self._settings = settings
        self._R_map_odom = R_map_odom
        self._T_odom_body = T_odom_body
        self._velocity_m_s = np.zeros(3)
        self.position_m = np.array(position_m)
        # Offset and slow noise are bounded by their own process, not by SystematicErrors' prior.
        prior = np.full(_PARAMETERS, _UNBOUNDED)
        self.errors = SystematicErrors(prior, np.ones(_PARAMETERS))
        sigma = np.zeros(_PARAMETERS)
        sigma[ROTATION], sigma[SCALE], sigma[OFFSET] = (
            rotation_sigma_rad,
            settings.scale_sigma,
            offset_sigma_m,
        )
        sigma[LEVER], sigma[DELAY] = lever_sigma_m, settings.clock_sigma_s
        self._memories: deque[_Memory] = deque(maxlen=_MEMORIES)
        self.errors.covariance = np.diag(sigma**2)

    @property
    def velocity_m_s(self) -> FloatArray:
        """Velocity by the odometry, in the position's frame, shape (3,)."""
        return self._velocity_m_s

    @property
    def heading_sigma_rad(self) -> float:
        """Standard deviation of the rotation about z."""
        return math.sqrt(max(float(self.errors.covariance[2, 2]), 0.0))

    def residual(self, position_m: FloatArray) -> FloatArray:
        """Position minus dead reckoning, before the filter's parameters are taken off, shape (3,)."""
        return np.asarray(position_m - self.position_m)

    def wander(self, position_m: FloatArray) -> FloatArray:
        """Position minus dead reckoning, antenna and delay taken off: offset and noise, shape (3,)."""
        H = self.jacobian()
        known = H[:, LEVER] @ self.errors.mean[LEVER] + H[:, DELAY] * self.errors.mean[DELAY]
        return np.asarray(self.residual(position_m) - known)

    def advance(self, T_odom_body: SE3, interval_s: float, walk_m: FloatArray) -> None:
        """Go on to `T_odom_body`, `interval_s` later; `walk_m`, shape (3,): slow noise, m per sqrt(s)."""
        s = self._settings
        v = self._R_map_odom @ (T_odom_body.t - self._T_odom_body.t)
        distance_m = float(np.linalg.norm(v))
        self._T_odom_body = T_odom_body
        self._velocity_m_s = v / interval_s
        self.position_m = self.position_m + v * (1.0 + self.errors.mean[SCALE])
        fade = math.exp(-interval_s / s.multipath_time_s)
        F = np.eye(_PARAMETERS)
        F[OFFSET, ROTATION], F[OFFSET, SCALE] = -skew(v), v
        F[SLOW, SLOW] *= fade
        self.errors.mean[SLOW] *= fade  # rotation and scale are in `position_m` already
        self.errors.covariance = F @ self.errors.covariance @ F.T
        Q = np.zeros(_PARAMETERS)
        Q[ROTATION] = math.radians(s.heading_walk_deg) ** 2 * distance_m
        Q[SCALE] = s.scale_walk**2 * distance_m
        Q[OFFSET] = s.odometry_walk_m**2 * distance_m + s.standing_walk_m**2 * interval_s
        Q[SLOW] = walk_m**2 * 0.5 * s.multipath_time_s * (1.0 - fade**2)
        self.errors.predict(Q)

    def widen(self, distance_m: float) -> None:
        """Allow for an unseen error of `distance_m` (and of heading): the odometry was lost in between."""
        P = self.errors.covariance
        P[OFFSET, OFFSET] += distance_m**2 * np.eye(3)
        P[ROTATION, ROTATION] += math.radians(_BLIND_HEADING_DEG) ** 2 * np.eye(3)

    def jacobian(self) -> FloatArray:
        """H of the residual with respect to the parameters, shape (3, 14)."""
        H = np.zeros((3, _PARAMETERS))
        H[:, OFFSET] = H[:, SLOW] = np.eye(3)
        H[:, LEVER] = self._R_map_odom @ self._T_odom_body.R
        H[:, DELAY] = -self._velocity_m_s
        return H

    def settle(self) -> None:
        """Fold the learned rotation into the estimate, so that the next step is linear again."""
        self._R_map_odom = so3_exp(self.errors.mean[ROTATION]) @ self._R_map_odom
        self.errors.mean[ROTATION] = 0.0

    def remember(self, stamp_ns: int) -> None:
        """Keep the filter as it is now, every half second, for `take_back`."""
        if self._memories and stamp_ns - self._memories[-1].stamp_ns < _MEMORY_INTERVAL_S * 1e9:
            return
        self._memories.append(
            _Memory(
                stamp_ns=stamp_ns, R_map_odom=self._R_map_odom, T_odom_body=self._T_odom_body,
                position_m=self.position_m,
                mean=self.errors.mean.copy(), covariance=self.errors.covariance.copy(),
            )
        )  # fmt: skip

    def take_back(self, onset_ns: int, stamp_ns: int, walk_m: FloatArray) -> None:
        """Unlearn what was believed since `onset_ns`, and go on from there to now by odometry alone."""
        while len(self._memories) > 1 and self._memories[-1].stamp_ns > onset_ns:
            self._memories.pop()
        if not self._memories:
            return
        then, T_odom_body, velocity_m_s = self._memories[-1], self._T_odom_body, self._velocity_m_s
        self._R_map_odom, self._T_odom_body = then.R_map_odom, then.T_odom_body
        self.position_m = then.position_m
        self.errors.mean, self.errors.covariance = then.mean.copy(), then.covariance.copy()
        self.advance(T_odom_body, max((stamp_ns - then.stamp_ns) * 1e-9, 1e-3), walk_m)
        self._velocity_m_s = velocity_m_s

    def absorbed(self, noise: FloatArray) -> FloatArray:
        """Share of an innovation that the filter takes in at once (its gain, 0 to 1), along each axis, (3,).

        `noise` is the covariance R of the last claim, shape (3, 3). After the update, ``H P H' = K R``.
        """
        H = self.jacobian()
        taken = np.diag(H @ self.errors.covariance @ H.T) / np.diag(noise)
        return np.asarray(np.clip(taken, 1e-4, 1.0))
