"""ROS 2 and ROS 1 bags as a `Recording`."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3
from belie.recordings import topics as ros
from belie.recordings.arrivals import RawImage, decode_frames, steps_of
from belie.recordings.claims import FixReader, ImuReader, OdometryReader, PoseReader
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
from belie.recordings.storage import BagFormat, OpenBag, opened
from belie.recordings.transforms import TransformTree, frame_name
from belie.recordings.vision_messages import DetectionReader
from belie.types import Claim, MountedCamera, RecordingError, Step

ClaimReader = Callable[[Any, int, int], tuple[Claim, ...]]


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
            self._readers = self._claim_readers(bag, frames, body, image.frame)
            model = first_camera(bag, self._chosen, image, by_name=named.get("camera_info") is not None)
        T_body_cam = frames.require(body, image.frame)
        self._camera = ros.camera_name(self._chosen.image.name)
        self.cameras: Mapping[str, MountedCamera] = {
            self._camera: MountedCamera(model=model, T_body_cam=T_body_cam)
        }
        # REP 103: frames that end in _optical are x right, y down, z forward; so is an image's own frame.
        optical = body == image.frame or body.endswith(("_optical", "_optical_frame"))
        self.body_axes: BodyAxes = "rdf" if optical else "flu"

    def _claim_readers(
        self, bag: OpenBag, frames: TransformTree, body: str, image_frame: str
    ) -> dict[str, Callable[[], ClaimReader]]:
        """For each topic that makes claims, what makes a fresh reader of its messages."""
        readers: dict[str, Callable[[], ClaimReader]] = {}
        odometry, position, imu = self._chosen.odometry, self._chosen.position, self._chosen.imu
        if odometry is not None and odometry.message_type == ros.ODOMETRY:
            readers[odometry.name] = lambda: OdometryReader(odometry.name)
        elif odometry is not None:
            readers[odometry.name] = lambda: PoseReader(odometry.name, as_odometry=True)
        if position is not None and position.message_type == ros.FIX:
            origin, lever_m = first_fix(bag, position, frames, body)
            self.geodetic_origin = origin
            if origin is not None:
                readers[position.name] = lambda: FixReader(position.name, origin=origin, lever_m=lever_m)
        elif position is not None:
            readers[position.name] = lambda: PoseReader(position.name, as_odometry=False)
        if imu is not None:
            frame = frame_name(first_message(bag, imu).header.frame_id)
            R_body_imu = frames.require(body, frame, instead="; or leave the IMU out with --imu none").R
            readers[imu.name] = lambda: ImuReader(imu.name, R_body_imu)
        detections = self._chosen.detections
        if detections is not None:
            instead = "; or leave the objects out with --detections none"

            def T_cam_of(frame: str) -> SE3:
                # An empty frame_id can only mean the image's own frame.
                return frames.require(image_frame, frame or image_frame, instead=instead)

            readers[detections.name] = lambda: DetectionReader(detections.name, T_cam_of)
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
            if topic == image:
                try:
                    stamp_ns = bag.header_stamp_ns(data)
                    message = bag.deserialize(connection, data)
                except RecordingError:
                    # One damaged message among good ones: it counts as an image that cannot be decoded.
                    counts.undecodable[self._camera] += 1
                    continue
                yield RawImage(index=index, stamp_ns=stamp_ns, received_ns=received_ns, payload=message)
                continue
            claims = readers[topic](bag.deserialize(connection, data), received_ns, index)
            if not claims and isinstance(readers[topic], FixReader):
                counts.invalid[topic] += 1
            yield from claims


def _topics_of(bag: OpenBag) -> tuple[ros.Topic, ...]:
    counts: dict[tuple[str, str], int] = {}
    for connection in bag.connections:
        key = (connection.topic, connection.msgtype)
        counts[key] = counts.get(key, 0) + connection.msgcount
    return tuple(
        ros.Topic(name=name, message_type=message_type, count=count)
        for (name, message_type), count in sorted(counts.items())
    )
