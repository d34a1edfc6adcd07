"""ROS 2 and ROS 1 bags as a `Recording`."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import cast

import numpy as np
import numpy.typing as npt

from belie.recordings import topics as ros
from belie.recordings.arrivals import RawImage, decode_frames, steps_of
from belie.recordings.claims import FixReader, fix_of
from belie.recordings.first_messages import (
    FirstImage,
    body_frame,
    decode_message,
    first_camera,
    first_fix,
    first_message,
    fixed_frames,
    odometry_child,
)
from belie.recordings.geodesy import GeodeticPoint
from belie.recordings.images import GrayDecoder
from belie.recordings.join import DecodedFrame
from belie.recordings.join_counts import JoinCounts
from belie.recordings.join_settings import JoinSettings
from belie.recordings.recording import BodyAxes, StreamInfo
from belie.recordings.rig import ClaimReader, Rig, claim_reader
from belie.recordings.storage import BagFormat, OpenBag, opened
from belie.types import Claim, MountedCamera, RecordingError, Step

_UNREADABLE = 10  # messages at the start of a topic; then it is of a type that cannot be read


class BagRecording:
    """A bag; see `Recording` for the attributes. Opening reads the first messages only.

    Parameters
    ----------
    path : Path
        Bag file, or ROS 2 bag folder.
    format : BagFormat
        What it is.
    join_settings : JoinSettings
        How streams are joined.
    image, camera_info, odometry, position, imu, detections : str, optional
        Topics to use where several would do; ``none`` leaves a claim out.

    Raises
    ------
    RecordingError
        If it is damaged or empty; `TopicError` for topics, `CalibrationError` for the camera.
    """

    def __init__(
        self, path: Path, format: BagFormat, *, join_settings: JoinSettings, **named: str | None
    ) -> None:
        self.path = path
        self.format: str = format
        self._bag_format = format
        self._join_settings = join_settings
        self.join_counts = JoinCounts()
        self.geodetic_origin: GeodeticPoint | None = None
        with opened(path, format) as bag:
            self._topics = _topics_of(bag)
            if not any(topic.count for topic in self._topics):
                raise RecordingError(f"{path} holds no messages; the recording was empty")
            self._chosen = ros.choose(self._topics, **named)
            image = FirstImage(bag, self._chosen.image)
            odometry = self._chosen.odometry
            body = odometry_child(bag, odometry) if odometry is not None else ""
            frames = fixed_frames(bag)
            body = body or body_frame(frames, image.frame, claims=bool(self._chosen.claims))
            rig = Rig(frames=frames, body=body, image_frame=image.frame)
            self._readers = self._claim_readers(bag, rig)
            model = first_camera(bag, self._chosen, image, by_name=named.get("camera_info") is not None)
        self._camera = ros.camera_name(self._chosen.image.name)
        self.cameras: Mapping[str, MountedCamera] = {
            self._camera: MountedCamera(model=model, T_body_cam=rig.T_body_cam)
        }
        self.body_axes: BodyAxes = rig.body_axes

    def _claim_readers(self, bag: OpenBag, rig: Rig) -> dict[str, Callable[[], ClaimReader]]:
        """For each topic that makes claims, what makes a fresh reader of its messages."""
        readers: dict[str, Callable[[], ClaimReader]] = {}
        for topic in self._chosen.claims:
            first = None
            if topic.message_type == ros.FIX:
                first = first_fix(bag, topic)
                if first is None:
                    continue
                self.geodetic_origin = fix_of(first)
            elif topic.message_type == ros.IMU:
                first = first_message(bag, topic)
            make = partial(claim_reader, rig, topic, as_odometry=topic is self._chosen.odometry, first=first)
            make()  # a missing transform is told now, not at the first step
            readers[topic.name] = cast("Callable[[], ClaimReader]", make)
        return readers

    @cached_property
    def streams(self) -> tuple[StreamInfo, ...]:
        """All topics of the bag, with receive times from its index."""
        used = {topic.name for topic in self._chosen.all}
        with opened(self.path, self._bag_format) as bag:
            return tuple(
                StreamInfo.from_times(
                    topic.name,
                    topic.role,
                    topic.message_type,
                    bag.receive_times_ns(topic.name),
                    used=topic.name in used,
                )
                for topic in self._topics
            )

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Header stamps of all frames, shape (N,), ascending; no image is decoded."""
        with opened(self.path, self._bag_format) as bag:
            stamps = [bag.header_stamp_ns(data) for _, _, data in bag.messages([self._chosen.image.name])]
        return np.unique(np.array(stamps, dtype=np.int64))

    def steps(self) -> Iterator[Step]:
        """The frames with their claims; see `Recording.steps`."""
        self.join_counts = counts = JoinCounts()
        periods_ns = {
            ros.camera_name(stream.topic): 1e9 / stream.rate_hz
            for stream in self.streams
            if stream.rate_hz and stream.topic in {self._chosen.image.name, *self._readers}
        }
        return steps_of(
            self._arrivals(counts), settings=self._join_settings, counts=counts, periods_ns=periods_ns
        )

    def _arrivals(self, counts: JoinCounts) -> Generator[Claim | DecodedFrame, None, None]:
        decoder = GrayDecoder(self._camera)
        with opened(self.path, self._bag_format) as bag:
            yield from decode_frames(
                self._raw_arrivals(bag, counts),
                lambda message: decode_message(decoder, message),
                camera=self._camera,
                mounted=self.cameras[self._camera],
                counts=counts,
            )

    def _raw_arrivals(self, bag: OpenBag, counts: JoinCounts) -> Iterator[Claim | RawImage]:
        image = self._chosen.image.name
        readers = {topic: make() for topic, make in self._readers.items()}
        indices = dict.fromkeys([image, *readers], 0)
        if self._chosen.position is not None and self._chosen.position.name not in readers:
            counts.invalid[self._chosen.position.name] = self._chosen.position.count
        for connection, received_ns, data in bag.messages([image, *readers]):
            topic = connection.topic
            index = indices[topic]
            indices[topic] += 1
            try:
                message = bag.deserialize(connection, data)
                stamp_ns = bag.header_stamp_ns(data)
            except RecordingError:
                # A damaged message among good ones is counted; a topic of nothing else is an error.
                name = ros.camera_name(topic)
                counts.undecodable[name] += 1
                if counts.undecodable[name] == indices[topic] == _UNREADABLE:
                    raise
                continue
            if topic == image:
                yield RawImage(index=index, stamp_ns=stamp_ns, received_ns=received_ns, payload=message)
                continue
            claims = readers[topic](message, received_ns, index)
            if not claims and isinstance(readers[topic], FixReader):
                counts.invalid[topic] += 1
            yield from claims
        counts.lost.update({ros.camera_name(topic): lost for topic, lost in bag.lost.items()})


def _topics_of(bag: OpenBag) -> tuple[ros.Topic, ...]:
    counts: dict[tuple[str, str], int] = {}
    for connection in bag.connections:
        key = (connection.topic, connection.msgtype)
        counts[key] = counts.get(key, 0) + connection.msgcount
    return tuple(
        ros.Topic(name=name, message_type=message_type, count=count)
        for (name, message_type), count in sorted(counts.items())
    )
