"""From the first messages of the chosen topics to what reads all that follow: camera, frames, claim readers.

A bag and a running robot tell the same things in the same messages; both are set up here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from belie.geometry import SE3, FloatArray
from belie.recordings import topics as ros
from belie.recordings.claims import FixReader, ImuReader, OdometryReader, PoseReader, fix_of
from belie.recordings.geodesy import GeodeticPoint
from belie.recordings.recording import BodyAxes
from belie.recordings.transforms import TransformTree, frame_name
from belie.recordings.vision_messages import DetectionReader
from belie.types import Claim

ClaimReader = Callable[[Any, int, int], tuple[Claim, ...]]
"""Message, receive time [ns] and index on its topic to claims."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """The names of the frames on a robot, and the fixed transforms between them.

    Parameters
    ----------
    frames : TransformTree
        What /tf_static tells.
    body, image_frame : str
        The frame that claims are about, and the camera's.

    Examples
    --------
    >>> rig = Rig(frames=TransformTree(), body="cam", image_frame="cam")
    >>> rig.T_body_cam.t
    array([0., 0., 0.])
    >>> rig.body_axes
    'rdf'
    """

    frames: TransformTree
    body: str
    image_frame: str

    @property
    def T_body_cam(self) -> SE3:
        """Where the camera sits.

        Raises
        ------
        CalibrationError
            If /tf_static does not tell.
        """
        return self.frames.require(self.body, self.image_frame)

    @property
    def body_axes(self) -> BodyAxes:
        """REP 103: frames that end in _optical are x right, y down, z forward; so is an image's own frame."""
        optical = self.body == self.image_frame or self.body.endswith(("_optical", "_optical_frame"))
        return "rdf" if optical else "flu"

    def R_body_imu(self, imu_frame: str) -> FloatArray:
        """Attitude of an IMU on the body; raises `CalibrationError` where /tf_static does not tell."""
        instead = "; or leave the IMU out with --imu none"
        return self.frames.require(self.body, frame_name(imu_frame), instead=instead).R

    def T_cam_of(self, frame: str) -> SE3:
        """Where detections' frame lies for the camera; an empty frame_id can only mean the image's own frame."""
        instead = "; or leave the objects out with --detections none"
        return self.frames.require(self.image_frame, frame or self.image_frame, instead=instead)

    def origin_and_lever(self, fix: Any) -> tuple[GeodeticPoint, FloatArray | None] | None:
        """ENU origin and antenna place (None: at the body's origin, or unknown) by a message; None without a fix."""
        point = fix_of(fix)
        if point is None:
            return None
        T_body_antenna = self.frames.find(self.body, fix.header.frame_id)
        at_origin = T_body_antenna is None or not T_body_antenna.t.any()
        return point, None if at_origin or T_body_antenna is None else T_body_antenna.t


def claim_reader(rig: Rig, topic: ros.Topic, *, as_odometry: bool, first: Any) -> ClaimReader | None:
    """A fresh reader of a topic's messages, given the first of them; None for a fix that is none.

    Raises
    ------
    CalibrationError
        If a transform is missing.

    Examples
    --------
    >>> rig = Rig(frames=TransformTree(), body="base_link", image_frame="cam")
    >>> topic = ros.Topic(name="/odom", message_type=ros.ODOMETRY, count=1)
    >>> type(claim_reader(rig, topic, as_odometry=True, first=None)).__name__
    'OdometryReader'
    """
    name, kind = topic.name, topic.message_type
    if kind == ros.ODOMETRY:
        return OdometryReader(name)
    if kind in (ros.POSE, ros.POSE_COVARIANCE):
        return PoseReader(name, as_odometry=as_odometry)
    if kind == ros.IMU:
        return ImuReader(name, rig.R_body_imu(first.header.frame_id))
    if kind in (ros.DETECTIONS_2D, ros.DETECTIONS_3D):
        return DetectionReader(name, rig.T_cam_of)
    found = rig.origin_and_lever(first)
    return None if found is None else FixReader(name, origin=found[0], lever_m=found[1])
