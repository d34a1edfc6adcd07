"""DDS types that carry ROS messages as bytes: cyclonedds moves them, rosbags reads them.

cyclonedds' own (de)serialiser needs 92 ms for a 720p image; as bytes it passes in 5 ms. Only the name of the type
must be right for ROS 2 to match it.
"""

from __future__ import annotations

from typing import Any


def dds_type_name(message_type: str) -> str:
    """ROS type to DDS type.

    >>> dds_type_name("sensor_msgs/msg/Image")
    'sensor_msgs::msg::dds_::Image_'
    """
    package, kind, name = message_type.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_type_name(type_name: str) -> str | None:
    """DDS type to ROS type; None where it is none of ROS's messages.

    >>> ros_type_name("sensor_msgs::msg::dds_::Image_"), ros_type_name("HelloWorld")
    ('sensor_msgs/msg/Image', None)
    """
    parts = type_name.split("::")
    if len(parts) != 4 or parts[2] != "dds_" or not parts[3].endswith("_"):
        return None
    return f"{parts[0]}/{parts[1]}/{parts[3][:-1]}"


def raw_type(message_type: str) -> Any:
    """A cyclonedds type of the right name whose samples carry ``data``, the CDR bytes, instead of its field."""
    from cyclonedds.idl import make_idl_struct

    name = dds_type_name(message_type).replace("::", ".")
    kind: Any = make_idl_struct(name.rsplit(".", 1)[1], name, {"raw": int}, dataclassify=False)

    def serialize(self: Any, *_: Any, **__: Any) -> bytes:
        return bytes(self.data)

    def deserialize(cls: Any, data: bytes, *_: Any, **__: Any) -> Any:
        return sample(cls, data)

    kind.serialize = serialize
    kind.deserialize = classmethod(deserialize)
    kind.deserialize_key = classmethod(
        lambda cls, *_, **__: cls.__new__(cls)
    )  # a publisher has gone: no data
    return kind


def sample(kind: Any, data: bytes) -> Any:
    """A sample of a raw type."""
    made = kind.__new__(kind)
    made.data = data
    return made
