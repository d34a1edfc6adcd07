"""Object detections to ROS 2 messages and back: ``vision_msgs``, which no default typestore holds.

The definitions are those of vision_msgs 4 (ROS 2 Humble and later). Readers also take the field names of its
predecessors (ROS 1, ROS 2 Foxy and Galactic), which a bag's own definitions announce.

An image box and a position in space fit into one Detection2D; an object's dimensions need a Detection3D, which has
no image box.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from rosbags.typesys import get_types_from_msg

from belie.geometry import SE3, FloatArray
from belie.recordings.claims import known_covariance, pose_of, stamp_ns
from belie.recordings.messages import STORE, header, new, pose_message
from belie.recordings.topics import DETECTIONS_2D, DETECTIONS_3D
from belie.recordings.transforms import frame_name
from belie.types import Detection, DetectionClaim, RecordingError

_DEFINITIONS = {
    "Point2D": "float64 x\nfloat64 y",
    "Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
    "ObjectHypothesis": "string class_id\nfloat64 score",
    "ObjectHypothesisWithPose": "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    "Detection2D": "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
    "vision_msgs/BoundingBox2D bbox\nstring id",
    "Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
    "Detection3D": "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
    "vision_msgs/BoundingBox3D bbox\nstring id",
    "Detection3DArray": "std_msgs/Header header\nvision_msgs/Detection3D[] detections",
}
VISION_TYPES = {
    name: fields
    for short, text in _DEFINITIONS.items()
    for name, fields in get_types_from_msg(text, f"vision_msgs/msg/{short}").items()
}
STORE.register(VISION_TYPES)

_ANY_ATTITUDE_RAD2 = math.pi**2  # variance of an angle that is not known


def detections(claim: DetectionClaim, frame_id: str, *, empty_as: str | None = None) -> tuple[str, Any]:
    """The message type and the message of a claim, in the camera's frame `frame_id`.

    A claim without objects fits both types: it becomes `empty_as`, by default a Detection2DArray.

    Raises
    ------
    RecordingError
        If a detection has both an image box and dimensions, or some have boxes and some have none.

    Examples
    --------
    >>> box = Detection(label="car", score=0.9, track_id="7", box_px=[10, 20, 50, 40])
    >>> claim = DetectionClaim(source="/detections", stamp_ns=0, received_ns=0, detections=(box,))
    >>> detections(claim, "camera")[1].detections[0].bbox.center.position.x
    30.0
    """
    boxed = {detection.box_px is not None for detection in claim.detections}
    sized = any(detection.dimensions_m is not None for detection in claim.detections)
    if boxed == {True, False} or (sized and True in boxed):
        raise RecordingError(
            f"{claim.source} mixes image boxes with dimensions in space at {claim.stamp_ns / 1e9:.6f} s; "
            "vision_msgs has Detection2DArray for the one and Detection3DArray for the other: send two claims"
        )
    flat = boxed != {False} if boxed else empty_as != DETECTIONS_3D
    short, bbox = ("Detection2D", _bbox_2d) if flat else ("Detection3D", _bbox_3d)
    stamped = header(claim.stamp_ns, frame_id)
    entries = [
        new(
            f"vision_msgs/msg/{short}",
            header=stamped,
            results=[_result(detection)],
            bbox=bbox(detection),
            id=detection.track_id,
        )
        for detection in claim.detections
    ]
    kind = DETECTIONS_2D if flat else DETECTIONS_3D
    return kind, new(kind, header=stamped, detections=entries)


def without_sizes_of_boxed(claim: DetectionClaim) -> DetectionClaim:
    """The claim as one message can hold it: what has an image box loses its dimensions in space.

    >>> box = Detection(label="car", score=0.9, box_px=[10, 20, 50, 40], dimensions_m=[4.2, 1.8, 1.5])
    >>> claim = DetectionClaim(source="/detections", stamp_ns=0, received_ns=0, detections=(box,))
    >>> without_sizes_of_boxed(claim).detections[0].dimensions_m is None
    True
    """
    if all(one.box_px is None or one.dimensions_m is None for one in claim.detections):
        return claim
    bare = (one if one.box_px is None else replace(one, dimensions_m=None) for one in claim.detections)
    return replace(claim, detections=tuple(bare))


def _result(detection: Detection) -> Any:
    covariance = np.zeros((6, 6))
    if detection.covariance is not None:
        covariance[:3, :3] = detection.covariance
    if detection.T_cam_obj is None and detection.position_m is not None:
        covariance[3:, 3:] = _ANY_ATTITUDE_RAD2 * np.eye(3)
    return new(
        "vision_msgs/msg/ObjectHypothesisWithPose",
        hypothesis=new(
            "vision_msgs/msg/ObjectHypothesis", class_id=detection.label, score=float(detection.score)
        ),
        pose=new(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=pose_message(_pose(detection)),
            covariance=covariance.ravel(),
        ),
    )


def _pose(detection: Detection) -> SE3:
    if detection.T_cam_obj is not None:
        return detection.T_cam_obj
    return SE3.identity() if detection.position_m is None else SE3.from_translation(detection.position_m)


def _bbox_2d(detection: Detection) -> Any:
    assert detection.box_px is not None
    left, top, right, bottom = (float(edge) for edge in detection.box_px)
    middle = new("vision_msgs/msg/Point2D", x=0.5 * (left + right), y=0.5 * (top + bottom))
    center = new("vision_msgs/msg/Pose2D", position=middle, theta=0.0)
    return new("vision_msgs/msg/BoundingBox2D", center=center, size_x=right - left, size_y=bottom - top)


def _bbox_3d(detection: Detection) -> Any:
    size = np.zeros(3) if detection.dimensions_m is None else detection.dimensions_m
    x, y, z = (float(side) for side in size)
    size_message = new("geometry_msgs/msg/Vector3", x=x, y=y, z=z)
    return new("vision_msgs/msg/BoundingBox3D", center=pose_message(_pose(detection)), size=size_message)


class DetectionReader:
    """``Detection2DArray`` or ``Detection3DArray`` to a detection claim.

    Of several hypotheses the likeliest is taken. A pose that is all zero means unknown, and an attitude is unknown
    where its variance is that of any angle, or where it stands at identity without a covariance.

    Parameters
    ----------
    topic : str
        Source of the claims.
    T_cam_of : callable
        Name of a frame to the transform from it to the camera's axes; raises `CalibrationError`.

    Examples
    --------
    >>> there = Detection(label="car", score=0.5, position_m=[1.0, 2.0, 30.0], dimensions_m=[4.0, 1.8, 1.5])
    >>> claim = DetectionClaim(source="/objects", stamp_ns=7, received_ns=9, detections=(there,))
    >>> _, message = detections(claim, "camera")
    >>> (back,) = DetectionReader("/objects", lambda frame: SE3.identity())(message, 9, 0)
    >>> back.detections[0].position_m, back.detections[0].T_cam_obj is None
    (array([ 1.,  2., 30.]), True)
    """

    def __init__(self, topic: str, T_cam_of: Callable[[str], SE3]) -> None:
        self.topic = topic
        self._T_cam_of = T_cam_of

    def __call__(self, message: Any, received_ns: int, index: int) -> tuple[DetectionClaim, ...]:
        """The claim of one message; detections without a hypothesis say nothing and are left out."""
        at_ns = stamp_ns(message)
        found = [
            self._detection(entry, message.header.frame_id, index, at_ns) for entry in message.detections
        ]
        kept = tuple(detection for detection in found if detection is not None)
        return (DetectionClaim(source=self.topic, stamp_ns=at_ns, received_ns=received_ns, detections=kept),)

    def _detection(self, entry: Any, frame_id: str, index: int, at_ns: int) -> Detection | None:
        if not len(entry.results):
            return None
        best = max(entry.results, key=lambda result: float(_hypothesis(result).score))
        hypothesis = _hypothesis(best)
        score = float(hypothesis.score)
        numbers = [score]
        box_px, dimensions_m = None, None
        if hasattr(entry.bbox, "size_x"):
            box_px = _edges_px(entry.bbox)
            numbers += box_px.tolist()
        else:
            size = np.array([entry.bbox.size.x, entry.bbox.size.y, entry.bbox.size.z], dtype=np.float64)
            dimensions_m = size if size.any() else None
            numbers += size.tolist()
        if not all(math.isfinite(number) for number in numbers):
            raise RecordingError(
                f"a detection of {self.topic} holds NaN or infinity in message {index} "
                f"(stamp {at_ns / 1e9:.6f} s); mend the detector"
            )
        T_cam_obj, position_m, covariance = self._place(entry, best, frame_id, index, at_ns)
        return Detection(
            label=str(getattr(hypothesis, "class_id", "") or getattr(hypothesis, "id", "")),
            score=min(max(score, 0.0), 1.0),  # some detectors score beyond: as sure, or as unsure, as can be
            track_id=str(getattr(entry, "id", "") or getattr(entry, "tracking_id", "")),
            box_px=box_px,
            T_cam_obj=T_cam_obj,
            position_m=position_m,
            covariance=covariance,
            dimensions_m=dimensions_m,
        )

    def _place(
        self, entry: Any, best: Any, frame_id: str, index: int, at_ns: int
    ) -> tuple[SE3 | None, FloatArray | None, FloatArray | None]:
        """Pose, position and covariance in camera axes; each None where it is unknown."""
        covariance = known_covariance(best.pose.covariance, 6)
        told: Any = next((p for p in (best.pose.pose, entry.bbox.center) if _is_told(p)), None)
        if told is None:
            return None, None, None
        q = told.orientation
        still = not any((q.x, q.y, q.z))  # identity, or four zeros
        if still:
            p = told.position
            T_frame_obj = SE3.from_translation([p.x, p.y, p.z])
        else:
            T_frame_obj = pose_of(told, topic=self.topic, index=index, at_ns=at_ns)
        T_cam_frame = self._T_cam_of(frame_name(str(frame_id or entry.header.frame_id)))
        T_cam_obj = T_cam_frame @ T_frame_obj
        position_covariance = None
        if covariance is not None and covariance[:3, :3].any():
            position_covariance = T_cam_frame.R @ covariance[:3, :3] @ T_cam_frame.R.T
        vague = covariance is not None and float(np.diag(covariance)[3:].max()) >= _ANY_ATTITUDE_RAD2
        if vague or (still and (covariance is None or not covariance[3:, 3:].any())):
            return None, T_cam_obj.t, position_covariance
        return T_cam_obj, T_cam_obj.t, position_covariance


def _hypothesis(result: Any) -> Any:
    return getattr(result, "hypothesis", result)


def _is_told(message_pose: Any) -> bool:
    """Whether a pose in space is filled in: an object never stands in the camera's own centre."""
    position: Any = getattr(message_pose, "position", None)
    return hasattr(position, "z") and any((position.x, position.y, position.z))


def _edges_px(bbox: Any) -> FloatArray:
    center = getattr(bbox.center, "position", bbox.center)
    half_x, half_y = 0.5 * abs(float(bbox.size_x)), 0.5 * abs(float(bbox.size_y))
    x, y = float(center.x), float(center.y)
    return np.array([x - half_x, y - half_y, x + half_x, y + half_y])
