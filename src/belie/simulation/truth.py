"""The truth beside a simulated recording: trajectory (TUM), objects (JSON lines) and depth (PNG)."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import numpy.typing as npt

from belie.geometry import SE3
from belie.types import RecordingError

if TYPE_CHECKING:
    from belie.simulation.labels import ObjectLabel
    from belie.simulation.stage import View

DEPTH_UNITS_PER_M = 256.0  # as KITTI's depth maps: 16 bit reach 256 m in steps of 4 mm


def trajectory_path(recording: Path | str) -> Path:
    """Where the true trajectory lies: beside the recording.

    >>> trajectory_path("out.mcap").name
    'out.mcap.groundtruth.tum'
    """
    return Path(f"{recording}.groundtruth.tum")


def objects_path(recording: Path | str) -> Path:
    """Where the true objects lie: beside the recording.

    >>> objects_path("out.mcap").name
    'out.mcap.objects.jsonl'
    """
    return Path(f"{recording}.objects.jsonl")


def write_trajectory(path: Path, poses: Iterable[tuple[int, SE3]]) -> None:
    """Write ``T_world_body`` in TUM's format: seconds, x y z, quaternion x y z w; ``evo`` reads it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_trajectory(Path(folder) / "t.tum", [(1_500_000_000, SE3.from_translation([1.0, 2.0, 3.0]))])
    ...     print((Path(folder) / "t.tum").read_text().splitlines()[-1])
    1.500000000 1.000000 2.000000 3.000000 0.000000000 0.000000000 0.000000000 1.000000000
    """
    lines = [
        "# T_world_body: seconds x y z qx qy qz qw (metres; x east, y north, z up; body x forward, y left)"
    ]
    for stamp_ns, T in poses:
        seconds, rest = divmod(
            stamp_ns, 1_000_000_000
        )  # as integers: a float64 cannot hold today's nanoseconds
        t = " ".join(f"{value:.6f}" for value in T.t)
        q = " ".join(f"{value:.9f}" for value in T.quat_xyzw())
        lines.append(f"{seconds}.{rest:09d} {t} {q}")
    _write(path, "\n".join(lines) + "\n")


def objects_line(view: View) -> str:
    """All true objects in view of one frame, as one line of JSON."""
    return json.dumps(
        {
            "frame": view.index,
            "stamp_ns": view.frame.stamp_ns,
            "objects": [_object(label) for label in view.labels],
        }
    )


def write_objects(path: Path, lines: Iterable[str]) -> None:
    """Write the lines of `objects_line`."""
    _write(path, "".join(f"{line}\n" for line in lines))


def write_depth(folder: Path, index: int, depth_m: npt.NDArray[np.floating]) -> None:
    """Write one depth image, 16 bit, 256 a metre (as KITTI's): along the optical axis; 0 where there is nothing.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_depth(Path(folder), 7, np.array([[1.0, np.inf]]))
    ...     cv2.imread(f"{folder}/000007.png", cv2.IMREAD_UNCHANGED).tolist()
    [[256, 0]]
    """
    scaled = np.where(np.isfinite(depth_m), depth_m, 0.0) * DEPTH_UNITS_PER_M
    image = np.where(scaled > 65535.0, 0.0, np.round(scaled)).astype(np.uint16)
    target = folder / f"{index:06d}.png"
    if not cv2.imwrite(str(target), image):
        raise RecordingError(f"cannot write the depth image {target}")


def _object(label: ObjectLabel) -> dict[str, Any]:
    return {
        "id": label.id,
        "label": label.label,
        "box_px": [round(float(edge), 2) for edge in label.box_px],
        "visible": round(float(label.visible), 4),
        "truncation": round(float(label.truncation), 4),
        "distance_m": round(float(label.distance_m), 3),
        "position_cam_m": [round(float(value), 4) for value in label.T_cam_obj.t],
        "quat_cam_xyzw": [round(float(value), 6) for value in label.T_cam_obj.quat_xyzw()],
        "dimensions_m": [round(float(value), 3) for value in label.dimensions_m],
    }


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror}") from None
