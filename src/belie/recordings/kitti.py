"""KITTI odometry folders: ``image_0/``, ``calib.txt``, ``times.txt``, ``poses.txt``.

The body is the left camera (x right, y down, z forward), which the poses belong to. The official layout
``sequences/00`` with ``poses/00.txt`` two levels up is read too.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel, FloatArray
from belie.recordings.folder import FolderRecording, image_files, trajectory_streams
from belie.recordings.join_settings import JoinSettings
from belie.recordings.trajectory import Trajectory, even_stamps_ns, nanoseconds, numbers_of, rows_of
from belie.types import CalibrationError, RecordingError, TopicError

_CAMERAS = ("image_0", "image_2", "image_1", "image_3")
_SUFFIXES = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm"}


def is_kitti(path: Path) -> bool:
    """Whether the folder has one of KITTI's image folders.

    >>> is_kitti(Path("no_such_folder"))
    False
    """
    return any((path / name).is_dir() for name in _CAMERAS)


def open_kitti(
    path: Path,
    *,
    join_settings: JoinSettings,
    image: str | None = None,
    odometry: str | None = None,
    position: str | None = None,
    rate_hz: float | None = None,
) -> FolderRecording:
    """Open a KITTI odometry sequence; ``image_0`` is taken before ``image_2`` unless `image` names one.

    Raises
    ------
    RecordingError
        If a file is missing, malformed, or shorter than the images.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     (Path(folder) / "image_0").mkdir()
    ...     open_kitti(Path(folder), join_settings=JoinSettings())  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    belie.types.errors.RecordingError: ...image_0 holds no images
    """
    camera = _camera(path, image)
    files = sorted(file for file in (path / camera).iterdir() if file.suffix.lower() in _SUFFIXES)
    if not files:
        raise RecordingError(f"{path / camera} holds no images")
    stamps_ns = _stamps_ns(path, files, rate_hz)
    images = image_files(f"/{camera}", files, stamps_ns)
    P = _projection(path / "calib.txt", camera)
    try:
        width, height = images.first_size()
        model = CameraModel(width=width, height=height, fx=P[0, 0], fy=P[1, 1], cx=P[0, 2], cy=P[1, 2])
    except ValueError as error:
        raise CalibrationError(f"{path / 'calib.txt'}: {error}") from error
    # P = K [I | t] maps from the left camera; so T_cam_left is the translation t.
    T_cam_left = SE3.from_translation(np.linalg.solve(P[:, :3], P[:, 3]))
    trajectory = _trajectory(path, files, stamps_ns)
    return FolderRecording(
        path,
        "kitti",
        images=images,
        model=model,
        T_body_cam=T_cam_left.inverse(),
        body_axes="rdf",
        claims=trajectory_streams(trajectory, odometry=odometry, position=position),
        join_settings=join_settings,
    )


def _camera(path: Path, named: str | None) -> str:
    present = [name for name in _CAMERAS if (path / name).is_dir()]
    if named is None:
        return present[0]
    if named.strip("/") not in present:
        raise TopicError(f"--image {named}: {path} has {', '.join(present)}")
    return named.strip("/")


def _projection(path: Path, camera: str) -> FloatArray:
    key = f"P{camera.removeprefix('image_')}"
    if not path.is_file():
        raise CalibrationError(f"{path} is missing; it holds the camera's projection as '{key}: 12 numbers'")
    for number, fields in rows_of(path):
        if fields[0].rstrip(":") == key:
            values = numbers_of(path, number, fields[1:], f"12 numbers after {key}:")
            if len(values) != 12 or values[0] <= 0.0 or values[5] <= 0.0:
                raise CalibrationError(
                    f"{path}, line {number}: {key} must hold the 12 numbers of a projection"
                )
            return np.array(values).reshape(3, 4)
    raise CalibrationError(f"{path} has no line '{key}:' for {camera}")


def _stamps_ns(path: Path, files: Sequence[Path], rate_hz: float | None) -> npt.NDArray[np.int64]:
    table = path / "times.txt"
    if rate_hz is not None:
        return even_stamps_ns(len(files), rate_hz)
    if not table.is_file():
        raise RecordingError(f"{table} is missing; record it, or state the frame rate with --rate")
    times = []
    for number, fields in rows_of(table):
        try:
            times.append(nanoseconds(fields[0]))
        except ValueError as error:
            raise RecordingError(f"{table}, line {number}: {error}") from error
    rows = _rows_of_images(table, files, len(times), "times")
    return np.array(times, dtype=np.int64)[rows]


def _rows_of_images(table: Path, files: Sequence[Path], count: int, what: str) -> list[int]:
    """Row of each image: by order where there are as many, else by the number in the file's name."""
    if count == len(files):
        return list(range(count))
    rows = [int(file.stem) if file.stem.isdigit() else index for index, file in enumerate(files)]
    if max(rows) >= count:
        raise RecordingError(
            f"{table} holds {count} {what} for {len(files)} images (the last is {files[-1].name}); "
            "each image needs its row"
        )
    return rows


def _trajectory(path: Path, files: Sequence[Path], stamps_ns: npt.NDArray[np.int64]) -> Trajectory | None:
    tables = (path / "poses.txt", path.resolve().parent.parent / "poses" / f"{path.resolve().name}.txt")
    table = next((table for table in tables if table.is_file()), None)
    if table is None:
        return None
    poses = []
    for number, fields in rows_of(table):
        expected = "the 12 numbers of a 3x4 pose"
        if len(fields) != 12:
            raise RecordingError(f"{table}, line {number}: expected {expected}, found {len(fields)} fields")
        values = numbers_of(table, number, fields, expected)
        try:
            poses.append(SE3.from_matrix(np.array(values).reshape(3, 4)))
        except ValueError as error:
            raise RecordingError(f"{table}, line {number}: {error}") from error
    rows = _rows_of_images(table, files, len(poses), "poses")
    return Trajectory(path=table, stamps_ns=stamps_ns, poses=tuple(poses[row] for row in rows))
