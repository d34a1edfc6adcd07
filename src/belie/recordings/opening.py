"""From a path to a `Recording`: the format is recognised from the contents, never from the name."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from belie.recordings.added_claims import AddedStream, ExtendedRecording, in_order
from belie.recordings.bag import BagRecording
from belie.recordings.calibration import read_yaml
from belie.recordings.detection_doubts import doubts
from belie.recordings.detection_files import read_detections
from belie.recordings.detection_rows import DETECTIONS_SOURCE, DetectionTable, on_frames
from belie.recordings.euroc import euroc_root, open_euroc
from belie.recordings.join_settings import JoinSettings
from belie.recordings.kitti import is_kitti, open_kitti
from belie.recordings.kitti_labels import KITTI_LABELS
from belie.recordings.recording import Recording
from belie.recordings.storage import BagFormat
from belie.recordings.topics import NONE, no_file
from belie.recordings.tum import is_tum, open_tum
from belie.recordings.video import is_video, open_video
from belie.types import RecordingError, TopicError

_MAGIC: tuple[tuple[bytes, BagFormat], ...] = (
    (b"\x89MCAP0\r\n", "ros2-mcap"),
    (b"SQLite format 3\x00", "ros2-sqlite3"),
    (b"#ROSBAG V", "ros1"),
)
_KNOWN = (
    "ROS 2 bags (MCAP, sqlite3), ROS 1 bags, KITTI odometry, EuRoC ASL and TUM folders, "
    "and videos with a TUM trajectory"
)
_STORAGE: dict[object, BagFormat] = {"mcap": "ros2-mcap", "sqlite3": "ros2-sqlite3"}


def open_recording(
    path: str | os.PathLike[str],
    *,
    image: str | None = None,
    camera_info: str | None = None,
    odometry: str | None = None,
    position: str | None = None,
    imu: str | None = None,
    detections: str | None = None,
    detection_names: str | os.PathLike[str] | None = None,
    rate_hz: float | None = None,
    join_settings: JoinSettings | None = None,
) -> Recording:
    """Open a recording of any known format.

    Parameters
    ----------
    path : path
        A bag file or folder (MCAP, sqlite3, ROS 1), a KITTI, EuRoC or TUM folder, or a video.
    image, camera_info, odometry, position, imu, detections : str, optional
        Topics (cameras, files) to use where several would do. ``none`` leaves odometry, position, IMU or
        detections out. In folders `position="poses"` reads the one trajectory as the position claim too;
        `camera_info` names a camera file for TUM folders and videos. `detections` may be a file beside any recording:
        KITTI tracking labels, MOT text, or a CSV file (see `belie.recordings.detection_csv`).
    detection_names : path, optional
        Names of the classes of MOT text, one a line.
    rate_hz : float, optional
        Frame rate of folders and videos, instead of the times that they hold.
    join_settings : JoinSettings, optional
        How streams are joined.

    Raises
    ------
    RecordingError
        If nothing is there, the format is unknown, or the data are damaged.
    TopicError
        If a stream is missing or ambiguous.
    CalibrationError
        If intrinsics or an extrinsic transform are missing.

    Examples
    --------
    >>> open_recording("no/such/file.mcap")
    Traceback (most recent call last):
    ...
    belie.types.errors.RecordingError: no/such/file.mcap does not exist
    """
    path = Path(path)
    if rate_hz is not None and not 0.0 < rate_hz < 1e6:
        raise ValueError(f"rate_hz must be positive, got {rate_hz}")
    if not path.exists():
        raise RecordingError(f"{path} does not exist")
    settings = join_settings or JoinSettings()
    named = {
        "image": image,
        "camera_info": camera_info,
        "odometry": odometry,
        "position": position,
        "imu": imu,
        "detections": detections,
    }
    table = _detection_table(detections, detection_names)
    if table is not None:
        named["detections"] = NONE
    recording = _open(path, settings, named, rate_hz)
    return recording if table is None else _with_detections(recording, table)


def _open(
    path: Path, settings: JoinSettings, named: dict[str, str | None], rate_hz: float | None
) -> Recording:
    try:
        source, bag_format = _bag(path)
        if bag_format is not None:
            _refuse(bag_format, rate_hz=rate_hz)
            return BagRecording(source, bag_format, join_settings=settings, **named)
        if path.is_file():
            return _open_file(path, settings, named, rate_hz)
        return _open_folder(path, settings, named, rate_hz)
    except OSError as error:
        raise RecordingError(f"{error.filename or path} cannot be read: {error.strerror or error}") from error


def _detection_table(detections: str | None, names: str | os.PathLike[str] | None) -> DetectionTable | None:
    """The file that is named as detections; None where a topic is named, or nothing."""
    if detections is None or not Path(detections).is_file():
        return None
    return read_detections(Path(detections), names=None if names is None else Path(names))


def _with_detections(recording: Recording, table: DetectionTable) -> Recording:
    stamps_ns = recording.frame_stamps_ns()
    (camera,) = recording.cameras.values()
    # KITTI's labels are in the axes of the left camera, which is the body of its folders.
    is_reference = recording.format == "kitti" and table.kind == KITTI_LABELS
    found = on_frames(table, stamps_ns, camera.model, camera.T_body_cam.inverse() if is_reference else None)
    stream = AddedStream(
        topic=DETECTIONS_SOURCE,
        kind=f"{table.path.name} ({table.kind})",
        stamps_ns=np.array([claim.stamp_ns for claim in found.claims], dtype=np.int64),
        start=in_order(found.claims),
        outside=found.outside,
        repeated=found.repeated,
        warnings=(*doubts(table, stamps_ns, camera.model), *found.warnings),
    )
    return ExtendedRecording(recording, stream)


def _bag(path: Path) -> tuple[Path, BagFormat | None]:
    """The bag that a path means, and its format; None if it is no bag."""
    if path.is_file():
        if path.name == "metadata.yaml":
            return _bag(path.parent)
        start = _start_of(path)
        return path, next((format for magic, format in _MAGIC if start.startswith(magic)), None)
    metadata = path / "metadata.yaml"
    if metadata.is_file():
        information = read_yaml(metadata).get("rosbag2_bagfile_information")
        if isinstance(information, dict):
            storage = information.get("storage_identifier")
            if storage not in _STORAGE:
                raise RecordingError(f"{metadata}: the storage {storage!r} is not known; use mcap or sqlite3")
            return path, _STORAGE[storage]
    bags = [
        (file, format)
        for file in sorted(path.iterdir())
        if file.is_file()
        for magic, format in _MAGIC
        if _start_of(file).startswith(magic)
    ]
    if len(bags) > 1:
        names = ", ".join(file.name for file, _ in bags)
        raise RecordingError(
            f"{path} holds several bags ({names}) and no metadata.yaml; "
            "name one of them, or join them with `ros2 bag reindex`"
        )
    return bags[0] if bags else (path, None)


def _start_of(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(16)


def _open_file(
    path: Path, settings: JoinSettings, named: dict[str, str | None], rate_hz: float | None
) -> Recording:
    start = _start_of(path)
    if not start:
        raise RecordingError(f"{path} is empty (0 bytes)")
    if is_video(start):
        _refuse("video", image=named["image"], imu=named["imu"], detections=named["detections"])
        return open_video(path, join_settings=settings, rate_hz=rate_hz, **_only(named, "camera_info"))
    raise RecordingError(f"{path} is no recording: it starts with {start!r}; belie reads {_KNOWN}")


def _open_folder(
    path: Path, settings: JoinSettings, named: dict[str, str | None], rate_hz: float | None
) -> Recording:
    if euroc_root(path) is not None:
        _refuse("euroc", camera_info=named["camera_info"], detections=named["detections"], rate_hz=rate_hz)
        return open_euroc(path, join_settings=settings, **_only(named, "image", "imu"))
    if is_kitti(path):
        _refuse(
            "kitti",
            camera_info=named["camera_info"],
            imu=named["imu"],
            detections=named["detections"],
        )
        return open_kitti(path, join_settings=settings, rate_hz=rate_hz, **_only(named, "image"))
    if is_tum(path):
        _refuse("tum", imu=named["imu"], detections=named["detections"])
        return open_tum(path, join_settings=settings, rate_hz=rate_hz, **_only(named, "image", "camera_info"))
    found = sorted(entry.name for entry in path.iterdir())
    if not found:
        raise RecordingError(f"{path} is an empty folder")
    listed = ", ".join(found[:6]) + (" …" if len(found) > 6 else "")
    raise RecordingError(f"{path} is no recording: it holds {listed}; belie reads {_KNOWN}")


def _only(named: dict[str, str | None], *names: str) -> dict[str, Any]:
    return {name: named[name] for name in (*names, "odometry", "position")}


def _refuse(format: str, **given: object) -> None:
    """An option that a format cannot honour is an error, not silence."""
    for name, value in given.items():
        if value is not None and value != NONE:
            if name == "detections":
                raise TopicError(
                    f"--detections {value}: {no_file(str(value))}, and a recording of format {format} holds no "
                    "detections itself"
                )
            flag = "--rate" if name == "rate_hz" else f"--{name.replace('_', '-')}"
            raise TopicError(
                f"{flag} {value} has no meaning for a recording of format {format}; leave it out"
            )
