"""Claims and images to ROS 2 messages: the inverse of `belie.recordings.claims`."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import simplejpeg
from rosbags.typesys import Stores, get_typestore

from belie.geometry import SE3, CameraModel, FloatArray
from belie.recordings.geodesy import GeodeticPoint, geodetic_of_enu
from belie.types import GrayImage, MotionClaim, PoseClaim, PositionClaim

STORE = get_typestore(Stores.LATEST)

JPEG_QUALITY = 95
_UNMEASURED = np.full(3, np.nan)


def new(message_type: str, **fields: Any) -> Any:
    """A message of a type such as ``std_msgs/msg/Header``."""
    return STORE.types[message_type](**fields)


def header(stamp_ns: int, frame_id: str) -> Any:
    """A header at a stamp in nanoseconds.

    >>> header(1_500_000_000, "odom").stamp.nanosec
    500000000
    """
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    stamp = new("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return new("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)


def _vector(values: FloatArray) -> Any:
    x, y, z = (float(v) for v in values)
    return new("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def _quaternion(R: FloatArray) -> Any:
    from scipy.spatial.transform import Rotation  # slow to import, and only writing needs it

    x, y, z, w = (float(v) for v in Rotation.from_matrix(R).as_quat(canonical=True))
    return new("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)


def pose_message(T: SE3) -> Any:
    """``geometry_msgs/Pose`` of a transform.

    >>> pose_message(SE3.from_translation([1.0, 2.0, 3.0])).position.z
    3.0
    """
    x, y, z = (float(v) for v in T.t)
    position = new("geometry_msgs/msg/Point", x=x, y=y, z=z)
    return new("geometry_msgs/msg/Pose", position=position, orientation=_quaternion(T.R))


def _flat(covariance: FloatArray | None, size: int) -> FloatArray:
    return np.zeros(size * size) if covariance is None else np.array(covariance, dtype=np.float64).ravel()


def odometry(pose: PoseClaim, motion: MotionClaim | None, body: str) -> Any:
    """``nav_msgs/Odometry``; without a motion claim its twist stays zero, an unmeasured half is NaN."""
    linear = angular = np.zeros(3)
    if motion is not None:
        linear = _UNMEASURED if motion.linear_m_s is None else motion.linear_m_s
        angular = _UNMEASURED if motion.angular_rad_s is None else motion.angular_rad_s
    twist = new("geometry_msgs/msg/Twist", linear=_vector(linear), angular=_vector(angular))
    return new(
        "nav_msgs/msg/Odometry",
        header=header(pose.stamp_ns, pose.frame_id),
        child_frame_id=body,
        pose=new(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=pose_message(pose.T_odom_body),
            covariance=_flat(pose.covariance, 6),
        ),
        twist=new(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=twist,
            covariance=_flat(motion.covariance if motion is not None else None, 6),
        ),
    )


def localisation(claim: PositionClaim) -> Any:
    """``geometry_msgs/PoseWithCovarianceStamped``; its orientation is none of the claim's."""
    covariance = np.zeros((6, 6))
    if claim.covariance is not None:
        covariance[:3, :3] = claim.covariance
        covariance[3:, 3:] = np.pi**2 * np.eye(3)
    return new(
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        header=header(claim.stamp_ns, claim.frame_id),
        pose=new(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=pose_message(SE3.from_translation(claim.position_m)),
            covariance=covariance.ravel(),
        ),
    )


def fix(claim: PositionClaim, origin: GeodeticPoint, antenna: str) -> Any:
    """``sensor_msgs/NavSatFix`` of a claim in ENU metres about `origin`."""
    point = geodetic_of_enu(claim.position_m, origin)
    return new(
        "sensor_msgs/msg/NavSatFix",
        header=header(claim.stamp_ns, antenna),
        status=new("sensor_msgs/msg/NavSatStatus", status=0, service=1),
        latitude=point.latitude_deg,
        longitude=point.longitude_deg,
        altitude=point.altitude_m,
        position_covariance=_flat(claim.covariance, 3),
        position_covariance_type=0 if claim.covariance is None else 3,
    )


