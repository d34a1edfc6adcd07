"""TUM RGB-D folders: an image list, ``groundtruth.txt`` (poses of the camera), ``camera.yaml``.

The body is the camera (x right, y down, z forward). TUM's folders carry no calibration: it stands beside
them in a camera file as ROS's ``camera_calibration`` writes it (see `belie.recordings.calibration`), named
``camera.yaml``, ``camera_info.yaml``, ``ost.yaml`` or ``camera.json``, or is given with ``--camera-info``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from belie.geometry import SE3, CameraModel
from belie.recordings.calibration import camera_info_file, camera_model
from belie.recordings.folder import FolderRecording, image_files, trajectory_streams
from belie.recordings.join_settings import JoinSettings
from belie.recordings.trajectory import even_stamps_ns, nanoseconds, read_tum, rows_of
from belie.types import CalibrationError, RecordingError, TopicError

_LISTS = ("rgb.txt", "gray.txt", "images.txt")
CAMERA_FILES = ("camera.yaml", "camera_info.yaml", "ost.yaml", "camera.json")


def is_tum(path: Path) -> bool:
    """Whether the folder has one of TUM's image lists.

    >>> is_tum(Path("no_such_folder"))
    False
    """
    return any((path / name).is_file() for name in _LISTS)


def open_tum(
    path: Path,
    *,
    join_settings: JoinSettings,
    image: str | None = None,
    camera_info: str | None = None,
    odometry: str | None = None,
    position: str | None = None,
    rate_hz: float | None = None,
) -> FolderRecording:
    """Open a TUM RGB-D folder; `image` names the list (``rgb``, ``gray``) where there are several.

    Raises
    ------
    RecordingError
        If a file is missing or malformed; `CalibrationError` without a camera file.
    """
    table = _image_list(path, image)
    stamps_ns, files = [], []
    for number, fields in rows_of(table):
        if len(fields) != 2:
            raise RecordingError(
                f"{table}, line {number}: expected 'seconds file', found {len(fields)} fields"
            )
        try:
            stamps_ns.append(nanoseconds(fields[0]))
        except ValueError as error:
            raise RecordingError(f"{table}, line {number}: {error}") from error
        files.append(path / fields[1])
    if not files:
        raise RecordingError(f"{table} lists no images")
    times_ns = np.array(stamps_ns, dtype=np.int64)
    if rate_hz is not None:
        times_ns = times_ns[0] + even_stamps_ns(len(files), rate_hz)
    images = image_files(f"/{table.stem}", files, times_ns)
    truth = path / "groundtruth.txt"
    trajectory = read_tum(truth) if truth.is_file() else None
    return FolderRecording(
        path,
        "tum",
        images=images,
        model=camera_file_model(path, camera_info, images.first_size()),
        T_body_cam=SE3.identity(),  # by definition: groundtruth.txt holds poses of the camera itself
        body_axes="rdf",
        claims=trajectory_streams(trajectory, odometry=odometry, position=position),
        join_settings=join_settings,
    )


def camera_file_model(
    folder: Path, named: str | None, image_size: tuple[int, int], *, first: tuple[str, ...] = ()
) -> CameraModel:
    """The camera of a folder's (or a video's) images from the camera file beside them.

    Raises
    ------
    CalibrationError
        If there is none; says what belongs there.
    """
    candidates = [Path(named)] if named is not None else [folder / name for name in (*first, *CAMERA_FILES)]
    for path in candidates:
        if path.is_file():
            return camera_model(
                camera_info_file(path), image_size=image_size, rectified=False, where=str(path)
            )
    if named is not None:
        raise CalibrationError(f"--camera-info {named}: no such file")
    raise CalibrationError(
        f"no camera calibration in {folder}: write {candidates[0].name} there, in the form of ROS's "
        "camera_calibration (image_width, image_height, camera_matrix: {data: [9 numbers]}, "
        "distortion_model, distortion_coefficients: {data: [...]}), or name a file with --camera-info"
    )


def _image_list(path: Path, named: str | None) -> Path:
    present = [name for name in _LISTS if (path / name).is_file()]
    if named is not None:
        name = named.strip("/").removesuffix(".txt") + ".txt"
        if not (path / name).is_file():
            raise TopicError(f"--image {named}: {path} has {', '.join(present)}")
        return path / name
    if len(present) > 1:
        raise TopicError(f"{len(present)} image lists in {path}: {', '.join(present)}; name one with --image")
    return path / present[0]
