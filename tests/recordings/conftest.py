"""Small real bags, written to tmp_path by rosbags with its own message classes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Nodetype
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

PERIOD_NS = 100_000_000
START_NS = 1_700_000_000_000_000_000
STORES = {"ros2": get_typestore(Stores.LATEST), "ros1": get_typestore(Stores.ROS1_NOETIC)}
STORES["ros1"].register(
    get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
)


def pattern(index: int = 0, width: int = 64, height: int = 48) -> np.ndarray:
    return np.random.default_rng(index).integers(0, 256, (height, width), dtype=np.uint8)


def blank(store: Any, message_type: str) -> Any:
    """A message with every field at zero."""
    fields = {}
    for name, (node, detail) in store.fielddefs[message_type][1]:
        if node == Nodetype.BASE:
            fields[name] = {"string": "", "bool": False}.get(detail[0], 0.0 if "float" in detail[0] else 0)
        elif node == Nodetype.NAME:
            fields[name] = blank(store, detail)
        else:
            (_, element), length = detail
            size = length if node == Nodetype.ARRAY else 0
            numeric = isinstance(element, tuple) and element[0] != "string"
            fields[name] = np.zeros(size, dtype=element[0]) if numeric else []
    return store.types[message_type](**fields)


class Bag:
    """Collects messages, then writes them as MCAP, sqlite3 or a ROS 1 bag."""

    def __init__(self, folder: Path, kind: str = "mcap") -> None:
        self.kind = kind
        self.path = folder / ("bag.bag" if kind == "ros1" else "bag")
        self.store = STORES["ros1" if kind == "ros1" else "ros2"]
        self.messages: list[tuple[str, str, int, bytes]] = []

    def new(self, message_type: str, stamp_ns: int | None = None, frame_id: str = "", **fields: Any) -> Any:
        """A message; fields are set by dotted path with __ for the dot."""
        message = blank(self.store, message_type)
        if stamp_ns is not None:
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
            message.header.frame_id = frame_id
        for path, value in fields.items():
            *parents, last = path.split("__")
            target = message
            for parent in parents:
                target = getattr(target, parent)
            if self.kind == "ros1" and last in ("d", "k", "r", "p"):
                last = last.upper()
            setattr(target, last, value)
        return message

    def add(self, topic: str, message_type: str, message: Any, received_ns: int) -> None:
        serialize = self.store.serialize_ros1 if self.kind == "ros1" else self.store.serialize_cdr
        self.messages.append((topic, message_type, received_ns, bytes(serialize(message, message_type))))

    def image(
        self,
        stamp_ns: int,
        *,
        received_ns: int | None = None,
        topic: str = "/cam/image_raw",
        pixels: np.ndarray | None = None,
        **fields: Any,
    ) -> None:
        pixels = pattern() if pixels is None else pixels
        message = self.new(
            "sensor_msgs/msg/Image",
            stamp_ns,
            fields.pop("frame_id", "cam"),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=fields.pop("encoding", "mono8"),
            step=pixels.shape[1] * pixels.itemsize * (pixels.shape[2] if pixels.ndim == 3 else 1),
            data=pixels.ravel().view(np.uint8),
        )
        for name, value in fields.items():
            setattr(message, name, value)
        self.add(topic, "sensor_msgs/msg/Image", message, stamp_ns if received_ns is None else received_ns)

    def compressed(
        self, stamp_ns: int, data: bytes | None = None, topic: str = "/cam/image_raw/compressed"
    ) -> None:
        if data is None:
            data = cv2.imencode(".jpg", cv2.GaussianBlur(pattern(), (9, 9), 3))[1].tobytes()
        message = self.new(
            "sensor_msgs/msg/CompressedImage",
            stamp_ns,
            "cam",
            format="jpeg",
            data=np.frombuffer(data, np.uint8),
        )
        self.add(topic, "sensor_msgs/msg/CompressedImage", message, stamp_ns)

    def camera_info(self, stamp_ns: int = START_NS, topic: str = "/cam/camera_info", **fields: Any) -> None:
        given: dict[str, Any] = {
            "height": 48,
            "width": 64,
            "distortion_model": "plumb_bob",
            "d": np.zeros(5),
            "k": np.array([60.0, 0, 31.5, 0, 60.0, 23.5, 0, 0, 1]),
            "r": np.eye(3).ravel(),
            "p": np.array([60.0, 0, 31.5, 0, 0, 60.0, 23.5, 0, 0, 0, 1, 0]),
        }
        given.update(fields)
        frame_id = given.pop("frame_id", "cam")
        self.add(
            topic,
            "sensor_msgs/msg/CameraInfo",
            self.new("sensor_msgs/msg/CameraInfo", stamp_ns, frame_id, **given),
            stamp_ns,
        )

    def tf_static(
        self, parent: str, child: str, t: tuple[float, float, float], quat_xyzw: Any = (0, 0, 0, 1)
    ) -> None:
        edge = self.new("geometry_msgs/msg/TransformStamped", START_NS, parent, child_frame_id=child)
        for name, value in zip("xyz", t, strict=True):
            setattr(edge.transform.translation, name, float(value))
        for name, value in zip("xyzw", quat_xyzw, strict=True):
            setattr(edge.transform.rotation, name, float(value))
        message = self.new("tf2_msgs/msg/TFMessage", transforms=[edge])
        self.add("/tf_static", "tf2_msgs/msg/TFMessage", message, START_NS - 1)

    def odometry(
        self,
        stamp_ns: int,
        x: float = 0.0,
        *,
        received_ns: int | None = None,
        topic: str = "/odom",
        **fields: Any,
    ) -> None:
        given: dict[str, Any] = {
            "pose__pose__position__x": x,
            "pose__pose__orientation__w": 1.0,
            "child_frame_id": "base_link",
        }
        given.update(fields)
        message = self.new("nav_msgs/msg/Odometry", stamp_ns, "odom", **given)
        self.add(topic, "nav_msgs/msg/Odometry", message, stamp_ns if received_ns is None else received_ns)

    def imu(self, stamp_ns: int, rate: tuple[float, float, float], **fields: Any) -> None:
        given = dict(
            zip(("angular_velocity__x", "angular_velocity__y", "angular_velocity__z"), rate, strict=True)
        )
        message = self.new("sensor_msgs/msg/Imu", stamp_ns, fields.pop("frame_id", "imu"), **given, **fields)
        self.add("/imu", "sensor_msgs/msg/Imu", message, stamp_ns)

    def drive(self, frames: int = 5) -> Bag:
        """A plain recording: images, camera info, odometry at the frames, extrinsics."""
        self.tf_static("base_link", "cam", (0.5, 0.0, 1.0), (-0.5, 0.5, -0.5, 0.5))
        for index in range(frames):
            stamp_ns = START_NS + index * PERIOD_NS
            self.camera_info(stamp_ns)
            self.odometry(stamp_ns, 0.1 * index)
            self.image(stamp_ns, pixels=pattern(index))
        return self

    def without(self, topic: str) -> Bag:
        self.messages = [entry for entry in self.messages if entry[0] != topic]
        return self

    def write(self, compression: CompressionMode = CompressionMode.NONE) -> Path:
        """Write the bag; returns the file (in the bag's folder), or the folder if it is compressed."""
        if self.kind == "ros1":
            writer: Any = rosbag1.Writer(self.path)
        else:
            plugin = StoragePlugin.MCAP if self.kind == "mcap" else StoragePlugin.SQLITE3
            writer = rosbag2.Writer(self.path, version=9, storage_plugin=plugin)
            writer.set_compression(compression, CompressionFormat.ZSTD)
        with writer:
            connections: dict[tuple[str, str], Any] = {}
            for topic, message_type, received_ns, data in self.messages:
                key = (topic, message_type)
                if key not in connections:
                    connections[key] = writer.add_connection(topic, message_type, typestore=self.store)
                writer.write(connections[key], received_ns, data)
        whole = self.kind == "ros1" or compression != CompressionMode.NONE
        return self.path if whole else next(self.path.glob("bag.*"))


@pytest.fixture
def new_bag(tmp_path: Path) -> Callable[..., Bag]:
    def make(kind: str = "mcap", name: str = "made") -> Bag:
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        return Bag(folder, kind)

    return make


@pytest.fixture
def image_folder() -> Callable[..., list[str]]:
    """Writes textured PNG files; returns their names."""

    def make(folder: Path, count: int = 4) -> list[str]:
        folder.mkdir(parents=True)
        names = [f"{index:06d}.png" for index in range(count)]
        for index, name in enumerate(names):
            cv2.imwrite(str(folder / name), pattern(index))
        return names

    return make


@pytest.fixture
def textured() -> Callable[..., np.ndarray]:
    return pattern
