"""Recordings made of image files (or a video) and tables beside them, as a `Recording`."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel
from belie.recordings.arrivals import RawImage, decode_frames, steps_of
from belie.recordings.geodesy import GeodeticPoint
from belie.recordings.images import GrayDecoder, UndecodableImageError
from belie.recordings.join import DecodedFrame
from belie.recordings.join_counts import JoinCounts
from belie.recordings.join_settings import JoinSettings
from belie.recordings.recording import BodyAxes, Role, StreamInfo
from belie.recordings.topics import NONE
from belie.recordings.trajectory import ODOMETRY_SOURCE, POSITION_SOURCE, Trajectory
from belie.types import Claim, GrayImage, MountedCamera, RecordingError, Step, TopicError

_TRIES = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class ClaimStream:
    """One stream of claims of a folder: its name, what it is, its times, and how to read it anew."""

    topic: str
    role: Role
    kind: str
    stamps_ns: npt.NDArray[np.int64]
    claims: Callable[[], Iterable[Claim]]


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageStream:
    """The images of a folder or a video.

    Parameters
    ----------
    camera : str
        Name of the camera.
    kind : str
        What the files are.
    stamps_ns : array (N,)
        Time of each image.
    payloads : callable
        What `decode` takes for each image, in order, anew at each call.
    decode : callable
        Payload to gray; made by `GrayDecoder` or the like for each pass.
    """

    camera: str
    kind: str
    stamps_ns: npt.NDArray[np.int64]
    payloads: Callable[[], Iterable[Any]]
    decoder: Callable[[], Callable[[Any], GrayImage]]

    def first_size(self) -> tuple[int, int]:
        """Width and height of the first image that can be decoded, pixels.

        Raises
        ------
        RecordingError
            If none of the first ones can.
        """
        decode, said = self.decoder(), "there is none"
        for tries, payload in enumerate(self.payloads()):
            if tries == _TRIES:
                break
            try:
                image = decode(payload)
            except UndecodableImageError as error:
                said = str(error)
                continue
            return image.shape[1], image.shape[0]
        raise RecordingError(f"none of the first images of {self.camera} can be decoded ({said})")


def image_files(camera: str, files: Sequence[Path], stamps_ns: npt.NDArray[np.int64]) -> ImageStream:
    """A stream of image files, read as they are needed."""

    def decoder() -> Callable[[Path], GrayImage]:
        gray = GrayDecoder(camera)

        def decode(path: Path) -> GrayImage:
            try:
                data = path.read_bytes()
            except OSError as error:
                raise UndecodableImageError(f"{path}: {error.strerror}") from error
            return gray.compressed(data)

        return decode

    return ImageStream(
        camera=camera, kind="image files", stamps_ns=stamps_ns, payloads=lambda: files, decoder=decoder
    )


def trajectory_streams(
    trajectory: Trajectory | None, *, odometry: str | None, position: str | None
) -> tuple[ClaimStream, ...]:
    """The one trajectory of a folder as the claims that are asked for.

    It is the odometry claim ``/odom`` unless `odometry` is ``none``; where `position` is ``poses`` it is
    the position claim ``/position`` too.

    Raises
    ------
    TopicError
        For any other name.
    """
    if odometry not in (None, NONE, "poses", ODOMETRY_SOURCE):
        raise TopicError(f"--odometry {odometry}: a folder has one trajectory; use poses or {NONE}")
    if position not in (None, NONE, "poses", POSITION_SOURCE):
        raise TopicError(f"--position {position}: a folder has one trajectory; use poses or {NONE}")
    if trajectory is None:
        if odometry not in (None, NONE) or position not in (None, NONE):
            raise TopicError("poses were asked for, but this folder has no trajectory")
        return ()
    streams = []
    name = trajectory.path.name
    if odometry != NONE:
        streams.append(
            ClaimStream(
                topic=ODOMETRY_SOURCE,
                role="odometry",
                kind=name,
                stamps_ns=trajectory.stamps_ns,
                claims=trajectory.odometry,
            )
        )
    if position not in (None, NONE):
        streams.append(
            ClaimStream(
                topic=POSITION_SOURCE,
                role="position",
                kind=name,
                stamps_ns=trajectory.stamps_ns,
                claims=trajectory.positions,
            )
        )
    return tuple(streams)


class FolderRecording:
    """Images and claims from files; see `Recording` for the attributes.

    Files carry one time only: it is both the stamp and the receive time.
    """

    geodetic_origin: GeodeticPoint | None = None

    def __init__(
        self,
        path: Path,
        format: str,
        *,
        images: ImageStream,
        model: CameraModel,
        T_body_cam: SE3,
        body_axes: BodyAxes,
        claims: Sequence[ClaimStream],
        join_settings: JoinSettings,
    ) -> None:
        self.path = path
        self.format = format
        self.body_axes: BodyAxes = body_axes
        self.cameras: Mapping[str, MountedCamera] = {
            images.camera: MountedCamera(model=model, T_body_cam=T_body_cam)
        }
        self.join_counts = JoinCounts()
        self._images = images
        self._claims = tuple(claims)
        self._join_settings = join_settings

    @property
    def streams(self) -> tuple[StreamInfo, ...]:
        """The images, and every stream of claims."""
        images = StreamInfo.from_times(
            self._images.camera, "image", self._images.kind, self._images.stamps_ns, used=True
        )
        claims = (
            StreamInfo.from_times(stream.topic, stream.role, stream.kind, stream.stamps_ns, used=True)
            for stream in self._claims
        )
        return (images, *claims)

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Stamps of all frames, shape (N,), ascending; no image is decoded."""
        return np.unique(self._images.stamps_ns)

    def steps(self) -> Iterator[Step]:
        """The frames with their claims; see `Recording.steps`."""
        self.join_counts = counts = JoinCounts()
        periods_ns = {info.topic: 1e9 / info.rate_hz for info in self.streams if info.rate_hz}
        return steps_of(
            self._arrivals(counts), settings=self._join_settings, counts=counts, periods_ns=periods_ns
        )

    def _arrivals(self, counts: JoinCounts) -> Generator[Claim | DecodedFrame, None, None]:
        images = (
            RawImage(index=index, stamp_ns=stamp_ns, received_ns=stamp_ns, payload=payload)
            for index, (stamp_ns, payload) in enumerate(
                zip(self._images.stamps_ns.tolist(), self._images.payloads(), strict=False)
            )
        )
        merged: Iterator[Claim | RawImage] = heapq.merge(
            *(stream.claims() for stream in self._claims), images, key=lambda arrival: arrival.received_ns
        )
        yield from decode_frames(
            merged,
            self._images.decoder(),
            camera=self._images.camera,
            mounted=self.cameras[self._images.camera],
            counts=counts,
        )
