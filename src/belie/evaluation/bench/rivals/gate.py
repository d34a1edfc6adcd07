"""The checks that navigation filters run today: an innovation gate, as in PX4's EKF2, and as in robot_localization.

A small extended Kalman filter dead-reckons by odometry and gyroscope and is corrected by positions. A measurement is
rejected where its innovation leaves its gate; a rejection is the alert. Defaults are those of the two projects:

- PX4, EKF2 (`InnovationGate`): each axis on its own, ``|nu_i| > g sigma_i`` with g = 5 (``EKF2_GPS_P_GATE``,
  ``EKF2_GPS_V_GATE``; parameter reference, docs.px4.io); after 5 s without an accepted position (``EKF2_NOAID_TOUT``)
  the filter resets to the measured one.
- robot_localization (`MahalanobisGate`): all axes together, ``sqrt(nu' S^-1 nu) > t``. By default t is
  ``numeric_limits<double>::max()``: nothing is ever rejected (ros_filter.cpp, `*_rejection_threshold`). What is used
  here are the values of its template, params/ekf.yaml: 5 for poses, 1 for twists; the latter would reject every second
  honest twist of a filter whose covariances are right, so that 5 is taken for both.

State: position in the frame of the positions (3), velocity in body axes (3), heading, gyroscope bias about the
vertical. Velocity follows from the accelerometer, gravity taken off by the attitude that odometry claims; without one
it is a random walk. The heading against the positions' frame is learned from the first metres of
motion where the frames are not the same, as belie must do, too.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from pydantic import Field

from belie.detector.alerts import ALERT_OF_CHECK
from belie.evaluation.bench.rivals.protocol import Cameras
from belie.geometry import SE3, FloatArray
from belie.types import (
    Alert,
    AlertType,
    CheckResult,
    Claim,
    MotionClaim,
    PoseClaim,
    PositionClaim,
    Settings,
    Status,
    Step,
)

Tested = tuple[str, str, float]  # check, source, innovation over gate
_GRAVITY_M_S2 = 9.81
_P, _V, _YAW, _BIAS = slice(0, 3), slice(3, 6), 6, 7


class GateSettings(Settings):
    """Noise and gates of the filter; a motor vehicle's, with PX4's defaults where it has one."""

    gate_sigma: float = Field(
        5.0, description="EKF2_GPS_P_GATE, EKF2_GPS_V_GATE [standard deviations]", gt=0.0
    )
    mahalanobis: float = Field(5.0, description="robot_localization's params/ekf.yaml [1]", gt=0.0)
    acceleration_noise: float = Field(
        0.35, description="EKF2_ACC_NOISE, of the velocity's random walk [m/s/sqrt(s)]", gt=0.0
    )
    coasting_noise: float = Field(
        1.5, description="of the velocity's random walk without an accelerometer [m/s/sqrt(s)]", gt=0.0
    )
    gyro_noise_rad: float = Field(0.015, description="EKF2_GYR_NOISE, of a sample [rad/s]", gt=0.0)
    bias_noise: float = Field(
        1e-3, description="EKF2_GYR_B_NOISE, of the bias's random walk [rad/s/sqrt(s)]", gt=0.0
    )
    velocity_noise_m_s: float = Field(
        0.3, description="EKF2_GPS_V_NOISE, of odometry's velocity [m/s]", gt=0.0
    )
    turn_noise_rad_s: float = Field(0.02, description="of odometry's turn rate [rad/s]", gt=0.0)
    position_noise_m: float = Field(
        0.5, description="EKF2_GPS_P_NOISE, least deviation of a position [m]", gt=0.0
    )
    alignment_m: float = Field(5.0, description="travelled before the heading is learned [m]", gt=0.0)
    reset_s: float = Field(5.0, description="EKF2_NOAID_TOUT, without an accepted position [s]", gt=0.0)
    quiet_s: float = Field(
        1.0, description="without a rejection before another one is a new alert [s]", gt=0.0
    )


@dataclass(slots=True)
class _Filter:
    """The state and its covariance."""

    x: FloatArray
    P: FloatArray
    stamp_ns: int
    settings: GateSettings
    rates_rad_s: FloatArray = field(default_factory=lambda: np.zeros(3))
    acceleration_m_s2: FloatArray | None = None

    @property
    def rate_rad_s(self) -> float:
        """Turn rate about the vertical, as measured."""
        return float(self.rates_rad_s[2])

    def predict(self, stamp_ns: int) -> None:
        """Dead-reckon to a later time."""
        dt = (stamp_ns - self.stamp_ns) * 1e-9
        if dt <= 0.0:
            return
        s, yaw = self.settings, self.x[_YAW]
        R, dR = _turn(yaw)
        F = np.eye(8)
        F[_P, _V] = R * dt
        F[_P, _YAW] = dR @ self.x[_V] * dt
        F[_YAW, _BIAS] = -dt
        self.x[_P] += R @ self.x[_V] * dt
        self.x[_YAW] += (self.rate_rad_s - self.x[_BIAS]) * dt
        noise = s.coasting_noise
        if self.acceleration_m_s2 is not None:
            noise = s.acceleration_noise
            F[_V, _V] -= _cross(self.rates_rad_s) * dt
            self.x[_V] = F[_V, _V] @ self.x[_V] + self.acceleration_m_s2 * dt
        Q = np.zeros((8, 8))
        Q[_V, _V] = np.eye(3) * noise**2 * dt
        Q[_YAW, _YAW] = s.gyro_noise_rad**2 * dt**2
        Q[_BIAS, _BIAS] = s.bias_noise**2 * dt
        self.P = F @ self.P @ F.T + Q
        self.stamp_ns = stamp_ns

    def innovation(
        self, z: FloatArray, h: FloatArray, H: FloatArray, R: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Innovation and its covariance."""
        return z - h, H @ self.P @ H.T + R

    def correct(self, nu: FloatArray, S: FloatArray, H: FloatArray) -> None:
        """Take a measurement in."""
        K = np.linalg.solve(S, H @ self.P).T
        self.x = self.x + K @ nu
        self.P = (np.eye(8) - K @ H) @ self.P
        self.P = 0.5 * (self.P + self.P.T)


