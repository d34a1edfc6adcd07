"""KITTI's tracking labels: one object a line, 17 fields and an optional score, separated by blanks.

``frame track_id type truncated occluded alpha left top right bottom height width length x y z rotation_y [score]``

Frames count from 0. The place is the middle of the object's bottom in the axes of the rectified reference camera (the
left gray one); ``rotation_y`` turns the object about the camera's y axis from facing right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from belie.geometry import SE3
from belie.recordings.detection_rows import DetectionRow, DetectionTable, ordered_box_px, score_of, whole
from belie.recordings.trajectory import numbers_of, rows_of
from belie.types import Detection, RecordingError

KITTI_LABELS = "KITTI tracking labels"
_FIELDS = (17, 18)
_OBJECT_FIELDS = (15, 16)
_NAME = 2  # place of the type among the fields
_IGNORED = "DontCare"
_EXPECTED = "KITTI's 17 or 18 fields: frame, track id, type and numbers"


def is_kitti_labels(fields: Sequence[str]) -> bool:
    """Whether the fields of a line look like KITTI's: a name comes third, after frame and track id.

    >>> is_kitti_labels("0 1 Car 0 0 -1.6 296.7 161.7 455.2 292.4 2.0 1.8 4.4 -4.5 1.8 13.4 -2.1".split())
    True
    """
    return (
        len(fields) > _NAME and fields[0].isdigit() and _is_number(fields[1]) and fields[_NAME][:1].isalpha()
    )


def is_kitti_object_labels(fields: Sequence[str]) -> bool:
    """Whether the fields are those of KITTI's object labels, which tell neither frame nor track id.

    >>> is_kitti_object_labels("Car 0 0 -1.6 296.7 161.7 455.2 292.4 2.0 1.8 4.4 -4.5 1.8 13.4 -2.1".split())
    True
    """
    return len(fields) in _OBJECT_FIELDS and fields[0][:1].isalpha() and all(map(_is_number, fields[1:]))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def read_kitti_labels(path: Path) -> DetectionTable:
    r"""Read a label file; what is marked DontCare is left out.

    Raises
    ------
    RecordingError
        Names the first line that is malformed.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "0000.txt").write_text("0 1 Car 0 0 0 10 20 30 40 1.5 1.8 4.2 -4.5 1.8 13.4 -1.57\n")
    ...     (row,) = read_kitti_labels(Path(folder) / "0000.txt").rows
    >>> row.detection.position_m, row.detection.dimensions_m
    (array([-4.5 ,  1.05, 13.4 ]), array([4.2, 1.8, 1.5]))
    """
    rows = tuple(_row(path, line, fields) for line, fields in rows_of(path))
    return DetectionTable(path=path, kind=KITTI_LABELS, rows=rows)


def _row(path: Path, line: int, fields: list[str]) -> DetectionRow:
    if len(fields) not in _FIELDS:
        raise RecordingError(f"{path}, line {line}: expected {_EXPECTED}, found {len(fields)} fields")
    frame, track = (whole(path, line, text, "frame and track id") for text in fields[:2])
    if fields[_NAME] == _IGNORED:
        return DetectionRow(line=line, frame=frame)
    numbers = numbers_of(path, line, fields[3:], _EXPECTED)
    height_m, width_m, length_m = numbers[7:10]
    is_placed = min(height_m, width_m, length_m) > 0.0 and numbers[12] > 0.0
    return DetectionRow(
        line=line,
        frame=frame,
        detection=Detection(
            label=fields[_NAME],
            score=score_of(numbers[14]) if len(numbers) > 14 else 1.0,
            track_id=str(track) if track >= 0 else "",
            box_px=np.array(ordered_box_px(path, line, numbers[3:7])),
            T_cam_obj=_T_cam_obj(numbers[10:13], height_m, numbers[13]) if is_placed else None,
            dimensions_m=np.array([length_m, width_m, height_m]) if is_placed else None,
        ),
    )


def _T_cam_obj(bottom_m: Sequence[float], height_m: float, rotation_y_rad: float) -> SE3:
    """Pose of the middle: forward, left and up as columns; up is against the camera's y."""
    cosine, sine = math.cos(rotation_y_rad), math.sin(rotation_y_rad)
    R_cam_obj = np.array([[cosine, sine, 0.0], [0.0, 0.0, -1.0], [-sine, cosine, 0.0]])
    return SE3(R_cam_obj, np.array([bottom_m[0], bottom_m[1] - 0.5 * height_m, bottom_m[2]]))
