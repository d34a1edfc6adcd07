"""A running robot introduces itself: what its first messages tell, as a bag's do."""

from __future__ import annotations

from typing import Any

from belie.geometry import CameraModel
from belie.recordings import topics as ros
from belie.recordings.calibration import CameraInfo
from belie.recordings.first_messages import body_frame, camera_of
from belie.recordings.rig import Rig
from belie.recordings.transforms import TransformTree, frame_name
from belie.types import CalibrationError, MountedCamera

TF_STATIC = "/tf_static"


class Introduction:
    """What is known so far of frames, camera and body.

    Parameters
    ----------
    choice : Choice
        The topics that play a part.
    info_by_name : bool
        The user named the camera info, so that it need not share the images' frame.

    Examples
    --------
    >>> image = ros.Topic(name="/cam/image_raw", message_type=ros.IMAGE, count=1)
    >>> info = ros.Topic(name="/cam/camera_info", message_type=ros.CAMERA_INFO, count=1)
    >>> choice = ros.Choice(image=image, camera_info=info, odometry=None, position=None, imu=None, detections=None)
    >>> Introduction(choice, info_by_name=False).lacking()
    ('/cam/image_raw', '/cam/camera_info')
    """

    def __init__(self, choice: ros.Choice, *, info_by_name: bool) -> None:
        self.choice = choice
        self.frames = TransformTree()
        self._info_by_name = info_by_name
        self._info: Any | None = None
        self._image_frame: str | None = None
        self.image_size: tuple[int, int] | None = None
        self._child: str | None = None
        self._heard: set[str] = set()

    def hear_info(self, message: Any) -> bool:
        """Take a camera info; True where it describes another camera than the one before."""
        known = None if self._info is None else CameraInfo.from_message(self._info)
        self._heard.add(self.choice.camera_info.name)
        self._info = message
        return known is not None and known != CameraInfo.from_message(message)

    def hear_image(self, frame_id: str, size: tuple[int, int]) -> None:
        """Take an image's frame and its size (width, height)."""
        self._heard.add(self.choice.image.name)
        self._image_frame, self.image_size = frame_name(frame_id), size

    def hear_claim(self, topic: str, message: Any) -> None:
        """Take a message of a claim topic."""
        self._heard.add(topic)
        self._child = self.child_frame(topic, message) or self._child

    def child_frame(self, topic: str, message: Any) -> str:
        """The frame whose motion a message of the chosen odometry tells; empty for any other message."""
        odometry = self.choice.odometry
        if odometry is None or topic != odometry.name or odometry.message_type != ros.ODOMETRY:
            return ""
        return frame_name(message.child_frame_id)

    def lacking(self) -> tuple[str, ...]:
        """The chosen topics that have said nothing yet."""
        return tuple(topic.name for topic in self.choice.all if topic.name not in self._heard)

    @property
    def knows_camera(self) -> bool:
        """Whether images and camera info have come."""
        return self._info is not None and self._image_frame is not None

    def rig(self) -> Rig:
        """Frames and body; `knows_camera` must hold."""
        image_frame = self._image_frame or ""
        body = self._child or body_frame(self.frames, image_frame, claims=bool(self.choice.claims))
        return Rig(frames=self.frames, body=body, image_frame=image_frame)

    def camera(self) -> MountedCamera:
        """The camera, mounted.

        Raises
        ------
        CalibrationError
            If its calibration is missing or for another size, or no transform tells where it sits.
        """
        if self.image_size is None or self._info is None:
            raise CalibrationError("no image and camera info have come yet")
        model: CameraModel = camera_of(
            self._info,
            self.choice,
            image_frame=self._image_frame or "",
            image_size=self.image_size,
            by_name=self._info_by_name,
        )
        return MountedCamera(model=model, T_body_cam=self.rig().T_body_cam)
