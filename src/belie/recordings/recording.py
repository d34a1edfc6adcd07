"""What every recording offers, whatever its format."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from belie.recordings.geodesy import GeodeticPoint
from belie.recordings.join_counts import JoinCounts
from belie.types import MountedCamera, Step

BodyAxes = Literal["flu", "rdf"]
Role = Literal["image", "camera_info", "odometry", "position", "imu", "detections", "tf", "other"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamInfo:
    """One stream of a recording, as ``belie info`` lists it.

    Parameters
    ----------
    topic : str
        ROS topic, or the file that holds the stream.
    role : Role
        What belie takes it for, from its message type.
    message_type : str
        ROS message type, or the kind of file.
    count : int
        Number of messages.
    rate_hz : float or None
        Mean rate; None for fewer than two messages.
    start_ns, end_ns : int or None
        Receive times of the first and the last message; None without messages.
    longest_gap_s : float or None
        Longest time between two consecutive messages.
    used : bool
        Whether this very stream was chosen for the checks.
    """

    topic: str
    role: Role
    message_type: str
    count: int
    rate_hz: float | None = None
    start_ns: int | None = None
    end_ns: int | None = None
    longest_gap_s: float | None = None
    used: bool = False

    @classmethod
    def from_times(
        cls, topic: str, role: Role, message_type: str, times_ns: npt.ArrayLike, *, used: bool
    ) -> StreamInfo:
        """Describe a stream by its receive times, shape (N,), nanoseconds, any order.

        >>> info = StreamInfo.from_times("/odom", "odometry", "nav_msgs/msg/Odometry",
        ...                              [0, 100_000_000, 300_000_000], used=True)
        >>> info.count, round(info.rate_hz, 2), info.longest_gap_s
        (3, 6.67, 0.2)
        """
        times = np.sort(np.asarray(times_ns, dtype=np.int64))
        count = len(times)
        span_ns = int(times[-1] - times[0]) if count else 0
        return cls(
            topic=topic,
            role=role,
            message_type=message_type,
            count=count,
            rate_hz=(count - 1) * 1e9 / span_ns if span_ns > 0 else None,
            start_ns=int(times[0]) if count else None,
            end_ns=int(times[-1]) if count else None,
            longest_gap_s=float(np.diff(times).max()) / 1e9 if count > 1 else None,
            used=used,
        )


class Recording(Protocol):
    """A recording: its cameras, and its frames and claims in order of time.

    Attributes
    ----------
    path : Path
        Where it is.
    format : str
        ``ros2-mcap``, ``ros2-sqlite3``, ``ros1``, ``kitti``, ``euroc``, ``tum`` or ``video``.
    cameras : mapping of str to MountedCamera
        The one camera that is used; its name is the image topic (without ``/compressed``).
    body_axes : "flu" or "rdf"
        Axes of the body frame: x forward, y left, z up (ROS); or x right, y down, z forward.
    streams : tuple of StreamInfo
        All streams, used or not.
    join_counts : JoinCounts
        What the joining of the streams met; filled while `steps` runs.
    geodetic_origin : GeodeticPoint or None
        Where GNSS claims have their ENU origin; None without GNSS.
    """

    path: Path
    format: str
    cameras: Mapping[str, MountedCamera]
    body_axes: BodyAxes
    join_counts: JoinCounts
    geodetic_origin: GeodeticPoint | None

    @property
    def streams(self) -> tuple[StreamInfo, ...]:
        """All streams of the recording."""

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Header stamps of all frames, shape (N,), ascending; no image is decoded."""

    def steps(self) -> Iterator[Step]:
        """The frames with their claims, lazily; each call starts anew, closing it stops its thread."""
