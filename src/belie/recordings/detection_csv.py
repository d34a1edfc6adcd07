"""Detections as CSV: a header, then one object a line.

``frame`` (from 0), ``stamp_ns`` or ``stamp_s``: when, on the clock of the images; exactly one of the three. ``label``,
and ``left``, ``top``, ``right``, ``bottom``: pixel edges (the whole image is 0, 0, width, height). May be added, in any
order: ``track_id``, ``score`` (0 to 1), ``x``, ``y``, ``z``: the object's middle in camera axes (x right, y down, z
forward) [m], ``length``, ``width``, ``height`` [m]. A cell may be empty where a value is not known; a line with nothing
but its frame (or time) says that nothing was seen there.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from belie.geometry import FloatArray
from belie.recordings.detection_rows import DetectionRow, DetectionTable, ordered_box_px, whole
from belie.recordings.trajectory import nanoseconds, numbers_of, rows_of
from belie.types import Detection, RecordingError

_WHEN = ("frame", "stamp_ns", "stamp_s")
_BOX = ("left", "top", "right", "bottom")
_PLACE = ("x", "y", "z")
_SIZE = ("length", "width", "height")
_EDGES_AS_SIZE = ("left", "top", "width", "height")
_COLUMNS = (*_WHEN, "track_id", "label", "score", *_BOX, *_PLACE, *_SIZE)


def is_detection_csv(fields: Sequence[str]) -> bool:
    """Whether the fields of the first line are a header: a column that we know is among them.

    >>> is_detection_csv(["frame", "label", "left", "top", "right", "bottom"])
    True
    """
    return any(name in _COLUMNS for name in fields)


def read_detection_csv(path: Path) -> DetectionTable:
    r"""Read a CSV file of detections.

    Raises
    ------
    RecordingError
        Names the first line that is malformed.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "b.csv").write_text("stamp_s,label,left,top,right,bottom\n0.1,car,1,2,3,4\n0.2,,,,,\n")
    ...     rows = read_detection_csv(Path(folder) / "b.csv").rows
    >>> [(row.stamp_ns, row.detection is None) for row in rows]
    [(100000000, False), (200000000, True)]
    """
    lines = _lines(path)
    number, header = next(lines)
    _check_header(path, number, header)
    rows = tuple(_row(path, line, header, fields) for line, fields in lines)
    if not rows:
        raise RecordingError(
            f"{path} holds a header and no detection; leave it out, or say that nothing was seen by lines with nothing "
            "but their frame or time"
        )
    return DetectionTable(path=path, kind="CSV", rows=rows)


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each line; a cell in quotes may hold commas."""
    for number, (line,) in rows_of(path, separator="\n"):
        try:
            (cells,) = csv.reader([line], skipinitialspace=True, strict=True)
        except csv.Error as error:
            raise RecordingError(f"{path}, line {number}: {error}; check its quotes") from error
        yield number, [cell.strip() for cell in cells]


def _check_header(path: Path, line: int, header: list[str]) -> None:
    unknown = [name for name in header if name not in _COLUMNS]
    if unknown:
        known = ", ".join(_COLUMNS)
        raise RecordingError(f"{path}, line {line}: no column is called {unknown[0]!r}; known are {known}")
    if len(set(header)) < len(header):
        raise RecordingError(f"{path}, line {line}: a column stands there twice")
    when = [name for name in _WHEN if name in header]
    if len(when) != 1:
        raise RecordingError(
            f"{path}, line {line}: expected one column of {', '.join(_WHEN)}, found {len(when)}"
        )
    if "label" not in header:
        raise RecordingError(f"{path}, line {line}: the column label is missing")
    if not {*_EDGES_AS_SIZE} - {*header} and "right" not in header:
        raise RecordingError(
            f"{path}, line {line}: found {', '.join(_EDGES_AS_SIZE)}; give edges: right is left + width, bottom is "
            "top + height"
        )
    for group in (_BOX, _PLACE, _SIZE):
        missing = [name for name in group if name not in header]
        if missing and (len(missing) < len(group)):
            raise RecordingError(f"{path}, line {line}: the column {missing[0]} is missing")
    if _BOX[0] not in header and _PLACE[0] not in header:
        raise RecordingError(
            f"{path}, line {line}: expected the columns {', '.join(_BOX)} or {', '.join(_PLACE)}"
        )


def _row(path: Path, line: int, header: list[str], fields: list[str]) -> DetectionRow:
    if len(fields) != len(header):
        raise RecordingError(
            f"{path}, line {line}: expected the {len(header)} fields of the header, found {len(fields)}"
        )
    cells = {name: text for name, text in zip(header, fields, strict=True) if text}
    frame, stamp_ns = _time(path, line, cells)
    said = [name for name in cells if name not in _WHEN]
    if not said:
        return DetectionRow(line=line, frame=frame, stamp_ns=stamp_ns)
    if "label" not in cells:
        raise RecordingError(
            f"{path}, line {line}: {said[0]} without a label; leave the other cells empty, too, for none"
        )
    box = _group(path, line, cells, _BOX)
    position_m, dimensions_m = _group(path, line, cells, _PLACE), _group(path, line, cells, _SIZE)
    if box is None and position_m is None:
        raise RecordingError(f"{path}, line {line}: {cells['label']!r} has neither a box nor a place x, y, z")
    if dimensions_m is not None and (dimensions_m <= 0.0).any():
        raise RecordingError(f"{path}, line {line}: expected length, width and height above 0")
    score = numbers_of(path, line, [cells.get("score", "1")], "a score from 0 to 1")[0]
    if not 0.0 <= score <= 1.0:
        raise RecordingError(f"{path}, line {line}: expected a score from 0 to 1, found {score:g}")
    return DetectionRow(
        line=line,
        frame=frame,
        stamp_ns=stamp_ns,
        detection=Detection(
            label=cells["label"],
            score=score,
            track_id=cells.get("track_id", ""),
            box_px=None if box is None else np.array(ordered_box_px(path, line, box.tolist())),
            position_m=position_m,
            dimensions_m=dimensions_m,
        ),
    )


def _time(path: Path, line: int, cells: dict[str, str]) -> tuple[int | None, int | None]:
    """Frame and stamp; one of them is None."""
    name = next((name for name in _WHEN if name in cells), None)
    match name:
        case "frame":
            return whole(path, line, cells[name], "a frame number"), None
        case "stamp_ns" if cells[name].isdigit():
            return None, int(cells[name])
        case "stamp_s":
            try:
                return None, nanoseconds(cells[name])
            except ValueError as error:
                raise RecordingError(f"{path}, line {line}: {error}") from error
    raise RecordingError(
        f"{path}, line {line}: expected a frame number, or a time in whole nanoseconds or seconds"
    )


def _group(path: Path, line: int, cells: dict[str, str], names: tuple[str, ...]) -> FloatArray | None:
    """The numbers of cells that belong together; None where all are empty."""
    given = [cells[name] for name in names if name in cells]
    if not given:
        return None
    expected = ", ".join(names)
    if len(given) < len(names):
        raise RecordingError(f"{path}, line {line}: expected {expected}, all or none of them")
    return np.array(numbers_of(path, line, given, f"the numbers {expected}"))