class _Fusion:
    """Odometry, gyroscope and one source of positions in one filter."""

    def __init__(self, settings: GateSettings, ratio: Callable[[FloatArray, FloatArray], float]) -> None:
        self.settings, self.ratio = settings, ratio
        self._filter: _Filter | None = None
        self._last_pose: dict[str, PoseClaim] = {}
        self._path: deque[tuple[int, SE3]] = deque(maxlen=4000)
        self._early: list[PositionClaim] = []
        self._aligned = False
        self._accepted_ns = 0

    def take(self, claim: Claim) -> list[Tested]:
        """Take in one claim; what was tested, and how."""
        if isinstance(claim, MotionClaim) and claim.kind == "imu" and claim.angular_rad_s is not None:
            if self._filter is not None:
                self._filter.predict(claim.stamp_ns)
                self._filter.rates_rad_s = np.asarray(claim.angular_rad_s)
                self._filter.acceleration_m_s2 = self._acceleration(claim)
        elif isinstance(claim, MotionClaim) and claim.kind == "twist" and claim.linear_m_s is not None:
            return self._velocity("twist", claim.source, claim.stamp_ns, np.asarray(claim.linear_m_s), None)
        elif isinstance(claim, PoseClaim):
            return self._pose(claim)
        elif isinstance(claim, PositionClaim):
            return self._position(claim)
        return []

    def _acceleration(self, claim: MotionClaim) -> FloatArray | None:
        """Specific force without gravity, in body axes; None where the attitude is not known."""
        if claim.acceleration_m_s2 is None or not self._path:
            return None
        up = self._path[-1][1].R[2]  # of the frame of odometry, in body axes
        return np.asarray(np.asarray(claim.acceleration_m_s2) - _GRAVITY_M_S2 * up)

    def _pose(self, claim: PoseClaim) -> list[Tested]:
        """A pose as the motion since the last one: robot_localization's differential mode."""
        last = self._last_pose.get(claim.source)
        self._last_pose[claim.source] = claim
        if not self._path or claim.stamp_ns > self._path[-1][0]:
            self._path.append((claim.stamp_ns, claim.T_odom_body))
        if last is None or claim.stamp_ns <= last.stamp_ns:
            return []
        dt = (claim.stamp_ns - last.stamp_ns) * 1e-9
        step = last.T_odom_body.inverse() @ claim.T_odom_body
        return self._velocity(
            "odometry", claim.source, claim.stamp_ns, step.t / dt, float(step.log()[5]) / dt
        )

    def _velocity(
        self, check: str, source: str, stamp_ns: int, v: FloatArray, rate_rad_s: float | None
    ) -> list[Tested]:
        s = self.settings
        if self._filter is None:
            x = np.zeros(8)
            x[_V] = v
            P = np.diag([1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 0.1, 1e-4])
            self._filter = _Filter(x, P, stamp_ns, s)
            return []
        f = self._filter
        f.predict(stamp_ns)
        H = np.zeros((3, 8))
        H[:, _V] = np.eye(3)
        z, h, R = v, f.x[_V], np.eye(3) * s.velocity_noise_m_s**2
        if rate_rad_s is not None:
            H = np.vstack([H, np.zeros(8)])
            H[3, _BIAS] = -1.0
            z, h = np.append(v, rate_rad_s), np.append(f.x[_V], f.rate_rad_s - f.x[_BIAS])
            R = np.diag([*[s.velocity_noise_m_s**2] * 3, s.turn_noise_rad_s**2])
        nu, S = f.innovation(z, h, H, R)
        ratio = self.ratio(nu, S)
        if ratio <= 1.0:
            f.correct(nu, S, H)
        return [(check, source, ratio)]

    def _position(self, claim: PositionClaim) -> list[Tested]:
        f = self._filter
        if f is None or not self._aligned:
            self._align(claim)
            return []
        s = self.settings
        f.predict(claim.stamp_ns)
        H = np.zeros((3, 8))
        H[:, _P] = np.eye(3)
        R = np.eye(3) * s.position_noise_m**2 if claim.covariance is None else np.asarray(claim.covariance)
        R = np.maximum(R, np.eye(3) * s.position_noise_m**2)
        nu, S = f.innovation(self._of_body(claim, f.x[_YAW]), f.x[_P], H, R)
        ratio = self.ratio(nu, S)
        if ratio <= 1.0:
            f.correct(nu, S, H)
            self._accepted_ns = claim.stamp_ns
        elif (claim.stamp_ns - self._accepted_ns) * 1e-9 > s.reset_s:
            f.x[_P] = f.x[_P] + nu
            f.P[_P, :] = f.P[:, _P] = 0.0
            f.P[_P, _P] = R
            self._accepted_ns = claim.stamp_ns
        return [("position", claim.source, ratio)]

    def _of_body(self, claim: PositionClaim, yaw: float) -> FloatArray:
        if claim.lever_m is None:
            return np.asarray(claim.position_m)
        return np.asarray(claim.position_m) - _turn(yaw)[0] @ np.asarray(claim.lever_m)

    def _align(self, claim: PositionClaim) -> None:
        """Begin where the positions are, with the heading under which odometry's path fits them (least squares)."""
        self._early.append(claim)
        if len(self._path) < 2 or self._filter is None:
            return
        stamps = np.array([stamp for stamp, _ in self._path], dtype=np.float64)
        path = np.array([T.t for _, T in self._path])
        heading = [float(np.arctan2(T.R[1, 0], T.R[0, 0])) for _, T in self._path]
        known = [c for c in self._early if stamps[0] <= c.stamp_ns <= stamps[-1]]
        if len(known) < 3:
            return
        odom = np.column_stack([np.interp([c.stamp_ns for c in known], stamps, path[:, i]) for i in range(3)])
        seen = np.array([c.position_m for c in known])
        a, b = odom - odom.mean(axis=0), seen - seen.mean(axis=0)
        if np.linalg.norm(np.ptp(a[:, :2], axis=0)) < self.settings.alignment_m:
            return
        turn = math.atan2(
            float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()), float((a[:, :2] * b[:, :2]).sum())
        )
        spread = max(float(np.sqrt((a[:, :2] ** 2).sum())), 1e-6)
        f, R = self._filter, _turn(turn)[0]
        f.x[_YAW] = turn + heading[-1]
        f.x[_P] = seen.mean(axis=0) + R @ (path[-1] - odom.mean(axis=0))
        f.stamp_ns = int(stamps[-1])
        f.P[_P, :] = f.P[:, _P] = f.P[_YAW, :] = f.P[:, _YAW] = 0.0
        f.P[_P, _P] = np.eye(3) * self.settings.position_noise_m**2
        f.P[_YAW, _YAW] = (self.settings.position_noise_m / spread) ** 2
        self._aligned, self._accepted_ns = True, claim.stamp_ns


