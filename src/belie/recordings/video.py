"""A video file with a TUM trajectory (``drive.mp4`` and ``drive.tum`` or ``drive.txt``) beside it.

Times of the trajectory count from the video's first frame. The body is the camera (x right, y down,
z forward); its calibration stands beside the video as ``drive.yaml`` or ``camera.yaml``, in the form that
`belie.recordings.calibration` shows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from belie.geometry import SE3
from belie.recordings.folder import FolderRecording, ImageStream, trajectory_streams
from belie.recordings.images import UndecodableImageError
from belie.recordings.join_settings import JoinSettings
from belie.recordings.trajectory import Trajectory, even_stamps_ns, read_tum
from belie.recordings.tum import camera_file_model
from belie.types import GrayImage, RecordingError


def is_video(start: bytes) -> bool:
    """Whether a file that starts with these bytes is MP4, QuickTime, AVI, Matroska or WebM.

    >>> is_video(b"RIFF....AVI LIST")
    True
    """
    return (
        start[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"skip")
        or (start[:4] == b"RIFF" and start[8:12] == b"AVI ")
        or start[:4] == b"\x1aE\xdf\xa3"
    )


def open_video(
    path: Path,
    *,
    join_settings: JoinSettings,
    camera_info: str | None = None,
    odometry: str | None = None,
    position: str | None = None,
    rate_hz: float | None = None,
) -> FolderRecording:
    """Open a video; frame times are the container's, or those of `rate_hz`.

    Raises
    ------
    RecordingError
        If it cannot be decoded, or the trajectory's times do not overlap it.
    """
    stamps_ns = _stamps_ns(path, rate_hz)
    images = ImageStream(
        camera="/video",
        kind="video",
        stamps_ns=stamps_ns,
        payloads=lambda: _frames(path),
        decoder=lambda: _gray,
    )
    trajectory = _trajectory(path, stamps_ns)
    return FolderRecording(
        path,
        "video",
        images=images,
        model=camera_file_model(path.parent, camera_info, images.first_size(), first=(f"{path.stem}.yaml",)),
        T_body_cam=SE3.identity(),  # by definition: the trajectory is the camera's own
        body_axes="rdf",
        claims=trajectory_streams(trajectory, odometry=odometry, position=position),
        join_settings=join_settings,
    )


def _capture(path: Path) -> Any:
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise RecordingError(
            f"{path} cannot be opened as a video: its codec is unknown, or the file is damaged"
        )
    return capture


def _stamps_ns(path: Path, rate_hz: float | None) -> npt.NDArray[np.int64]:
    """Time of each frame; the container is walked once, without converting any frame."""
    capture = _capture(path)
    times_ms = []
    try:
        while capture.grab():
            times_ms.append(capture.get(cv2.CAP_PROP_POS_MSEC))
    finally:
        capture.release()
    if not times_ms:
        raise RecordingError(f"{path} holds no frame that can be decoded")
    if rate_hz is not None:
        return even_stamps_ns(len(times_ms), rate_hz)
    stamps_ns = np.rint(np.array(times_ms) * 1e6).astype(np.int64)
    if len(stamps_ns) > 1 and not (np.diff(stamps_ns) > 0).all():
        raise RecordingError(f"{path} has no rising frame times; state the frame rate with --rate")
    return np.asarray(stamps_ns - stamps_ns[0])


def _frames(path: Path) -> Iterator[Callable[[], Any]]:
    """One call for each frame, to be made in order: it decodes the frame."""
    capture = _capture(path)

    def retrieve() -> Any:
        found, image = capture.retrieve()
        return image if found else None

    try:
        while capture.grab():
            yield retrieve
    finally:
        capture.release()


def _gray(retrieve: Callable[[], Any]) -> GrayImage:
    image = retrieve()
    if image is None:
        raise UndecodableImageError("a damaged video frame")
    return np.asarray(image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def _trajectory(path: Path, stamps_ns: npt.NDArray[np.int64]) -> Trajectory | None:
    table = next((path.with_suffix(end) for end in (".tum", ".txt") if path.with_suffix(end).is_file()), None)
    if table is None:
        return None
    trajectory = read_tum(table)
    first_ns, last_ns = int(trajectory.stamps_ns.min()), int(trajectory.stamps_ns.max())
    if last_ns < stamps_ns[0] or first_ns > stamps_ns[-1]:
        raise RecordingError(
            f"{table} runs from {first_ns / 1e9:.3f} to {last_ns / 1e9:.3f} s, "
            f"the video from 0 to {stamps_ns[-1] / 1e9:.3f} s; "
            "its times must count from the video's first frame"
        )
    return trajectory
