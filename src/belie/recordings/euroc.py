"""EuRoC ASL folders: ``mav0/cam0``, ``imu0``, ``state_groundtruth_estimate0``.

The body is the IMU; each sensor's ``T_BS`` maps its coordinates to the body's.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel, FloatArray
from belie.recordings.calibration import CameraInfo, camera_model, matrix_of, read_yaml
from belie.recordings.folder import ClaimStream, FolderRecording, image_files, trajectory_streams
from belie.recordings.join_settings import JoinSettings
from belie.recordings.topics import NONE
from belie.recordings.trajectory import Trajectory, numbers_of, rows_of
from belie.types import CalibrationError, MotionClaim, RecordingError, TopicError

_TRUTH = "state_groundtruth_estimate0"


def euroc_root(path: Path) -> Path | None:
    """The folder that holds ``cam0``: the given one or its ``mav0``; None if this is no ASL folder.

    >>> euroc_root(Path("no_such_folder")) is None
    True
    """
    for root in (path / "mav0", path):
        if root.is_dir() and any((camera / "data.csv").is_file() for camera in root.glob("cam*")):
            return root
    return None


def open_euroc(
    path: Path,
    *,
    join_settings: JoinSettings,
    image: str | None = None,
    odometry: str | None = None,
    position: str | None = None,
    imu: str | None = None,
) -> FolderRecording:
    """Open an ASL folder; ``cam0`` is taken unless `image` names another camera.

    Raises
    ------
    RecordingError
        If a file is missing or malformed.
    """
    root = euroc_root(path)
    if root is None:
        raise RecordingError(f"{path} holds no cam0/data.csv")
    camera = _sensor(root, "cam", image, "--image")
    stamps_ns, files = _images(root / camera)
    images = image_files(f"/{camera}", files, stamps_ns)
    sensor = root / camera / "sensor.yaml"
    trajectory = _truth(root / _TRUTH / "data.csv")
    streams = list(trajectory_streams(trajectory, odometry=odometry, position=position))
    if imu != NONE and (imu is not None or any(root.glob("imu*/data.csv"))):
        streams.append(_imu(root / _sensor(root, "imu", imu, "--imu")))
    return FolderRecording(
        path,
        "euroc",
        images=images,
        model=_model(sensor, images.first_size()),
        T_body_cam=_T_body_sensor(sensor),
        body_axes="flu",
        claims=streams,
        join_settings=join_settings,
    )


def _sensor(root: Path, prefix: str, named: str | None, flag: str) -> str:
    present = sorted(table.parent.name for table in root.glob(f"{prefix}*/data.csv"))
    if named is not None and named.strip("/") not in present:
        raise TopicError(f"{flag} {named}: {root} has {', '.join(present) or 'none'}")
    return present[0] if named is None else named.strip("/")


def _images(folder: Path) -> tuple[npt.NDArray[np.int64], list[Path]]:
    stamps_ns, files = [], []
    for number, fields in rows_of(folder / "data.csv", separator=","):
        if len(fields) < 2 or not fields[0].isdigit():
            raise RecordingError(f"{folder / 'data.csv'}, line {number}: expected 'nanoseconds,file'")
        stamps_ns.append(int(fields[0]))
        files.append(folder / "data" / fields[1])
    if not files:
        raise RecordingError(f"{folder / 'data.csv'} lists no images")
    return np.array(stamps_ns, dtype=np.int64), files


def _T_body_sensor(path: Path) -> SE3:
    if not path.is_file():
        raise CalibrationError(f"{path} is missing; it holds the transform T_BS from the sensor to the body")
    numbers = matrix_of(read_yaml(path), "T_BS", str(path))
    if len(numbers) != 16:
        raise CalibrationError(f"{path} has no T_BS of 16 numbers, the transform from the sensor to the body")
    try:
        return SE3.from_matrix(np.array(numbers).reshape(4, 4))
    except ValueError as error:
        raise CalibrationError(f"{path}: T_BS: {error}") from error


def _model(path: Path, image_size: tuple[int, int]) -> CameraModel:
    content = read_yaml(path)
    intrinsics = matrix_of(content, "intrinsics", str(path))
    resolution = matrix_of(content, "resolution", str(path)) or (0, 0)
    if len(intrinsics) != 4 or len(resolution) != 2:
        raise CalibrationError(f"{path} must hold intrinsics [fu, fv, cu, cv] and resolution [width, height]")
    fu, fv, cu, cv = intrinsics
    info = CameraInfo(
        width=int(resolution[0]),
        height=int(resolution[1]),
        distortion_model=str(content.get("distortion_model", "")),
        D=matrix_of(content, "distortion_coefficients", str(path)),
        K=(fu, 0.0, cu, 0.0, fv, cv, 0.0, 0.0, 1.0),
    )
    return camera_model(info, image_size=image_size, rectified=False, where=str(path))


def _table(path: Path, columns: int, what: str) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Stamps and the next `columns` columns of a CSV file."""
    stamps_ns, values = [], []
    for number, fields in rows_of(path, separator=","):
        if len(fields) <= columns or not fields[0].isdigit():
            raise RecordingError(f"{path}, line {number}: expected nanoseconds and {what}")
        stamps_ns.append(int(fields[0]))
        values.append(numbers_of(path, number, fields[1 : columns + 1], what))
    return np.array(stamps_ns, dtype=np.int64), np.array(values, dtype=np.float64).reshape(-1, columns)


def _truth(path: Path) -> Trajectory | None:
    if not path.is_file():
        return None
    stamps_ns, values = _table(path, 7, "position (3) and quaternion w x y z")
    try:
        poses = tuple(SE3.from_quat_xyzw(row[[4, 5, 6, 3]], row[:3]) for row in values)
    except ValueError as error:
        raise RecordingError(f"{path}: {error}") from error
    return Trajectory(path=path, stamps_ns=stamps_ns, poses=poses)


def _imu(folder: Path) -> ClaimStream:
    stamps_ns, values = _table(folder / "data.csv", 6, "angular rate (3) and specific force (3)")
    R_body_imu = _T_body_sensor(folder / "sensor.yaml").R
    source = f"/{folder.name}"

    def claims() -> Iterator[MotionClaim]:
        for stamp_ns, row in zip(stamps_ns.tolist(), values, strict=True):
            yield MotionClaim(
                source=source,
                kind="imu",
                stamp_ns=stamp_ns,
                received_ns=stamp_ns,
                angular_rad_s=R_body_imu @ row[:3],
                acceleration_m_s2=R_body_imu @ row[3:],
            )

    return ClaimStream(topic=source, role="imu", kind="data.csv", stamps_ns=stamps_ns, claims=claims)
