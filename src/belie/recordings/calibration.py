"""Intrinsics as robots store them, ROS's camera_info, to `CameraModel`.

A folder or a video states its camera in the same terms: a YAML (or JSON) file as ROS's
``camera_calibration`` and ``camera_info_manager`` write it::

    image_width: 640
    image_height: 480
    camera_matrix: {rows: 3, cols: 3, data: [525.0, 0, 319.5, 0, 525.0, 239.5, 0, 0, 1]}
    distortion_model: plumb_bob
    distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from belie.geometry import CameraModel, DistortionModel
from belie.types import CalibrationError, RecordingError

_MODELS: dict[str, DistortionModel] = {
    "": "pinhole",
    "none": "pinhole",
    "pinhole": "pinhole",
    "plumb_bob": "radial_tangential",
    "radtan": "radial_tangential",
    "radial-tangential": "radial_tangential",
    "rational_polynomial": "rational",
    "equidistant": "equidistant",
    "fisheye": "equidistant",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraInfo:
    """The fields of ``sensor_msgs/CameraInfo`` that describe the camera."""

    width: int
    height: int
    distortion_model: str
    D: tuple[float, ...]
    K: tuple[float, ...]
    P: tuple[float, ...] = ()
    binning: tuple[int, int] = (1, 1)
    roi_xywh: tuple[int, int, int, int] = (0, 0, 0, 0)

    @classmethod
    def from_message(cls, message: Any) -> CameraInfo:
        """From a deserialised message; ROS 1 writes the matrices in capitals."""
        fields = {
            name: tuple(float(v) for v in getattr(message, name, getattr(message, name.lower(), ())))
            for name in ("D", "K", "P")
        }
        roi = message.roi
        return cls(
            width=int(message.width),
            height=int(message.height),
            distortion_model=str(message.distortion_model),
            binning=(max(1, int(message.binning_x)), max(1, int(message.binning_y))),
            roi_xywh=(int(roi.x_offset), int(roi.y_offset), int(roi.width), int(roi.height)),
            **fields,
        )


def camera_model(
    info: CameraInfo, *, image_size: tuple[int, int], rectified: bool, where: str
) -> CameraModel:
    """The model of the images' camera.

    Parameters
    ----------
    info : CameraInfo
        What the recording says of it.
    image_size : (int, int)
        Width and height of the images, pixels.
    rectified : bool
        The images are rectified: P holds their intrinsics, and no distortion is left.
    where : str
        Topic or file, for the errors.

    Raises
    ------
    CalibrationError
        If the calibration is empty, of an unknown model, or for another image size.

    Examples
    --------
    >>> info = CameraInfo(width=640, height=480, distortion_model="plumb_bob", D=(0.0,) * 5,
    ...                   K=(500, 0, 319.5, 0, 500, 239.5, 0, 0, 1))
    >>> camera_model(info, image_size=(640, 480), rectified=False, where="/camera_info").model
    'pinhole'
    """
    if len(info.K) != 9 or info.K[0] == 0.0 or info.K[4] == 0.0:
        raise CalibrationError(
            f"{where} holds no calibration (its K is {'zero' if len(info.K) == 9 else 'empty'}); "
            "calibrate the camera, or name another with --camera-info"
        )
    K = np.array(info.K).reshape(3, 3)
    model, distortion = _distortion(info, where)
    if rectified:
        model, distortion = "pinhole", ()
        if len(info.P) == 12 and info.P[0] != 0.0:
            K = np.array(info.P).reshape(3, 4)[:, :3]
    try:
        camera = CameraModel(
            width=info.width or image_size[0],
            height=info.height or image_size[1],
            fx=float(K[0, 0]),
            fy=float(K[1, 1]),
            cx=float(K[0, 2]),
            cy=float(K[1, 2]),
            model=model,
            distortion=distortion,
        )
    except ValueError as error:
        raise CalibrationError(f"{where} cannot be used: {error}") from error
    return _fitted(camera, info, image_size, where)


def _distortion(info: CameraInfo, where: str) -> tuple[DistortionModel, tuple[float, ...]]:
    name = info.distortion_model.strip().lower()
    if name not in _MODELS or (_MODELS[name] == "pinhole" and any(info.D)):
        raise CalibrationError(
            f"{where} has the distortion model {info.distortion_model!r}; "
            f"known: {', '.join(n for n in _MODELS if n)}"
        )
    if _MODELS[name] != "equidistant" and not any(info.D):
        return "pinhole", ()
    return _MODELS[name], info.D


def _fitted(camera: CameraModel, info: CameraInfo, image_size: tuple[int, int], where: str) -> CameraModel:
    """The model of a region of interest or of binned pixels, where the images are such."""
    width, height = image_size
    x, y, roi_width, roi_height = info.roi_xywh
    binned = tuple(
        size // b
        for size, b in zip(
            (roi_width or camera.width, roi_height or camera.height), info.binning, strict=True
        )
    )
    if (camera.width, camera.height) == image_size and not (roi_width and roi_height):
        return camera
    if binned == image_size:
        bx, by = info.binning
        return replace(
            camera,
            width=width,
            height=height,
            fx=camera.fx / bx,
            fy=camera.fy / by,
            cx=(camera.cx - x + 0.5) / bx - 0.5,
            cy=(camera.cy - y + 0.5) / by - 0.5,
        )
    if (camera.width, camera.height) == image_size:
        return camera
    raise CalibrationError(
        f"{where} is for {camera.width}x{camera.height} pixels, the images are {width}x{height}; "
        "name the right one with --camera-info"
    )


def read_yaml(path: Path) -> Mapping[str, Any]:
    """A small YAML (or JSON, or OpenCV YAML) file as a mapping.

    Raises
    ------
    RecordingError
        If it cannot be read or is no mapping.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        # OpenCV's header is not valid YAML.
        content = YAML(typ="safe").load("\n".join(line for line in lines if not line.startswith("%YAML")))
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        raise RecordingError(f"{path} cannot be read as YAML: {' '.join(str(error).split())}") from error
    if not isinstance(content, Mapping):
        raise RecordingError(f"{path} holds no YAML mapping")
    return content


