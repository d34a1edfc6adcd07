"""MOTChallenge text: one box a line, separated by commas.

``frame, id, left, top, width, height, conf, class or x, visibility or y[, z]``

Frames and pixels count from 1; an id of -1 means that there is none. Only ground truth (9 fields) tells a class, and
there a ``conf`` of 0 marks what is to be ignored; detections and tracks of MOT are pedestrians.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from belie.recordings.detection_rows import DetectionRow, DetectionTable, score_of, whole
from belie.recordings.trajectory import numbers_of, rows_of
from belie.types import Detection, RecordingError

_EXPECTED = "MOT's frame, id, left, top, width, height, conf and up to three more numbers"
_TRUTH_FIELDS = 9
# MOT16 and later (Milan et al., arXiv:1603.00831, table 3).
MOT_CLASSES = {
    1: "pedestrian",
    2: "person on vehicle",
    3: "car",
    4: "bicycle",
    5: "motorbike",
    6: "non-motorised vehicle",
    7: "static person",
    8: "distractor",
    9: "occluder",
    10: "occluder on the ground",
    11: "full occluder",
    12: "reflection",
}


def is_mot(fields: Sequence[str]) -> bool:
    """Whether the fields of a line look like MOT's: six to ten numbers.

    >>> is_mot("1,3,794.27,247.59,71.245,174.88,-1,-1,-1,-1".split(","))
    True
    """
    try:
        numbers = [float(field) for field in fields]
    except ValueError:
        return False
    return 6 <= len(numbers) <= 10


def read_mot(path: Path, names: Mapping[int, str] | None = None) -> DetectionTable:
    r"""Read a MOT file.

    Parameters
    ----------
    names : mapping of int to str, optional
        What the classes are called, from 1; those of MOT16 by default.

    Raises
    ------
    RecordingError
        Names the first line that is malformed, or whose class has no name.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "gt.txt").write_text("1,7,11,21,30,40,1,3,0.9\n")
    ...     (row,) = read_mot(Path(folder) / "gt.txt").rows
    >>> row.frame, row.detection.label, row.detection.track_id, row.detection.box_px.tolist()
    (0, 'car', '7', [10.0, 20.0, 40.0, 60.0])
    """
    classes = MOT_CLASSES if names is None else names
    rows = tuple(_row(path, line, fields, classes) for line, fields in rows_of(path, separator=","))
    return DetectionTable(path=path, kind="MOT text", rows=rows)


def _row(path: Path, line: int, fields: list[str], classes: Mapping[int, str]) -> DetectionRow:
    if not 6 <= len(fields) <= 10:
        raise RecordingError(f"{path}, line {line}: expected {_EXPECTED}, found {len(fields)} fields")
    numbers = numbers_of(path, line, fields, _EXPECTED)
    frame, track = (whole(path, line, text, "whole frame and id") for text in fields[:2])
    if frame < 1:
        raise RecordingError(f"{path}, line {line}: frame {frame}, but MOT counts frames from 1")
    left, top, width, height = numbers[2:6]
    if width < 0.0 or height < 0.0:
        raise RecordingError(
            f"{path}, line {line}: expected {_EXPECTED}, found a box of {width:g} x {height:g} px"
        )
    score = numbers[6] if len(numbers) > 6 else 1.0
    is_truth = len(numbers) == _TRUTH_FIELDS
    if is_truth and score == 0.0:
        return DetectionRow(line=line, frame=frame - 1)
    number = int(numbers[7]) if is_truth else 1
    if number not in classes:
        raise RecordingError(
            f"{path}, line {line}: class {number} has no name; there are {len(classes)} names"
        )
    return DetectionRow(
        line=line,
        frame=frame - 1,
        detection=Detection(
            label=classes[number],
            score=score_of(score),
            track_id=str(track) if track >= 0 else "",
            # A box's first pixel is (1, 1).
            box_px=np.array([left - 1.0, top - 1.0, left - 1.0 + width, top - 1.0 + height]),
        ),
    )