def imu(claim: MotionClaim, body: str) -> Any:
    """``sensor_msgs/Imu`` in the body's frame; what is not measured has -1 as its first covariance."""
    absent = np.array([-1.0] + [0.0] * 8)
    unknown = np.zeros(9)
    rate, force = claim.angular_rad_s, claim.acceleration_m_s2
    rate_covariance = unknown if claim.covariance is None else claim.covariance[3:, 3:].ravel()
    return new(
        "sensor_msgs/msg/Imu",
        header=header(claim.stamp_ns, body),
        orientation=new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=absent,
        angular_velocity=_vector(np.zeros(3) if rate is None else rate),
        angular_velocity_covariance=absent if rate is None else rate_covariance,
        linear_acceleration=_vector(np.zeros(3) if force is None else force),
        linear_acceleration_covariance=absent if force is None else unknown,
    )


def camera_info(camera: CameraModel, stamp_ns: int, frame_id: str) -> Any:
    """``sensor_msgs/CameraInfo`` of a camera; the projection is its intrinsic matrix.

    >>> camera = CameraModel(width=64, height=48, fx=60, fy=60, cx=31.5, cy=23.5)
    >>> camera_info(camera, 0, "cam").distortion_model
    'plumb_bob'
    """
    names = {
        "pinhole": "plumb_bob",
        "radial_tangential": "plumb_bob",
        "rational": "rational_polynomial",
        "equidistant": "equidistant",
    }
    distortion = camera.distortion or (0.0,) * 5
    return new(
        "sensor_msgs/msg/CameraInfo",
        header=header(stamp_ns, frame_id),
        height=camera.height,
        width=camera.width,
        distortion_model=names[camera.model],
        d=np.array(distortion, dtype=np.float64),
        k=camera.K.ravel(),
        r=np.eye(3).ravel(),
        p=np.column_stack([camera.K, np.zeros(3)]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=new(
            "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        ),
    )


def image(
    gray: GrayImage, stamp_ns: int, frame_id: str, encoding: str, jpeg_quality: int = JPEG_QUALITY
) -> Any:
    """``sensor_msgs/Image`` (mono8) or ``CompressedImage`` (png, jpeg)."""
    if encoding == "mono8":
        return new(
            "sensor_msgs/msg/Image",
            header=header(stamp_ns, frame_id),
            height=gray.shape[0],
            width=gray.shape[1],
            encoding="mono8",
            is_bigendian=0,
            step=gray.shape[1],
            data=np.ascontiguousarray(gray).ravel(),
        )
    if encoding == "png":
        # The fastest level: images of outdoor scenes hardly shrink further.
        _, data = cv2.imencode(".png", gray, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        payload = np.asarray(data, dtype=np.uint8).ravel()
    else:
        packed = simplejpeg.encode_jpeg(np.ascontiguousarray(gray)[:, :, None], jpeg_quality, "GRAY", "Gray")
        payload = np.frombuffer(packed, np.uint8)
    return new(
        "sensor_msgs/msg/CompressedImage",
        header=header(stamp_ns, frame_id),
        format=encoding,
        data=payload,
    )


def transforms(edges: list[tuple[str, str, SE3]], stamp_ns: int) -> Any:
    """``tf2_msgs/TFMessage`` of (parent, child, T_parent_child)."""
    return new(
        "tf2_msgs/msg/TFMessage",
        transforms=[
            new(
                "geometry_msgs/msg/TransformStamped",
                header=header(stamp_ns, parent),
                child_frame_id=child,
                transform=new(
                    "geometry_msgs/msg/Transform", translation=_vector(T.t), rotation=_quaternion(T.R)
                ),
            )
            for parent, child, T in edges
        ],
    )
