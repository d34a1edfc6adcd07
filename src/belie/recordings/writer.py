"""Recordings to ROS 2 MCAP, with the message definitions inside: Foxglove and ``ros2 bag`` open it.

Topics keep their names where ROS allows them. The body's frame is ``base_link`` where it is x forward,
y left, z up, and ``body_optical`` where it is x right, y down, z forward (REP 103's suffix).
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter

from belie.geometry import SE3, FloatArray
from belie.recordings import messages, topics, vision_messages
from belie.recordings.geodesy import GeodeticPoint
from belie.recordings.recording import BodyAxes, Recording
from belie.types import (
    DetectionClaim,
    MotionClaim,
    MountedCamera,
    PoseClaim,
    PositionClaim,
    RecordingError,
    Step,
)

ImageEncoding = Literal["png", "mono8", "jpeg"]

CAMERA_FRAME = "camera_optical_frame"
ANTENNA_FRAME = "gnss_antenna"
BODY_FRAMES: dict[BodyAxes, str] = {"flu": "base_link", "rdf": "body_optical"}

_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_FOREVER = QosTime(2147483647, 4294967295)
LATCHED = Qos(
    QosHistory.KEEP_LAST,
    1,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    _FOREVER,
    _FOREVER,
    QosLiveliness.AUTOMATIC,
    _FOREVER,
    False,
)


def write_mcap(
    path: str | Path,
    recording_or_steps: Recording | Iterable[Step],
    *,
    cameras: Mapping[str, MountedCamera],
    body_axes: BodyAxes,
    image_encoding: ImageEncoding = "png",
    jpeg_quality: int = messages.JPEG_QUALITY,
    geodetic_origin: GeodeticPoint | None = None,
    progress: Callable[[int], None] | None = None,
) -> None:
    """Write a recording as ROS 2 MCAP.

    Stamps stay exact to the nanosecond, numbers to float64, images to the byte (``jpeg`` excepted), so
    that what is read back gets the same verdicts. GNSS claims pass through latitude and longitude, to a
    nanometre.

    Parameters
    ----------
    path : path
        A name that ends in ``.mcap`` gives one file, any other a bag folder with ``metadata.yaml``.
    recording_or_steps : Recording or iterable of Step
        What to write.
    cameras : mapping
        The one camera and where it sits.
    body_axes : "flu" or "rdf"
        Axes of the body frame.
    image_encoding : "png", "mono8" or "jpeg"
        png and mono8 are lossless.
    jpeg_quality : int
        1 to 100, for ``jpeg``.
    geodetic_origin : GeodeticPoint, optional
        Of the ENU coordinates of GNSS claims; by default the recording's own, else 0 N 0 E.
    progress : callable, optional
        Is given the number of frames written so far.

    Raises
    ------
    RecordingError
        If the target exists, or a motion claim has no pose claim to travel with.

    Examples
    --------
    >>> import numpy as np
    >>> from belie.geometry import CameraModel
    >>> from belie.recordings import open_recording
    >>> from belie.types import Frame
    >>> frame = Frame(camera="/cam/image", stamp_ns=7, received_ns=9, image=np.zeros((48, 64), np.uint8))
    >>> camera = MountedCamera(
    ...     model=CameraModel(width=64, height=48, fx=60, fy=60, cx=31.5, cy=23.5), T_body_cam=SE3.identity())
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     target = Path(folder) / "out.mcap"
    ...     write_mcap(target, [Step(frame=frame)], cameras={"/cam/image": camera}, body_axes="rdf")
    ...     [step.frame.stamp_ns for step in open_recording(target).steps()]
    [7]
    """
    path = Path(path)
    if path.exists():
        raise RecordingError(f"{path} exists already; remove it, or choose another name")
    if len(cameras) != 1:
        raise ValueError(f"a recording has one camera, got {sorted(cameras)}")
    if image_encoding not in ("png", "mono8", "jpeg"):
        raise ValueError(f"image_encoding must be png, mono8 or jpeg, got {image_encoding!r}")
    if not 1 <= jpeg_quality <= 100:
        raise ValueError(f"jpeg_quality is 1 to 100, got {jpeg_quality}")
    steps: Iterable[Step]
    if hasattr(recording_or_steps, "steps"):
        geodetic_origin = geodetic_origin or getattr(recording_or_steps, "geodetic_origin", None)
        steps = recording_or_steps.steps()
    else:
        steps = recording_or_steps
    origin = geodetic_origin or GeodeticPoint(latitude_deg=0.0, longitude_deg=0.0, altitude_m=0.0)
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".belie-") as scratch:
        folder = Path(scratch) / path.stem
        with BagWriter(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
            out = _Output(bag, cameras, body_axes, image_encoding, jpeg_quality, origin)
            for count, step in enumerate(steps, start=1):
                out.write(step)
                if progress is not None:
                    progress(count)
            out.close()
        if path.suffix == ".mcap":
            (folder / f"{path.stem}.mcap").replace(path)
        else:
            shutil.move(folder, path)


class _Output:
    """The open bag and the topics in it."""

    def __init__(
        self,
        bag: BagWriter,
        cameras: Mapping[str, MountedCamera],
        body_axes: BodyAxes,
        encoding: ImageEncoding,
        jpeg_quality: int,
        origin: GeodeticPoint,
    ) -> None:
        self.bag, self.encoding, self.origin = bag, encoding, origin
        self.jpeg_quality = jpeg_quality
        self.body = BODY_FRAMES[body_axes]
        ((name, self.mounted),) = cameras.items()
        base = topics.camera_name(_ros_name(name, "/camera/image"))
        self.image_topic = base if encoding == "mono8" else f"{base}/compressed"
        self.info_topic = base.rsplit("/", 1)[0] + "/camera_info"
        self.connections: dict[tuple[str, str], Connection] = {}
        self.frames_written = False
        self.lever_m: FloatArray | None = None
        self.empty: dict[str, list[DetectionClaim]] = {}

    def write(self, step: Step) -> None:
        """Write a frame and its claims."""
        frame = step.frame
        if not self.frames_written:
            self._fixed_frames(step)
        self._claims(step)
        self._put(
            self.image_topic,
            topics.IMAGE if self.encoding == "mono8" else topics.COMPRESSED,
            messages.image(frame.image, frame.stamp_ns, CAMERA_FRAME, self.encoding, self.jpeg_quality),
            frame.received_ns,
        )
        info = messages.camera_info(self.mounted.model, frame.stamp_ns, CAMERA_FRAME)
        self._put(self.info_topic, topics.CAMERA_INFO, info, frame.received_ns)

    def _fixed_frames(self, step: Step) -> None:
        received_ns = min([step.frame.received_ns, *(claim.received_ns for claim in step.claims)])
        self._edges([(self.body, CAMERA_FRAME, self.mounted.T_body_cam)], received_ns)
        self.frames_written = True

    def _edges(self, edges: list[tuple[str, str, SE3]], received_ns: int) -> None:
        self._put("/tf_static", topics.TRANSFORMS, messages.transforms(edges, received_ns), received_ns)

    def _claims(self, step: Step) -> None:
        twists = {
            (claim.source, claim.stamp_ns, claim.received_ns): claim
            for claim in step.claims
            if isinstance(claim, MotionClaim) and claim.kind == "twist"
        }
        for claim in step.claims:
            if isinstance(claim, PoseClaim):
                motion = twists.pop((claim.source, claim.stamp_ns, claim.received_ns), None)
                message = messages.odometry(claim, motion, self.body)
                self._put(_ros_name(claim.source, "/odom"), topics.ODOMETRY, message, claim.received_ns)
            elif isinstance(claim, PositionClaim):
                self._position(claim)
            elif isinstance(claim, DetectionClaim):
                self._detections(claim)
            elif claim.kind == "imu":
                message = messages.imu(claim, self.body)
                self._put(_ros_name(claim.source, "/imu"), topics.IMU, message, claim.received_ns)
        if twists:
            source, stamp_ns, _ = next(iter(twists))
            raise RecordingError(
                f"the twist of {source} at {stamp_ns / 1e9:.6f} s has no pose of the same stamp; "
                "nav_msgs/Odometry holds both: shift pose and twist together"
            )

    def _detections(self, claim: DetectionClaim) -> None:
        topic = _ros_name(claim.source, "/detections")
        known = next((kind for name, kind in self.connections if name == topic), None)
        if not claim.detections and known is None:
            # Whether the topic has boxes in the image or in space shows with its first object.
            self.empty.setdefault(topic, []).append(claim)
            return
        kind, message = vision_messages.detections(claim, CAMERA_FRAME, empty_as=known)
        for earlier in self.empty.pop(topic, ()):
            _, nothing = vision_messages.detections(earlier, CAMERA_FRAME, empty_as=kind)
            self._put(topic, kind, nothing, earlier.received_ns)
        self._put(topic, kind, message, claim.received_ns)

    def close(self) -> None:
        """Write what waited for a first object that never came."""
        for topic, claims in self.empty.items():
            for claim in claims:
                kind, message = vision_messages.detections(claim, CAMERA_FRAME)
                self._put(topic, kind, message, claim.received_ns)

    def _position(self, claim: PositionClaim) -> None:
        if claim.kind == "localisation":
            topic = _ros_name(claim.source, "/localization/pose")
            self._put(topic, topics.POSE_COVARIANCE, messages.localisation(claim), claim.received_ns)
            return
        if claim.lever_m is not None and self.lever_m is None:
            self.lever_m = claim.lever_m
            edge = (self.body, ANTENNA_FRAME, SE3.from_translation(claim.lever_m))
            self._edges([edge], claim.received_ns)
        antenna = self.body if claim.lever_m is None else ANTENNA_FRAME
        message = messages.fix(claim, self.origin, antenna)
        self._put(_ros_name(claim.source, "/fix"), topics.FIX, message, claim.received_ns)

    def _put(self, topic: str, message_type: str, message: Any, received_ns: int) -> None:
        key = (topic, message_type)
        if key not in self.connections:
            if any(known == topic for known, _ in self.connections):
                raise RecordingError(f"{topic} carries claims of two kinds; a ROS topic has one message type")
            latched = [LATCHED] if topic == "/tf_static" else []
            self.connections[key] = self.bag.add_connection(
                topic, message_type, typestore=messages.STORE, offered_qos_profiles=latched
            )
        data = messages.STORE.serialize_cdr(message, message_type)
        self.bag.write(self.connections[key], received_ns, data)


def _ros_name(name: str, instead: str) -> str:
    return name if _TOPIC.fullmatch(name) else instead