def matrix_of(content: Mapping[str, Any], key: str, where: str) -> tuple[float, ...]:
    """The numbers of an entry ``key: {rows, cols, data}``, or of a plain (nested) list.

    >>> matrix_of({"K": {"rows": 1, "cols": 2, "data": [1, 2]}}, "K", "camera.yaml")
    (1.0, 2.0)
    """
    value = content.get(key, ())
    if isinstance(value, Mapping):
        value = value.get("data", ())
    try:
        numbers: npt.NDArray[np.float64] = np.array(value if isinstance(value, Sequence) else (), dtype=float)
    except (TypeError, ValueError) as error:
        raise CalibrationError(f"{where}: {key} must hold numbers") from error
    return tuple(float(v) for v in numbers.ravel())


def camera_info_file(path: Path) -> CameraInfo:
    r"""Read a camera file of the form shown at the top of this module.

    Raises
    ------
    RecordingError
        If it cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "camera.yaml"
    ...     _ = file.write_text("image_width: 640\nimage_height: 480\n"
    ...                         "camera_matrix: {data: [500, 0, 319.5, 0, 500, 239.5, 0, 0, 1]}\n")
    ...     camera_info_file(file).K[0]
    500.0
    """
    content = read_yaml(path)
    try:
        width, height = int(content.get("image_width", 0)), int(content.get("image_height", 0))
    except (TypeError, ValueError) as error:
        raise CalibrationError(f"{path}: image_width and image_height must be whole numbers") from error
    return CameraInfo(
        width=width,
        height=height,
        distortion_model=str(content.get("distortion_model", "")),
        D=matrix_of(content, "distortion_coefficients", str(path)),
        K=matrix_of(content, "camera_matrix", str(path)),
        P=matrix_of(content, "projection_matrix", str(path)),
    )
