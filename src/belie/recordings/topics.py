"""Which topic plays which part: found by message type, or named by the user."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from belie.recordings.recording import Role
from belie.types import AmbiguousTopicError, TopicError

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
FIX = "sensor_msgs/msg/NavSatFix"
IMU = "sensor_msgs/msg/Imu"
DETECTIONS_2D = "vision_msgs/msg/Detection2DArray"
DETECTIONS_3D = "vision_msgs/msg/Detection3DArray"
TRANSFORMS = "tf2_msgs/msg/TFMessage"

_ROLES: dict[str, Role] = {
    IMAGE: "image",
    COMPRESSED: "image",
    CAMERA_INFO: "camera_info",
    ODOMETRY: "odometry",
    POSE: "position",
    POSE_COVARIANCE: "position",
    FIX: "position",
    IMU: "imu",
    TRANSFORMS: "tf",
    "tf/msg/tfMessage": "tf",
    DETECTIONS_2D: "detections",
    DETECTIONS_3D: "detections",
}
# Poses that somebody wishes for, not where the robot says that it is.
_COMMANDS = {"/goal_pose", "/initialpose", "/move_base_simple/goal"}
NONE = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic:
    """A topic of a bag."""

    name: str
    message_type: str
    count: int

    @property
    def role(self) -> Role:
        """What its message type makes it.

        >>> Topic(name="/odom", message_type=ODOMETRY, count=3).role
        'odometry'
        """
        return "other" if self.name in _COMMANDS else _ROLES.get(self.message_type, "other")


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """The topics that are used; None where the recording has none of the kind."""

    image: Topic
    camera_info: Topic
    odometry: Topic | None
    position: Topic | None
    imu: Topic | None
    detections: Topic | None

    @property
    def claims(self) -> tuple[Topic, ...]:
        """The topics that make claims."""
        claims = (self.odometry, self.position, self.imu, self.detections)
        return tuple(topic for topic in claims if topic is not None)

    @property
    def all(self) -> tuple[Topic, ...]:
        """Every topic that is used."""
        return (self.image, self.camera_info, *self.claims)


def camera_name(image_topic: str) -> str:
    """Name of the camera: its image topic, without what image_transport appends.

    >>> camera_name("/camera/image_raw/compressed")
    '/camera/image_raw'
    """
    return image_topic.removesuffix("/compressed")


def choose(
    topics: Sequence[Topic],
    *,
    image: str | None = None,
    camera_info: str | None = None,
    odometry: str | None = None,
    position: str | None = None,
    imu: str | None = None,
    detections: str | None = None,
) -> Choice:
    """Find each part's topic by message type, or take the one that is named.

    ``none`` leaves odometry, position, IMU or detections out.

    Raises
    ------
    TopicError
        If images or camera info are missing, a named topic is missing or of another type, or two topics
        would do; the text lists them and names the flag.

    Examples
    --------
    >>> topics = [Topic(name=name, message_type=IMAGE, count=9) for name in ("/left", "/right")]
    >>> choose(topics)
    Traceback (most recent call last):
    ...
    belie.types.errors.AmbiguousTopicError: 2 topics could be the image: /left, /right; name one with --image
    """
    chosen_image = _one(topics, "image", (IMAGE, COMPRESSED), image, flag="--image")
    if chosen_image is None:
        raise TopicError(
            f"no images: no topic of type {IMAGE} or {COMPRESSED} with messages (found {_listed(topics)})"
        )
    # A pose topic that is named as the odometry is no longer a candidate for the position.
    others = [topic for topic in topics if topic.name != odometry]
    return Choice(
        image=chosen_image,
        camera_info=_camera_info(topics, chosen_image, camera_info),
        odometry=_one(
            topics,
            "odometry",
            (ODOMETRY,),
            odometry,
            flag="--odometry",
            when_named=(ODOMETRY, POSE, POSE_COVARIANCE),
        ),
        position=_one(others, "position", (POSE, POSE_COVARIANCE, FIX), position, flag="--position"),
        imu=_one(topics, "imu", (IMU,), imu, flag="--imu"),
        detections=_one(
            topics, "detections", (DETECTIONS_2D, DETECTIONS_3D), detections, flag="--detections"
        ),
    )


def _listed(topics: Sequence[Topic]) -> str:
    return ", ".join(f"{topic.name} ({topic.message_type})" for topic in topics) or "no topics at all"


def _one(
    topics: Sequence[Topic],
    role: Role,
    types: tuple[str, ...],
    named: str | None,
    *,
    flag: str,
    when_named: tuple[str, ...] = (),
) -> Topic | None:
    if named == NONE and role != "image":
        return None
    if named is not None:
        return _named(topics, when_named or types, named, flag)
    fitting = [
        topic
        for topic in topics
        if topic.role == role
        and topic.message_type in types
        and topic.count > 0
        and not topic.name.endswith("/compressedDepth")
    ]
    if len(fitting) > 1:
        names = ", ".join(topic.name for topic in fitting)
        raise AmbiguousTopicError(f"{len(fitting)} topics could be the {role}: {names}; name one with {flag}")
    return fitting[0] if fitting else None


def _named(topics: Sequence[Topic], types: tuple[str, ...], named: str, flag: str) -> Topic:
    for topic in topics:
        if topic.name == named:
            if topic.message_type not in types:
                raise TopicError(
                    f"{flag} {named}: this topic is of type {topic.message_type}, not {' or '.join(types)}"
                )
            if topic.count == 0:
                raise TopicError(f"{flag} {named}: this topic has no messages")
            return topic
    fitting = [topic for topic in topics if topic.message_type in types]
    is_path = Path(named).suffix or Path(named).is_dir() or ("/" in named and not named.startswith("/"))
    if flag == "--detections" and is_path:
        raise TopicError(f"{flag} {named}: {no_file(named)}; topics of a fitting type: {_listed(fitting)}")
    raise TopicError(f"{flag} {named}: no such topic; those of a fitting type: {_listed(fitting)}")


def no_file(named: str) -> str:
    """Why what is named is no file of detections.

    >>> no_file("none.csv")
    'no such file'
    """
    return "a folder, where one file for all frames is needed" if Path(named).is_dir() else "no such file"


def _camera_info(topics: Sequence[Topic], image: Topic, named: str | None) -> Topic:
    if named is not None:
        return _named(topics, (CAMERA_INFO,), named, "--camera-info")
    infos = [topic for topic in topics if topic.role == "camera_info" and topic.count > 0]
    beside = camera_name(image.name).rsplit("/", 1)[0] + "/camera_info"
    for topic in infos:
        if topic.name == beside:
            return topic
    if not infos:
        raise TopicError(
            f"no camera info for {image.name}: no topic of type {CAMERA_INFO} with messages; record {beside}"
        )
    if len(infos) > 1:
        names = ", ".join(topic.name for topic in infos)
        raise AmbiguousTopicError(
            f"{len(infos)} topics could be the camera info of {image.name}: {names}; "
            "name one with --camera-info"
        )
    return infos[0]
