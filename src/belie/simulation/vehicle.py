"""A vehicle that is steered as it goes: the kinematic bicycle, and the motion that it leaves behind."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable

import numpy as np
from pydantic import Field

from belie.geometry import SE3, FloatArray
from belie.types import Settings

STEP_S = 0.005  # the fastest sensor's period: between two steps the motion is even


class VehicleSettings(Settings):
    """Size and limits of a passenger car.

    >>> VehicleSettings().wheelbase_m
    2.7
    """

    length_m: float = Field(4.5, description="of the body [m]", gt=0.0)
    width_m: float = Field(1.8, description="of the body [m]", gt=0.0)
    wheelbase_m: float = Field(2.7, description="between the axles [m]", gt=0.0)
    origin_to_rear_axle_m: float = Field(
        0.0, description="how far the rear axle lies behind the body's origin [m]"
    )
    origin_to_middle_m: float = Field(
        1.35, description="how far the body's middle lies before its origin [m]"
    )
    most_steer_deg: float = Field(32.0, description="of the front wheels [deg]", gt=0.0, lt=80.0)
    most_steer_rate_deg_s: float = Field(
        30.0, description="of the front wheels: 450 deg/s at a steering wheel geared 1:15 [deg/s]", gt=0.0
    )
    most_acceleration_m_s2: float = Field(2.5, description="forward [m/s²]", gt=0.0)
    most_braking_m_s2: float = Field(7.0, description="dry asphalt with ABS [m/s²]", gt=0.0)


class Vehicle:
    """A kinematic bicycle about its rear axle: ``yaw' = v tan(steer) / wheelbase`` (Rajamani, 2.2).

    It is a `Motion` of the past: poses and twists up to `now_s` can be asked for.

    Parameters
    ----------
    settings : VehicleSettings
        Size and limits.
    T_world_body : SE3
        Where it starts; its roll and pitch are dropped.
    speed_m_s : float
        At the start.
    height_m : callable, optional
        Height of the body's origin over x, y (m); by default as at the start.

    Examples
    --------
    >>> vehicle = Vehicle(VehicleSettings(), SE3.identity(), speed_m_s=10.0)
    >>> vehicle.drive(1.0, steer_rad=0.0, acceleration_m_s2=0.0)
    >>> vehicle.T_world_body(1.0).t.round(6), vehicle.twist(0.5)[0]
    (array([10.,  0.,  0.]), array([10.,  0.,  0.]))
    """

    def __init__(
        self,
        settings: VehicleSettings,
        T_world_body: SE3,
        *,
        speed_m_s: float,
        height_m: Callable[[float, float], float] | None = None,
    ) -> None:
        self.settings = settings
        z_m = float(T_world_body.t[2])
        self._height_m = height_m or (lambda x, y: z_m)
        yaw = math.atan2(T_world_body.R[1, 0], T_world_body.R[0, 0])
        back = settings.origin_to_rear_axle_m
        x = float(T_world_body.t[0]) - back * math.cos(yaw)
        y = float(T_world_body.t[1]) - back * math.sin(yaw)
        self._steer_rad = 0.0
        self._times = [0.0]
        self._states = [(x, y, yaw, speed_m_s, 0.0)]  # rear axle, heading, speed, yaw rate

    @property
    def now_s(self) -> float:
        """How far it has been driven, seconds."""
        return self._times[-1]

    @property
    def speed_m_s(self) -> float:
        """Its speed now."""
        return self._states[-1][3]

    def drive(self, stop_s: float, *, steer_rad: float, acceleration_m_s2: float) -> None:
        """Move on to `stop_s` under a command, as far as the vehicle's limits let it follow."""
        s = self.settings
        most = math.radians(s.most_steer_deg)
        wanted = min(max(steer_rad, -most), most)
        acceleration = min(max(acceleration_m_s2, -s.most_braking_m_s2), s.most_acceleration_m_s2)
        while self.now_s < stop_s - 1e-9:
            dt = min(STEP_S, stop_s - self.now_s)
            reach = math.radians(s.most_steer_rate_deg_s) * dt
            self._steer_rad += min(max(wanted - self._steer_rad, -reach), reach)
            x, y, yaw, speed, _ = self._states[-1]
            faster = max(0.0, speed + acceleration * dt)
            mean = 0.5 * (speed + faster)
            yaw_rate = mean * math.tan(self._steer_rad) / s.wheelbase_m
            middle = yaw + 0.5 * yaw_rate * dt
            x, y = x + mean * dt * math.cos(middle), y + mean * dt * math.sin(middle)
            self._times.append(self.now_s + dt)
            self._states.append((x, y, yaw + yaw_rate * dt, faster, yaw_rate))

    def T_world_body(self, t_s: float) -> SE3:
        """Where the body was at `t_s`, at most `now_s`."""
        x, y, yaw, _, _ = self._state(t_s)
        ahead = self.settings.origin_to_rear_axle_m
        x, y = x + ahead * math.cos(yaw), y + ahead * math.sin(yaw)
        cosine, sine = math.cos(yaw), math.sin(yaw)
        R = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return SE3(R, np.array([x, y, self._height_m(x, y)]))

    def twist(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Linear and angular velocity in body axes at `t_s`, at most `now_s`."""
        _, _, _, speed, yaw_rate = self._state(t_s)
        linear = np.array([speed, yaw_rate * self.settings.origin_to_rear_axle_m, 0.0])
        return linear, np.array([0.0, 0.0, yaw_rate])

    def footprint(self, t_s: float) -> FloatArray:
        """Corners of the body on the ground, shape (4, 2), metres, world."""
        s = self.settings
        T = self.T_world_body(t_s)
        middle = T.t[:2] + s.origin_to_middle_m * T.R[:2, 0]
        return rectangle(middle, T.R[:2, 0], s.length_m, s.width_m)

    def _state(self, t_s: float) -> tuple[float, float, float, float, float]:
        if t_s > self.now_s + 1e-6:
            raise ValueError(f"the vehicle has been driven to {self.now_s:.3f} s, not to {t_s:.3f} s")
        i = min(max(bisect_right(self._times, t_s) - 1, 0), len(self._times) - 1)
        if i == len(self._times) - 1:
            return self._states[i]
        before, after = self._states[i], self._states[i + 1]
        share = (t_s - self._times[i]) / (self._times[i + 1] - self._times[i])
        x, y, yaw, speed, _ = (a + share * (b - a) for a, b in zip(before, after, strict=True))
        return x, y, yaw, speed, after[4]


def rectangle(middle: FloatArray, ahead: FloatArray, length_m: float, width_m: float) -> FloatArray:
    """Corners of a rectangle on the ground, shape (4, 2), from its middle and the direction of its length.

    >>> rectangle(np.zeros(2), np.array([1.0, 0.0]), 4.0, 2.0)[0]
    array([2., 1.])
    """
    unit = np.asarray(ahead, dtype=np.float64) / math.hypot(float(ahead[0]), float(ahead[1]))
    x, y = 0.5 * length_m * unit, 0.5 * width_m * np.array([-unit[1], unit[0]])
    return np.array([middle + x + y, middle - x + y, middle - x - y, middle + x - y])


def overlap(a: FloatArray, b: FloatArray) -> bool:
    """Whether two convex outlines, shapes (N, 2) and (M, 2), overlap (separating axis theorem).

    >>> square = rectangle(np.zeros(2), np.array([1.0, 0.0]), 2.0, 2.0)
    >>> overlap(square, square + [1.9, 0.0]), overlap(square, square + [2.1, 0.0])
    (True, False)
    """
    for outline in (a, b):
        edges = np.roll(outline, -1, axis=0) - outline
        normals = np.column_stack([-edges[:, 1], edges[:, 0]])
        ours, theirs = a @ normals.T, b @ normals.T
        if ((ours.max(axis=0) < theirs.min(axis=0)) | (theirs.max(axis=0) < ours.min(axis=0))).any():
            return False
    return True
