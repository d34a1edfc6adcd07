"""What a bag's first messages tell before any frame is read: images, fixed frames, camera, GNSS origin."""

from __future__ import annotations

from typing import Any

from belie.geometry import CameraModel
from belie.recordings import topics as ros
from belie.recordings.calibration import CameraInfo, camera_model
from belie.recordings.claims import fix_of
from belie.recordings.images import GrayDecoder, UndecodableImageError
from belie.recordings.storage import OpenBag
from belie.recordings.transforms import TransformTree, frame_name
from belie.types import CalibrationError, GrayImage, RecordingError

_SMALLEST_IMAGE_PX = 16
_TRIES = 10


def decode_message(decoder: GrayDecoder, message: Any) -> GrayImage:
    """A ``sensor_msgs/Image`` or ``CompressedImage`` to gray.

    >>> import numpy as np
    >>> from belie.recordings import messages
    >>> gray = np.arange(12, dtype=np.uint8).reshape(3, 4)
    >>> message = messages.image(gray, stamp_ns=0, frame_id="cam", encoding="png")
    >>> bool((decode_message(GrayDecoder("/cam"), message) == gray).all())
    True
    """
    if hasattr(message, "encoding"):
        return decoder.raw(
            message.data,
            encoding=message.encoding,
            height=int(message.height),
            width=int(message.width),
            step=int(message.step),
            big_endian=bool(message.is_bigendian),
        )
    return decoder.compressed(message.data)


def first_message(bag: OpenBag, topic: ros.Topic) -> Any:
    """The first message of a topic, deserialised."""
    for connection, _, data in bag.messages([topic.name]):
        return bag.deserialize(connection, data)
    raise RecordingError(
        f"{topic.name} in {bag.path} has no messages, although its index counts {topic.count}"
    )


class FirstImage:
    """Frame and size of a bag's images, from the first that can be decoded."""

    def __init__(self, bag: OpenBag, topic: ros.Topic) -> None:
        decoder = GrayDecoder(topic.name)
        error = "no message"
        for tries, (connection, _, data) in enumerate(bag.messages([topic.name])):
            if tries == _TRIES:
                break
            try:
                message = bag.deserialize(connection, data)
                image = decode_message(decoder, message)
            except UndecodableImageError as said:
                error = str(said)
                continue
            except RecordingError as said:
                if "cannot be read as" not in str(said):
                    raise
                error = str(said)
                continue
            self.frame = frame_name(message.header.frame_id)
            self.size = (image.shape[1], image.shape[0])
            if min(self.size) < _SMALLEST_IMAGE_PX:
                raise RecordingError(
                    f"images on {topic.name} are {self.size[0]}x{self.size[1]} pixels; "
                    f"too small to see motion in: at least {_SMALLEST_IMAGE_PX} pixels a side are needed"
                )
            return
        raise RecordingError(f"none of the first images of {topic.name} can be decoded ({error})")


def odometry_child(bag: OpenBag, odometry: ros.Topic) -> str:
    """The body's frame as ``nav_msgs/Odometry`` names it; empty where it does not, or for a pose topic."""
    if odometry.message_type != ros.ODOMETRY:
        return ""
    return frame_name(first_message(bag, odometry).child_frame_id)


def fixed_frames(bag: OpenBag) -> TransformTree:
    """All transforms of /tf_static.

    Raises
    ------
    CalibrationError
        If one of them is not a rigid motion.
    """
    frames = TransformTree()
    seen: set[bytes] = set()
    for connection, _, data in bag.messages(["/tf_static"]):
        # Some publishers repeat the tree every second: each message is read once.
        if connection.msgtype in ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage") and data not in seen:
            seen.add(data)
            frames.add_message(bag.deserialize(connection, data))
    return frames


def body_frame(frames: TransformTree, image_frame: str, *, claims: bool) -> str:
    """The body's frame where no odometry names it.

    >>> from belie.geometry import SE3
    >>> tree = TransformTree()
    >>> tree.add("vehicle", "cam", SE3.identity())
    >>> body_frame(tree, "cam", claims=True)
    'vehicle'
    """
    if not claims:
        return image_frame  # nothing is claimed of any other body
    for name in ("base_link", "base_footprint"):
        if name in frames.frames:
            return name
    root = frames.root(image_frame)
    return root if root in frames.frames else "base_link"


def first_fix(bag: OpenBag, topic: ros.Topic) -> Any | None:
    """The first message with a fix; None where there is none."""
    for connection, _, data in bag.messages([topic.name]):
        message = bag.deserialize(connection, data)
        if fix_of(message) is not None:
            return message
    return None


def first_camera(bag: OpenBag, chosen: ros.Choice, image: FirstImage, *, by_name: bool) -> CameraModel:
    """The camera as its first camera info describes it; see `camera_of`."""
    message = first_message(bag, chosen.camera_info)
    return camera_of(message, chosen, image_frame=image.frame, image_size=image.size, by_name=by_name)


def camera_of(
    message: Any, chosen: ros.Choice, *, image_frame: str, image_size: tuple[int, int], by_name: bool
) -> CameraModel:
    """The camera as a camera info describes it, for images of a frame and a size (width, height).

    Raises
    ------
    CalibrationError
        If it is empty, of another size than the images, or (unless chosen `by_name`) another camera's.
    """
    info_frame = frame_name(message.header.frame_id)
    beside = ros.camera_name(chosen.image.name).rsplit("/", 1)[0] + "/camera_info"
    foreign = chosen.camera_info.name != beside and info_frame and info_frame != image_frame
    if foreign and not by_name:
        raise CalibrationError(
            f"{chosen.camera_info.name} is of frame {info_frame}, the images {chosen.image.name} of frame "
            f"{image_frame}; record {beside}, or choose the image that belongs to it with --image"
        )
    return camera_model(
        CameraInfo.from_message(message),
        image_size=image_size,
        rectified=ros.camera_name(chosen.image.name).rsplit("/", 1)[-1].startswith("image_rect"),
        where=chosen.camera_info.name,
    )
