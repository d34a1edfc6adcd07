"""``belie play``: publishes a recording as the robot did, message for message, in its time."""

from __future__ import annotations

import struct
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

from belie.bridges.introduction import TF_STATIC
from belie.bridges.wire import Publisher, Received, Transport, now_ns
from belie.recordings import Recording, open_recording, write_mcap
from belie.recordings import topics as ros
from belie.recordings.messages import STORE
from belie.recordings.storage import BagFormat, OpenBag, opened
from belie.types import RecordingError

_BAGS: tuple[BagFormat, ...] = ("ros2-mcap", "ros2-sqlite3", "ros1")
_ROLES = ("image", "camera_info", "odometry", "position", "imu", "detections", "tf")
_NAP_S = 0.05
_OTHERS_S = 5.0  # topics that nobody wants are not waited for longer than this


def as_bag(recording: Recording, stack: ExitStack) -> Recording:
    """The recording itself if it is a bag; a folder or video is written as one that `stack` removes again."""
    if recording.format in _BAGS:
        return recording
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="belie-play-")))
    path = folder / "play.mcap"
    write_mcap(
        path, recording, cameras=recording.cameras, body_axes=recording.body_axes, image_encoding="mono8"
    )
    return open_recording(path)


def messages_of(recording: Recording, stack: ExitStack) -> Iterator[Received]:
    """The messages of a bag that play a part for belie, as CDR in order of receipt.

    Parameters
    ----------
    recording : Recording
        A bag; see `as_bag`.
    stack : ExitStack
        Holds what must stay open while the messages are read.
    """
    kind = next(known for known in _BAGS if known == recording.format)
    return _as_cdr(stack.enter_context(opened(recording.path, kind)), list(types_of(recording)))


def _as_cdr(bag: OpenBag, topics: list[str]) -> Iterator[Received]:
    for connection, received_ns, data in bag.messages(topics):
        message_type, cdr = connection.msgtype, data
        if bag.format == "ros1":
            message_type = message_type.replace("tf/msg/tfMessage", ros.TRANSFORMS)
            try:
                cdr = bytes(STORE.ros1_to_cdr(data, message_type))
            except Exception as error:  # another version of the type, or damaged bytes
                raise RecordingError(
                    f"{connection.topic} in {bag.path} cannot be played: its {message_type} is of another "
                    f"version, or damaged ({error})"
                ) from error
        yield Received(
            topic=connection.topic, message_type=message_type, data=bytes(cdr), received_ns=received_ns
        )


def restamped(data: bytes, shift_ns: int) -> bytes:
    """A stamped message's CDR with its header stamp moved; the stamp comes first in it.

    >>> moved = restamped(bytes([0, 1, 0, 0]) + struct.pack("<iI", 5, 999_999_999) + b"rest", 2)
    >>> struct.unpack_from("<iI", moved, 4), moved[-4:]
    ((6, 1), b'rest')
    """
    form = "<iI" if data[1] & 1 else ">iI"
    seconds, nanoseconds = struct.unpack_from(form, data, 4)
    moved = divmod(seconds * 1_000_000_000 + nanoseconds + shift_ns, 1_000_000_000)
    return data[:4] + struct.pack(form, *moved) + data[12:]


class Player:
    """Publishes messages at the pace of their receive times.

    Parameters
    ----------
    transport : Transport
        Open.
    rate : float
        2 is twice as fast.
    restamp : bool
        Move header stamps so that the recording seems to happen now.
    stopped : callable
        Ends the play when it answers True.
    on_message : callable, optional
        Is given every message right before it is sent.
    """

    def __init__(
        self,
        transport: Transport,
        *,
        rate: float = 1.0,
        restamp: bool = False,
        stopped: Callable[[], bool] = lambda: False,
        on_message: Callable[[Received], None] | None = None,
    ) -> None:
        if not 0.0 < rate < 1e6:
            raise ValueError(f"rate must be positive, got {rate}")
        self._transport, self._rate, self._restamp = transport, rate, restamp
        self._stopped, self._on_message = stopped, on_message
        self._publishers: dict[str, Publisher] = {}
        self.sent = 0

    def advertise(self, types: dict[str, str]) -> None:
        """Announce topics before the first message, so that others can find them."""
        for topic, message_type in types.items():
            if topic not in self._publishers:
                latched = topic == TF_STATIC
                self._publishers[topic] = self._transport.advertise(topic, message_type, latched=latched)

    def wait_for_subscribers(self, image: str, others: list[str], count: int, timeout_s: float) -> None:
        """Wait until somebody listens to the images, and a little longer for the other topics.

        Raises
        ------
        RecordingError
            If nobody does.
        """
        listening = self._transport.subscribers
        deadline_s = time.monotonic() + timeout_s
        while listening(image) < count and not self._stopped():
            if time.monotonic() > deadline_s:
                raise RecordingError(
                    f"nobody subscribed to {image} within {timeout_s:g} s; is belie live running?"
                )
            time.sleep(_NAP_S)
        deadline_s = time.monotonic() + _OTHERS_S
        while time.monotonic() < deadline_s and any(listening(topic) == 0 for topic in others):
            time.sleep(_NAP_S)

    def play(self, messages: Iterator[Received]) -> None:
        """Publish until the last message, or until stopped; latched messages go out at once."""
        first_ns: int | None = None
        shift_ns = 0
        began_s = time.monotonic()
        for message in messages:
            if first_ns is None:
                first_ns = message.received_ns
                began_s = time.monotonic()
                shift_ns = now_ns() - first_ns
            if not self._sleep_until(began_s + (message.received_ns - first_ns) * 1e-9 / self._rate):
                return
            self.advertise({message.topic: message.message_type})
            data = message.data
            if self._restamp and message.message_type != ros.TRANSFORMS:
                data = restamped(data, shift_ns)
            if self._on_message is not None:
                self._on_message(message)
            self._publishers[message.topic].publish(data)
            self.sent += 1

    def _sleep_until(self, moment_s: float) -> bool:
        while not self._stopped():
            left_s = moment_s - time.monotonic()
            if left_s <= 0.0:
                return True
            time.sleep(min(left_s, _NAP_S))
        return False


def types_of(recording: Recording) -> dict[str, str]:
    """Topics of a bag that `messages_of` plays, with their types as ROS 2 names them."""
    return {
        stream.topic: stream.message_type.replace("tf/msg/tfMessage", ros.TRANSFORMS)
        for stream in recording.streams
        if stream.role in _ROLES
    }