class InnovationGate:
    """Each axis of each innovation against five sigma, as PX4's EKF2.

    Positions of several sources are in axes of their own: each has a filter of its own.

    Parameters
    ----------
    cameras : mapping
        Not looked at.
    settings : GateSettings
        Noise and gates.
    """

    judges = frozenset({AlertType.ODOMETRY_SPOOFING, AlertType.POSITION_SPOOFING})

    def __init__(self, cameras: Cameras, settings: GateSettings | None = None) -> None:
        self.settings = settings or GateSettings()
        self.checks: tuple[CheckResult, ...] = ()
        self._fusions: dict[str, _Fusion] = {"": _Fusion(self.settings, self.ratio)}
        self._rejected_ns: dict[tuple[AlertType, str], int] = {}

    def ratio(self, nu: FloatArray, S: FloatArray) -> float:
        """Innovation over gate: rejected above 1."""
        return float(np.max(np.abs(nu) / np.sqrt(np.diag(S)))) / self.settings.gate_sigma

    def update(self, step: Step) -> list[Alert]:
        """Filter the claims of one frame in order of their stamps."""
        worst: dict[tuple[str, str], float] = {}
        alerts = []
        for claim in sorted(step.claims, key=lambda claim: claim.stamp_ns):
            for check, source, ratio in self._take(claim):
                worst[check, source] = max(ratio, worst.get((check, source), 0.0))
                if ratio > 1.0:
                    alerts += self._accuse(ALERT_OF_CHECK[check], source, claim.stamp_ns)
        self.checks = tuple(_result(check, source, ratio) for (check, source), ratio in worst.items())
        return alerts

    def _take(self, claim: Claim) -> list[Tested]:
        if not isinstance(claim, PositionClaim):
            return [tested for fusion in self._fusions.values() for tested in fusion.take(claim)]
        if claim.source not in self._fusions:
            first = self._fusions.pop("", None)  # the first source takes the filter that is there
            self._fusions[claim.source] = first or _Fusion(self.settings, self.ratio)
        return self._fusions[claim.source].take(claim)

    def _accuse(self, kind: AlertType, source: str, stamp_ns: int) -> list[Alert]:
        """A rejection is an alert if there was none for a while."""
        before_ns = self._rejected_ns.get((kind, source))
        self._rejected_ns[kind, source] = stamp_ns
        if before_ns is not None and stamp_ns - before_ns <= self.settings.quiet_s * 1e9:
            return []
        return [Alert(type=kind, source=source, onset_ns=stamp_ns)]


def _result(check: str, source: str, ratio: float) -> CheckResult:
    return CheckResult(
        check=check,
        source=source,
        status=Status.CONTRADICTED if ratio > 1.0 else Status.CONSISTENT,
        statistic=ratio,
        threshold=1.0,
        unit="gate",
        reason=f"innovation {ratio:.2f} of its gate",
    )


class MahalanobisGate(InnovationGate):
    """All axes of an innovation together, as robot_localization."""

    def ratio(self, nu: FloatArray, S: FloatArray) -> float:
        """Mahalanobis distance over threshold: rejected above 1."""
        return float(np.sqrt(nu @ np.linalg.solve(S, nu))) / self.settings.mahalanobis


def _cross(w: FloatArray) -> FloatArray:
    """The matrix of a cross product."""
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def _turn(yaw: float) -> tuple[FloatArray, FloatArray]:
    """Rotation about the vertical, and its derivative."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0, 0, 1.0]]), np.array(
        [[-s, -c, 0.0], [c, -s, 0.0], [0, 0, 0.0]]
    )
