"""What every middleware offers belie: topics to see, bytes in, bytes out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from belie.recordings import topics as ros

# Receive times must not jump when somebody sets the clock: wall time at the start, monotonic time since.
_START_NS = time.time_ns() - time.monotonic_ns()


def now_ns() -> int:
    """Nanoseconds since 1970 by a clock that never jumps while this process runs.

    >>> now_ns() <= now_ns()
    True
    """
    return _START_NS + time.monotonic_ns()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Received:
    """One message as it came.

    Parameters
    ----------
    topic, message_type : str
        ROS names: ``/odom``, ``nav_msgs/msg/Odometry``.
    data : bytes
        Its CDR serialisation, encapsulation header included.
    received_ns : int
        When we got it (`now_ns`).
    """

    topic: str
    message_type: str
    data: bytes
    received_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer:
    """A topic that somebody publishes.

    Parameters
    ----------
    topic, message_type : str
        ROS names.
    publishers : int
        How many publish it with this type.
    reliable, latched : bool
        Whether any of them repeats what is lost, and keeps the last messages for those who come late.
    """

    topic: str
    message_type: str
    publishers: int = 1
    reliable: bool = True
    latched: bool = False


def writer_depth(message_type: str, *, latched: bool) -> int:
    """How many messages of ours wait for listeners that are busy: seconds of any sensor, but not of images.

    >>> writer_depth("sensor_msgs/msg/Imu", latched=False), writer_depth("sensor_msgs/msg/Image", latched=False)
    (1000, 50)
    """
    if latched:
        return 10
    return 50 if message_type in (ros.IMAGE, ros.COMPRESSED) else 1000


Receive = Callable[[Received], None]
"""Is called in the middleware's thread, and must not block."""


class Publisher(Protocol):
    """One topic to publish on."""

    def publish(self, data: bytes) -> None:
        """Send one message, given as CDR."""
        ...


class Transport(Protocol):
    """One middleware, open.

    Attributes
    ----------
    name : str
        ``dds``, ``zenoh`` or ``ros1``.
    """

    name: str

    def offers(self) -> tuple[Offer, ...]:
        """What others publish now, in order of the names; our own topics are left out."""
        ...

    def subscribe(
        self, topic: str, message_type: str, receive: Receive, *, latched: bool, depth: int
    ) -> None:
        """Hand every message of a topic to `receive`; `depth` messages wait where we are late."""
        ...

    def advertise(self, topic: str, message_type: str, *, latched: bool) -> Publisher:
        """Announce a topic of ours."""
        ...

    def subscribers(self, topic: str) -> int:
        """How many listen to a topic of ours."""
        ...

    def lost(self) -> Mapping[str, int]:
        """How many messages of each topic the network lost, as far as the middleware tells."""
        ...

    def faults(self) -> Mapping[str, str]:
        """What is wrong with a topic's link (QoS that does not match …), by topic."""
        ...

    def reset(self) -> None:
        """Drop all subscriptions and topics of ours, for a session that begins anew."""
        ...

    def close(self) -> None:
        """Leave the network; no message is handed on afterwards."""
        ...
