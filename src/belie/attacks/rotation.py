"""Lies about how the body is turned: a false attitude, or a false turn rate that bends the path.

A law maps the true pose to the claimed one, with the map of the body's twist that fits it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from belie.attacks.axes import body_axis, vehicle_rotation
from belie.attacks.catalogue import ROTATIONS
from belie.attacks.plan import Plan
from belie.attacks.waveform import Waveform, waveform
from belie.geometry import SE3, FloatArray, so3_exp


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TwistMap:
    """``v' = linear_gain v + linear_offset`` and the same for the angular rate, in body axes.

    Examples
    --------
    >>> TwistMap().apply(np.ones(3), None)
    (array([1., 1., 1.]), None)
    """

    linear_gain: FloatArray = field(default_factory=lambda: np.eye(3))
    linear_offset_m_s: FloatArray = field(default_factory=lambda: np.zeros(3))
    angular_gain: FloatArray = field(default_factory=lambda: np.eye(3))
    angular_offset_rad_s: FloatArray = field(default_factory=lambda: np.zeros(3))

    def apply(
        self, linear_m_s: FloatArray | None, angular_rad_s: FloatArray | None
    ) -> tuple[FloatArray | None, FloatArray | None]:
        """The claimed velocities, each shape (3,) or None as given."""
        return (
            None if linear_m_s is None else self.linear_gain @ linear_m_s + self.linear_offset_m_s,
            None if angular_rad_s is None else self.angular_gain @ angular_rad_s + self.angular_offset_rad_s,
        )


PoseLaw = Callable[[int, SE3], tuple[SE3, TwistMap]]
"""Stamp (ns) and true pose to the lie; to be called with growing stamps."""


def rotation_law(plan: Plan, *, anchor: SE3, anchor_ns: int, rng: np.random.Generator) -> PoseLaw:
    """The law of an attack about roll, pitch or yaw.

    Offset, ramp, sinusoid, noise and set falsify the attitude and leave the position; bias, scale and flip
    falsify the turn rate, and the path is dead-reckoned from it, as an odometry that trusts a false
    gyro would.

    Examples
    --------
    >>> from belie.attacks import parse_attack
    >>> from belie.attacks.timing import FrameClock
    >>> plan = Plan.of(parse_attack("odometry-offset:axis=yaw,magnitude=90,start=1"),
    ...                FrameClock(np.arange(9)), "flu")
    >>> law = rotation_law(plan, anchor=SE3.identity(), anchor_ns=0, rng=plan.random("/odom"))
    >>> law(3, SE3.identity())[0].R.round(3)[:, 0] + 0.0
    array([0., 1., 0.])
    """
    axis = str(plan.spec.axis)
    spin = body_axis(axis, plan.body_axes)
    match plan.spec.kind:
        case "bias":
            return _dead_reckoned(anchor, np.eye(3), spin, waveform(plan, anchor_ns, rng))
        case "scale":
            gain = np.eye(3) + (plan.spec.number("factor") - 1.0) * np.outer(spin, spin)
            return _dead_reckoned(anchor, gain, spin, None)
        case "flip":
            return _dead_reckoned(anchor, np.eye(3) - 2.0 * np.outer(spin, spin), spin, None)
        case "set":
            return _fixed_angle(vehicle_rotation(plan.body_axes), ROTATIONS.index(axis), plan.si("value"))
        case _:
            return _turned(spin, waveform(plan, anchor_ns, rng))


def _turned(spin: FloatArray, error: Waveform) -> PoseLaw:
    def law(stamp_ns: int, T_odom_body: SE3) -> tuple[SE3, TwistMap]:
        angle_rad, rate_rad_s = error(stamp_ns)
        turn = so3_exp(angle_rad * spin)
        twist = TwistMap(linear_gain=turn.T, angular_gain=turn.T, angular_offset_rad_s=rate_rad_s * spin)
        return SE3(T_odom_body.R @ turn, T_odom_body.t), twist

    return law


def _dead_reckoned(anchor: SE3, gain: FloatArray, spin: FloatArray, bias: Waveform | None) -> PoseLaw:
    T_odom_true, T_odom_claimed, biased_rad = anchor, anchor, 0.0

    def law(stamp_ns: int, T_odom_body: SE3) -> tuple[SE3, TwistMap]:
        nonlocal T_odom_true, T_odom_claimed, biased_rad
        angle_rad, rate_rad_s = bias(stamp_ns) if bias else (0.0, 0.0)
        xi = (T_odom_true.inverse() @ T_odom_body).log()
        xi[3:] = gain @ xi[3:] + (angle_rad - biased_rad) * spin
        T_odom_true, T_odom_claimed, biased_rad = T_odom_body, T_odom_claimed @ SE3.exp(xi), angle_rad
        return T_odom_claimed, TwistMap(angular_gain=gain, angular_offset_rad_s=rate_rad_s * spin)

    return law


def _fixed_angle(R_body_vehicle: FloatArray, index: int, angle_rad: float) -> PoseLaw:
    keep = np.eye(3)
    keep[index, index] = 0.0

    def law(_: int, T_odom_body: SE3) -> tuple[SE3, TwistMap]:
        # A world of rdf axes is turned like its body, so one change of basis serves both sides.
        R = R_body_vehicle.T @ T_odom_body.R @ R_body_vehicle
        true = _roll_pitch_yaw(R)
        claimed = true.copy()
        claimed[index] = angle_rad
        R_claimed = R_body_vehicle @ _from_roll_pitch_yaw(claimed) @ R_body_vehicle.T
        rates = _body_rates(claimed) @ keep @ np.linalg.pinv(_body_rates(true))
        twist = TwistMap(
            linear_gain=R_claimed.T @ T_odom_body.R, angular_gain=R_body_vehicle @ rates @ R_body_vehicle.T
        )
        return SE3(R_claimed, T_odom_body.t), twist

    return law


def _roll_pitch_yaw(R: FloatArray) -> FloatArray:
    return np.array(
        [
            np.arctan2(R[2, 1], R[2, 2]),
            -np.arcsin(np.clip(R[2, 0], -1.0, 1.0)),
            np.arctan2(R[1, 0], R[0, 0]),
        ]
    )


def _from_roll_pitch_yaw(angles_rad: FloatArray) -> FloatArray:
    about_x, about_y, about_z = (so3_exp(a * e) for a, e in zip(angles_rad, np.eye(3), strict=True))
    return np.asarray(about_z @ about_y @ about_x)


def _body_rates(angles_rad: FloatArray) -> FloatArray:
    """Matrix from the rates of (roll, pitch, yaw) to the angular rate in body axes, shape (3, 3)."""
    e = np.eye(3)
    about_x, about_y = so3_exp(angles_rad[0] * e[0]), so3_exp(angles_rad[1] * e[1])
    return np.column_stack([e[0], about_x.T @ e[1], about_x.T @ about_y.T @ e[2]])
