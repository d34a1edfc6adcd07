"""ROS messages to claims, one reader for each kind of stream.

A reader is called with every message of its topic in turn. All-zero covariances mean unknown in ROS;
NaN where a number must stand is an error that names the message.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, FloatArray
from belie.recordings.geodesy import GeodeticPoint, enu_m
from belie.recordings.transforms import frame_name
from belie.types import Claim, MotionClaim, PoseClaim, PositionClaim, RecordingError


def known_covariance(values: npt.ArrayLike, size: int) -> FloatArray | None:
    """A ROS covariance, shape (size, size), or None where it says unknown (zero, -1 first, not finite).

    >>> known_covariance([0.0] * 9, 3) is None
    True
    """
    matrix = np.asarray(values, dtype=np.float64).reshape(size, size)
    if not np.isfinite(matrix).all() or not matrix.any() or matrix[0, 0] < 0.0:
        return None
    return matrix


def stamp_ns(message: Any) -> int:
    """Header stamp in nanoseconds.

    >>> from belie.recordings import messages
    >>> stamp_ns(messages.imu(MotionClaim(source="/imu", kind="imu", stamp_ns=7, received_ns=9), "base_link"))
    7
    """
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)


def _xyz(vector: Any) -> FloatArray:
    return np.array([vector.x, vector.y, vector.z], dtype=np.float64)


def pose_of(message_pose: Any, *, topic: str, index: int, at_ns: int) -> SE3:
    """A ``geometry_msgs/Pose`` as a transform.

    Raises
    ------
    RecordingError
        On NaN or a zero quaternion; names topic, message and stamp.
    """
    q, t = message_pose.orientation, _xyz(message_pose.position)
    quat_xyzw = np.array([q.x, q.y, q.z, q.w], dtype=np.float64)
    if not np.isfinite(t).all() or not np.isfinite(quat_xyzw).all():
        raise _bad(topic, index, at_ns, "holds NaN or infinity")
    if float(np.linalg.norm(quat_xyzw)) < 1e-6:
        raise _bad(topic, index, at_ns, "has a zero quaternion")
    return SE3.from_quat_xyzw(quat_xyzw, t)


def _bad(topic: str, index: int, at_ns: int, what: str) -> RecordingError:
    return RecordingError(
        f"the pose of {topic} {what} in message {index} (stamp {at_ns / 1e9:.6f} s); "
        "mend the publisher, or leave the message out of the recording"
    )


class OdometryReader:
    """``nav_msgs/Odometry`` to a pose claim and, where the twist is filled in, a motion claim.

    Many publishers leave the twist at zero: an all-zero twist without covariance is taken for empty
    until a filled one was seen (a robot that truly stands still loses nothing by it: its pose says the
    same). A half of NaN means not measured.

    >>> from belie.recordings import messages
    >>> pose = PoseClaim(
    ...     source="/odom", frame_id="odom", stamp_ns=7, received_ns=9, T_odom_body=SE3.identity())
    >>> [type(c).__name__ for c in OdometryReader("/odom")(messages.odometry(pose, None, "base_link"), 9, 0)]
    ['PoseClaim']
    """

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self._filled = False

    def __call__(self, message: Any, received_ns: int, index: int) -> tuple[Claim, ...]:
        """The claims of one message."""
        at_ns = stamp_ns(message)
        T_odom_body = pose_of(message.pose.pose, topic=self.topic, index=index, at_ns=at_ns)
        pose = PoseClaim(
            source=self.topic,
            frame_id=frame_name(message.header.frame_id),
            stamp_ns=at_ns,
            received_ns=received_ns,
            T_odom_body=T_odom_body,
            covariance=known_covariance(message.pose.covariance, 6),
        )
        motion = self._motion(message, received_ns, index)
        return (pose,) if motion is None else (pose, motion)

    def _motion(self, message: Any, received_ns: int, index: int) -> MotionClaim | None:
        at_ns, twist = stamp_ns(message), message.twist.twist
        covariance = known_covariance(message.twist.covariance, 6)
        halves: list[FloatArray | None] = []
        for name in ("linear", "angular"):
            half = _xyz(getattr(twist, name))
            if np.isnan(half).all():
                halves.append(None)
            elif np.isfinite(half).all():
                halves.append(half)
            else:
                raise RecordingError(
                    f"the {name} twist of {self.topic} holds NaN or infinity in message {index} "
                    f"(stamp {at_ns / 1e9:.6f} s); mend the publisher"
                )
        given = [half for half in halves if half is not None]
        if given and (covariance is not None or any(half.any() for half in given)):
            self._filled = True
        if not given or not self._filled:
            return None
        return MotionClaim(
            source=self.topic,
            kind="twist",
            stamp_ns=at_ns,
            received_ns=received_ns,
            linear_m_s=halves[0],
            angular_rad_s=halves[1],
            covariance=covariance,
        )


class PoseReader:
    """``PoseStamped`` or ``PoseWithCovarianceStamped`` to a localisation claim, or to a pose claim."""

    def __init__(self, topic: str, *, as_odometry: bool) -> None:
        self.topic = topic
        self.as_odometry = as_odometry

    def __call__(self, message: Any, received_ns: int, index: int) -> tuple[Claim, ...]:
        """The claim of one message."""
        at_ns = stamp_ns(message)
        with_covariance = hasattr(message.pose, "covariance")
        covariance = known_covariance(message.pose.covariance, 6) if with_covariance else None
        T = pose_of(
            message.pose.pose if with_covariance else message.pose,
            topic=self.topic,
            index=index,
            at_ns=at_ns,
        )
        frame_id = frame_name(message.header.frame_id)
        if self.as_odometry:
            return (
                PoseClaim(
                    source=self.topic,
                    frame_id=frame_id,
                    stamp_ns=at_ns,
                    received_ns=received_ns,
                    T_odom_body=T,
                    covariance=covariance,
                ),
            )
        return (
            PositionClaim(
                source=self.topic,
                frame_id=frame_id,
                kind="localisation",
                stamp_ns=at_ns,
                received_ns=received_ns,
                position_m=T.t,
                covariance=None if covariance is None else covariance[:3, :3],
            ),
        )


class FixReader:
    """``sensor_msgs/NavSatFix`` to a GNSS claim in ENU metres; messages without a fix give nothing."""

    def __init__(self, topic: str, *, origin: GeodeticPoint, lever_m: FloatArray | None) -> None:
        self.topic = topic
        self.origin = origin
        self.lever_m = lever_m

    def __call__(self, message: Any, received_ns: int, index: int) -> tuple[Claim, ...]:
        """The claim of one message."""
        point = fix_of(message)
        if point is None:
            return ()
        known = int(message.position_covariance_type) != 0
        return (
            PositionClaim(
                source=self.topic,
                frame_id="enu",
                kind="gnss",
                stamp_ns=stamp_ns(message),
                received_ns=received_ns,
                position_m=enu_m(point, self.origin),
                covariance=known_covariance(message.position_covariance, 3) if known else None,
                lever_m=self.lever_m,
            ),
        )


def fix_of(message: Any) -> GeodeticPoint | None:
    """The position of a ``NavSatFix``, or None without a fix (status below 0, NaN, out of range).

    >>> from types import SimpleNamespace as message
    >>> fix_of(message(latitude=48.0, longitude=11.0, altitude=0.0, status=message(status=-1))) is None
    True
    """
    numbers = (float(message.latitude), float(message.longitude), float(message.altitude))
    if int(message.status.status) < 0 or not all(math.isfinite(v) for v in numbers):
        return None
    if abs(numbers[0]) > 90.0 or abs(numbers[1]) > 360.0:
        return None
    return GeodeticPoint(latitude_deg=numbers[0], longitude_deg=numbers[1], altitude_m=numbers[2])


class ImuReader:
    """``sensor_msgs/Imu`` to a motion claim, rotated to body axes.

    A first covariance entry of -1 means that the quantity is not measured. The specific force stays that
    at the IMU's place: its lever arm is not taken out.
    """

    def __init__(self, topic: str, R_body_imu: FloatArray) -> None:
        self.topic = topic
        self.R_body_imu = R_body_imu

    def __call__(self, message: Any, received_ns: int, index: int) -> tuple[Claim, ...]:
        """The claim of one message."""
        rate = self._measured(message, "angular_velocity", index)
        force = self._measured(message, "linear_acceleration", index)
        if rate is None and force is None:
            return ()
        covariance = None
        rate_covariance = known_covariance(message.angular_velocity_covariance, 3)
        if rate is not None and rate_covariance is not None:
            covariance = np.zeros((6, 6))
            covariance[3:, 3:] = self.R_body_imu @ rate_covariance @ self.R_body_imu.T
        return (
            MotionClaim(
                source=self.topic,
                kind="imu",
                stamp_ns=stamp_ns(message),
                received_ns=received_ns,
                angular_rad_s=rate,
                acceleration_m_s2=force,
                covariance=covariance,
            ),
        )

    def _measured(self, message: Any, name: str, index: int) -> FloatArray | None:
        if float(getattr(message, f"{name}_covariance")[0]) == -1.0:
            return None
        value = _xyz(getattr(message, name))
        if not np.isfinite(value).all():
            raise RecordingError(
                f"the {name.replace('_', ' ')} of {self.topic} holds NaN or infinity in message {index} "
                f"(stamp {stamp_ns(message) / 1e9:.6f} s); mend the driver"
            )
        return np.asarray(self.R_body_imu @ value)
