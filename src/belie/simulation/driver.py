"""A driver that believes what it is told: it keeps its lane and its gap by the claimed state alone."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

import numpy as np
from pydantic import Field

from belie.geometry import SE3, FloatArray, so3_exp
from belie.types import Claim, DetectionClaim, MotionClaim, PoseClaim, PositionClaim, Settings

_KEPT_NS = 3_000_000_000
_BUMPERS_M = 5.8  # a car's front lies 3.6 m before its rear axle, its tail 2.2 m behind its middle
_REMEMBERED_NS = 500_000_000  # what stands ahead, over a message that misses it


class DriverSettings(Settings):
    """How the driver steers and follows.

    >>> DriverSettings().look_ahead_s
    0.9
    """

    look_ahead_s: float = Field(0.9, description="pure pursuit aims at the lane this far ahead [s]", gt=0.0)
    look_ahead_least_m: float = Field(6.0, description="but no nearer than this [m]", gt=0.0)
    acceleration_m_s2: float = Field(1.5, description="IDM: comfortable acceleration [m/s²]", gt=0.0)
    braking_m_s2: float = Field(2.0, description="IDM: comfortable braking [m/s²]", gt=0.0)
    gap_s: float = Field(1.5, description="IDM: time gap to the vehicle ahead [s]", gt=0.0)
    gap_least_m: float = Field(3.0, description="IDM: gap at standstill [m]", gt=0.0)
    correction_s: float = Field(
        2.0,
        description="time in which a position corrects the odometry; a filter between a precise odometry and a "
        "coarse position [s]",
        gt=0.0,
    )
    lane_share_m: float = Field(
        1.4, description="an object nearer than this to the path ahead is in the way [m]", gt=0.0
    )


class ClaimedState:
    """Where the vehicle believes to be: odometry added up, and slowly corrected by a localisation if it has one.

    A second-order observer (Luenberger) with both poles at ``-1 / correction_s``: the position error e corrects the
    position by ``2 e / tau`` and, by its part across the way, the heading by ``e / (v tau²)``.

    Examples
    --------
    >>> state = ClaimedState(SE3.from_translation([5.0, 0.0, 0.0]), speed_m_s=1.0, correction_s=2.0)
    >>> state.take([PoseClaim(source="/odom", frame_id="odom", stamp_ns=t, received_ns=t,
    ...                       T_odom_body=SE3.from_translation([t * 1e-9, 0.0, 0.0])) for t in (0, 10**9)])
    >>> state.T_world_body.t, round(state.speed_m_s, 3)
    (array([6., 0., 0.]), 1.0)
    """

    def __init__(self, T_world_body: SE3, *, speed_m_s: float, correction_s: float) -> None:
        self.T_world_body = T_world_body
        self.speed_m_s = speed_m_s
        self._tau_s = correction_s
        self._past: deque[tuple[int, SE3, float]] = deque()
        self._odometry: PoseClaim | None = None
        self._rates: deque[tuple[int, float]] = deque()
        self._gyro_bias, self._compared = 0.0, 0
        self._corrected_ns: dict[str, int] = {}
        self.untrusted: frozenset[str] = frozenset()

    def take(self, claims: Iterable[Claim]) -> None:
        """Believe new claims, in the order of their stamps; those of `untrusted` sources are passed over."""
        for claim in sorted(claims, key=lambda claim: claim.stamp_ns):
            if claim.source in self.untrusted:
                continue
            if isinstance(claim, PoseClaim):
                self._step(claim)
            elif isinstance(claim, PositionClaim) and claim.kind == "localisation":
                self._correct(claim)  # a lane is too narrow for GNSS
            elif isinstance(claim, MotionClaim) and claim.kind == "imu" and claim.angular_rad_s is not None:
                self._turn(claim.stamp_ns, float(claim.angular_rad_s[2]))

    def distrust(self, source: str, since_ns: int) -> None:
        """Go back to where the state was before a source lied, and dead-reckon on the gyroscope from there."""
        self.untrusted = self.untrusted | {source}
        if self._odometry is None or source != self._odometry.source:
            return
        honest = [entry for entry in self._past if entry[0] < since_ns] or list(self._past)[:1]
        if not honest:
            return
        since_ns, self.T_world_body, self.speed_m_s = honest[-1]
        last_ns = since_ns
        for stamp_ns, rate in self._rates:
            if stamp_ns > since_ns:
                self._reckon((stamp_ns - last_ns) * 1e-9, rate)
                last_ns = stamp_ns

    def slow_down(self, deceleration_m_s2: float, interval_s: float) -> None:
        """Take one's own braking into account, where nobody else is trusted to tell the speed."""
        if self._odometry is not None and self._odometry.source in self.untrusted:
            self.speed_m_s = max(0.0, self.speed_m_s - deceleration_m_s2 * interval_s)

    def _reckon(self, interval_s: float, yaw_rate: float) -> None:
        self._move(self.speed_m_s * interval_s, (yaw_rate - self._gyro_bias) * interval_s)

    def _move(self, distance_m: float, turn_rad: float) -> None:
        step = SE3(so3_exp(np.array([0.0, 0.0, turn_rad])), np.array([distance_m, 0.0, 0.0]))
        self.T_world_body = self.T_world_body @ step

    def _step(self, claim: PoseClaim) -> None:
        last, self._odometry = self._odometry, claim
        if last is None or claim.source != last.source or claim.stamp_ns <= last.stamp_ns:
            return
        step = last.T_odom_body.inverse() @ claim.T_odom_body
        interval_s = (claim.stamp_ns - last.stamp_ns) * 1e-9
        self.T_world_body = self.T_world_body @ step
        # Forward speed from the steps, smoothed over a tenth of a second: single steps are noisy.
        share = 1.0 - math.exp(-interval_s / 0.1)
        self.speed_m_s += share * (float(step.t[0]) / interval_s - self.speed_m_s)
        self._learn_bias(float(step.log()[5]) / interval_s)
        self._remember(claim.stamp_ns)

    def _learn_bias(self, yaw_rate: float) -> None:
        """The gyroscope's bias against the odometry: the mean of up to the last five seconds."""
        if self._rates:
            self._compared = min(self._compared + 1, 250)
            self._gyro_bias += (self._rates[-1][1] - yaw_rate - self._gyro_bias) / self._compared

    def _turn(self, stamp_ns: int, yaw_rate: float) -> None:
        last = self._rates[-1] if self._rates else None
        self._rates.append((stamp_ns, yaw_rate))
        while self._rates[0][0] < stamp_ns - _KEPT_NS:
            self._rates.popleft()
        if last is not None and self._odometry is not None and self._odometry.source in self.untrusted:
            self._reckon((stamp_ns - last[0]) * 1e-9, yaw_rate)

    def _correct(self, claim: PositionClaim) -> None:
        if not self._past:
            return
        then = min(self._past, key=lambda entry: abs(entry[0] - claim.stamp_ns))[1]
        error = claim.position_m - then.t
        if claim.lever_m is not None:
            error = error - then.R @ claim.lever_m
        last_ns = self._corrected_ns.get(claim.source, claim.stamp_ns)
        self._corrected_ns[claim.source] = claim.stamp_ns
        interval_s = min((claim.stamp_ns - last_ns) * 1e-9, self._tau_s)
        across_m = float(then.R[:, 1] @ error)
        turn = across_m / (max(self.speed_m_s, 3.0) * self._tau_s**2) * interval_s
        shifted = self.T_world_body.t + 2.0 / self._tau_s * interval_s * error
        self.T_world_body = SE3(so3_exp(np.array([0.0, 0.0, turn])) @ self.T_world_body.R, shifted)

    def _remember(self, stamp_ns: int) -> None:
        self._past.append((stamp_ns, self.T_world_body, self.speed_m_s))
        while self._past[0][0] < stamp_ns - _KEPT_NS:
            self._past.popleft()


