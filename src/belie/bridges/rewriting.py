"""A ROS message with another claim in it, and everything else as it was."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from belie.geometry import FloatArray
from belie.recordings import topics as ros
from belie.recordings.geodesy import GeodeticPoint, geodetic_of_enu
from belie.recordings.messages import new, pose_message
from belie.recordings.rig import Rig
from belie.recordings.vision_messages import detections, without_sizes_of_boxed
from belie.types import Claim, DetectionClaim, MotionClaim, PoseClaim, PositionClaim


def rewritten(
    message: Any, message_type: str, claims: tuple[Claim, ...], rig: Rig, origin: GeodeticPoint | None
) -> Any:
    """The message that makes `claims` instead of its own.

    Parameters
    ----------
    message, message_type
        As received.
    claims : tuple of Claim
        What it shall claim.
    rig : Rig
        To turn body axes back into the sensor's.
    origin : GeodeticPoint, optional
        Of the ENU coordinates of GNSS claims.

    Examples
    --------
    >>> from belie.geometry import SE3
    >>> from belie.recordings.messages import odometry
    >>> from belie.recordings.transforms import TransformTree
    >>> rig = Rig(frames=TransformTree(), body="base_link", image_frame="cam")
    >>> honest = PoseClaim(source="/odom", frame_id="odom", stamp_ns=1, received_ns=1, T_odom_body=SE3.identity())
    >>> lie = replace(honest, T_odom_body=SE3.from_translation([0.0, 2.0, 0.0]))
    >>> rewritten(odometry(honest, None, "base_link"), ros.ODOMETRY, (lie,), rig, None).pose.pose.position.y
    2.0
    """
    for claim in claims:
        if isinstance(claim, PoseClaim):
            message = _posed(message, message_type, pose_message(claim.T_odom_body))
        elif isinstance(claim, PositionClaim) and message_type == ros.FIX and origin is not None:
            point = geodetic_of_enu(claim.position_m, origin)
            message = replace(
                message,
                latitude=point.latitude_deg,
                longitude=point.longitude_deg,
                altitude=point.altitude_m,
            )
        elif isinstance(claim, PositionClaim):
            pose = message.pose.pose if message_type == ros.POSE_COVARIANCE else message.pose
            x, y, z = (float(v) for v in claim.position_m)
            position = new("geometry_msgs/msg/Point", x=x, y=y, z=z)
            message = _posed(message, message_type, replace(pose, position=position))
        elif isinstance(claim, DetectionClaim):
            _, message = detections(without_sizes_of_boxed(claim), rig.image_frame, empty_as=message_type)
        elif isinstance(claim, MotionClaim) and claim.kind == "imu":
            message = _imu(message, claim, rig)
        elif isinstance(claim, MotionClaim):
            message = _twisted(message, claim)
    return message


def _vector(values: FloatArray) -> Any:
    x, y, z = (float(v) for v in np.asarray(values))
    return new("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def _posed(message: Any, message_type: str, pose: Any) -> Any:
    if message_type in (ros.ODOMETRY, ros.POSE_COVARIANCE):
        return replace(message, pose=replace(message.pose, pose=pose))
    return replace(message, pose=pose)


def _twisted(message: Any, claim: MotionClaim) -> Any:
    twist = message.twist.twist
    if claim.linear_m_s is not None:
        twist = replace(twist, linear=_vector(claim.linear_m_s))
    if claim.angular_rad_s is not None:
        twist = replace(twist, angular=_vector(claim.angular_rad_s))
    return replace(message, twist=replace(message.twist, twist=twist))


def _imu(message: Any, claim: MotionClaim, rig: Rig) -> Any:
    R_imu_body = rig.R_body_imu(message.header.frame_id).T
    if claim.angular_rad_s is not None:
        message = replace(message, angular_velocity=_vector(R_imu_body @ claim.angular_rad_s))
    if claim.acceleration_m_s2 is not None:
        message = replace(message, linear_acceleration=_vector(R_imu_body @ claim.acceleration_m_s2))
    return message
