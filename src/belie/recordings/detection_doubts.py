"""What can be read in a file of detections, and can hardly be meant: other units of its boxes or its times."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from belie.geometry import CameraModel
from belie.recordings.detection_rows import DetectionTable

_NORMALISED_PX = 2.0  # shares of an image's sides lie below, boxes that a detector sees do not
_UNITS = (
    ("seconds", 10**9),
    ("milliseconds", 10**6),
    ("microseconds", 10**3),
)  # ns; the largest that fits is meant


def doubts(table: DetectionTable, stamps_ns: npt.NDArray[np.int64], model: CameraModel) -> tuple[str, ...]:
    """A line for each, with what to do; none where all seems well.

    Parameters
    ----------
    stamps_ns : array (N,)
        Of the recording's frames, ascending.

    Examples
    --------
    >>> from pathlib import Path
    >>> from belie.recordings.detection_rows import DetectionRow
    >>> from belie.types import Detection
    >>> car = Detection(label="car", score=1.0, box_px=[0.1, 0.2, 0.5, 0.9])
    >>> table = DetectionTable(path=Path("boxes.csv"), kind="CSV", rows=(DetectionRow(line=2, frame=0, detection=car),))
    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> [line.partition(";")[0] for line in doubts(table, np.array([10, 20]), camera)]
    ['boxes.csv: its 1 boxes all lie within 2 px of the corner of the image of 640x480 px']
    """
    return tuple(filter(None, (_normalised(table, model), _in_one_frame(table, stamps_ns))))


def _normalised(table: DetectionTable, model: CameraModel) -> str:
    boxes_px = [
        row.detection.box_px
        for row in table.rows
        if row.detection is not None and row.detection.box_px is not None
    ]
    if not boxes_px or np.abs(boxes_px).max() > _NORMALISED_PX:
        return ""
    return (
        f"{table.path}: its {len(boxes_px)} boxes all lie within {_NORMALISED_PX:g} px of the corner of the image of "
        f"{model.width}x{model.height} px; if edges are told as shares from 0 to 1, multiply left and right by "
        f"{model.width}, top and bottom by {model.height}"
    )


def _in_one_frame(table: DetectionTable, stamps_ns: npt.NDArray[np.int64]) -> str:
    """That rows of many times fall on one frame."""
    told_ns = sorted({row.stamp_ns for row in table.rows if row.stamp_ns is not None})
    if len(told_ns) < 2 or len(stamps_ns) < 2:
        return ""
    first, last = told_ns[0], told_ns[-1]
    period_ns = float(np.median(np.diff(stamps_ns)))
    if last - first >= period_ns:
        return ""
    fitting = (name for name, unit in _UNITS if last * unit <= stamps_ns[-1] + period_ns)
    meant = next(fitting, None)
    advice = "check the column's unit" if meant is None else f"if they are {meant}, write them as nanoseconds"
    return (
        f"{table.path}: its {len(told_ns)} times all lie within {(last - first) * 1e-9:.6f} s, less than from one "
        f"frame to the next ({period_ns * 1e-9:.3f} s); {advice}, or number the frames"
    )