class Driver:
    """Lane keeping by pure pursuit (Coulter, 1992), gap keeping by the intelligent driver model (Treiber, 2000).

    Parameters
    ----------
    settings : DriverSettings
        How it steers and follows.
    lane : array (N, 3)
        Middle of the lane, world, in the order of travel.
    target_m_s : float
        Speed on a free road.
    wheelbase_m : float
        Of the vehicle.
    T_body_cam : SE3
        Brings detections to the body.

    Examples
    --------
    >>> lane = np.column_stack([np.linspace(0.0, 100.0, 101), np.zeros(101), np.zeros(101)])
    >>> driver = Driver(DriverSettings(), lane, target_m_s=10.0, wheelbase_m=2.7, T_body_cam=SE3.identity())
    >>> steer_rad, acceleration = driver.command(SE3.from_translation([10.0, 1.0, 0.0]), speed_m_s=10.0)
    >>> steer_rad < 0.0, acceleration
    (True, 0.0)
    """

    def __init__(
        self,
        settings: DriverSettings,
        lane: FloatArray,
        *,
        target_m_s: float,
        wheelbase_m: float,
        T_body_cam: SE3,
    ) -> None:
        self._settings, self._target_m_s, self._wheelbase_m = settings, target_m_s, wheelbase_m
        self._lane = np.asarray(lane, dtype=np.float64)[:, :2]
        steps = np.linalg.norm(np.diff(self._lane, axis=0), axis=1)
        self._along_m = np.concatenate([[0.0], np.cumsum(steps)])
        self._T_body_cam = T_body_cam
        self._curvature = 0.0
        self._ahead: tuple[int, float, float] | None = None  # stamp, gap, its rate

    def see(self, claims: Iterable[Claim]) -> None:
        """Find the nearest object in the way among new detections."""
        for claim in claims:
            if isinstance(claim, DetectionClaim):
                self._follow(claim)

    def _follow(self, claim: DetectionClaim) -> None:
        gaps = []
        for detection in claim.detections:
            if detection.position_m is None:
                continue
            x, y, _ = self._T_body_cam.apply(detection.position_m[None])[0]
            if x > 0.0 and abs(y - 0.5 * self._curvature * x * x) < self._settings.lane_share_m:
                gaps.append(float(x) - _BUMPERS_M)
        last = self._ahead
        if not gaps:
            if last is not None and claim.stamp_ns - last[0] > _REMEMBERED_NS:
                self._ahead = None
            return
        gap, rate = min(gaps), 0.0
        if last is not None and claim.stamp_ns > last[0] and abs(gap - last[1]) < 5.0:
            fresh = (gap - last[1]) / ((claim.stamp_ns - last[0]) * 1e-9)
            rate = last[2] + 0.3 * (fresh - last[2])
        self._ahead = (claim.stamp_ns, gap, rate)

    def command(self, T_world_body: SE3, *, speed_m_s: float) -> tuple[float, float]:
        """Steering angle (rad, left positive) and acceleration (m/s²) for a believed state."""
        return self.steer_rad(T_world_body, speed_m_s=speed_m_s), self._acceleration(speed_m_s)

    def steer_rad(self, T_world_body: SE3, *, speed_m_s: float) -> float:
        """Pure pursuit: the arc through the point of the lane that lies a look-ahead away."""
        s = self._settings
        reach_m = max(s.look_ahead_least_m, s.look_ahead_s * speed_m_s)
        at = T_world_body.t[:2]
        nearest = int(np.argmin(np.linalg.norm(self._lane - at, axis=1)))
        along_m = self._along_m[nearest] + reach_m
        goal = np.array([np.interp(along_m, self._along_m, self._lane[:, i]) for i in (0, 1)])
        x, y = T_world_body.R[:2, :2].T @ (goal - at)
        self._curvature = 2.0 * float(y) / max(float(x * x + y * y), 1.0)
        return math.atan(self._wheelbase_m * self._curvature)

    def _acceleration(self, speed_m_s: float) -> float:
        s = self._settings
        free = 1.0 - (max(speed_m_s, 0.0) / self._target_m_s) ** 4
        if self._ahead is None:
            return s.acceleration_m_s2 * free
        _, gap, rate = self._ahead
        closing = speed_m_s * -rate / (2.0 * math.sqrt(s.acceleration_m_s2 * s.braking_m_s2))
        wanted = s.gap_least_m + max(0.0, speed_m_s * s.gap_s + closing)
        return s.acceleration_m_s2 * (free - (wanted / max(gap, 0.5)) ** 2)
