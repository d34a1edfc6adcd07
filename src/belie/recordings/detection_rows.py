"""Rows of a detections file, and what they come to on the frames of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel, clipped_box_px
from belie.recordings.trajectory import numbers_of
from belie.types import Detection, DetectionClaim, RecordingError

DETECTIONS_SOURCE = "/detections"
_SAME_TIME = 0.1  # of a frame's period: times in text are rounded


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionRow:
    """One line of a detections file.

    Parameters
    ----------
    line : int
        Its number in the file, from 1.
    frame : int or None
        Number of the frame, from 0; None where `stamp_ns` tells the time.
    stamp_ns : int or None
        Time, on the clock of the images.
    detection : Detection or None
        What was seen; None says that the frame was looked at, no more.
    """

    line: int
    frame: int | None = None
    stamp_ns: int | None = None
    detection: Detection | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionTable:
    """A detections file as it was read.

    Parameters
    ----------
    path : Path
        Where it is.
    kind : str
        Its format, in words.
    rows : tuple of DetectionRow
        In the order of the file.
    """

    path: Path
    kind: str
    rows: tuple[DetectionRow, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FramedDetections:
    """The claims of a file on the frames of a recording, and what was left out of them.

    Parameters
    ----------
    claims : tuple of DetectionClaim
        In the order of their stamps.
    outside : int
        Boxes that have no area inside the image.
    repeated : int
        Rows that say again what another row of the frame says.
    warnings : tuple of str
        What was left out and what to do about it, a line each.
    """

    claims: tuple[DetectionClaim, ...]
    outside: int = 0
    repeated: int = 0
    warnings: tuple[str, ...] = ()


def on_frames(
    table: DetectionTable, stamps_ns: npt.NDArray[np.int64], model: CameraModel, T_cam_file: SE3 | None = None
) -> FramedDetections:
    """Put the rows of a file on a recording's frames.

    Numbered frames are counted through the recording's, from 0; between the first and the last of the file, one without
    a row is an empty claim: the detector saw nothing. Times within a tenth of a frame's period of a frame are
    that frame's; where consecutive frames are the rule, those without a row are empty claims too, for a slower
    detector is not asked between its messages.

    Boxes are clipped to the image; what lies wholly outside, or is empty, is left out and counted. So is a row that
    says again what another row of its frame says.

    Parameters
    ----------
    stamps_ns : array (N,)
        Of the recording's frames, ascending.
    model : CameraModel
        Its camera.
    T_cam_file : SE3, optional
        Maps the file's camera axes to those of the camera; None where they are the same.

    Raises
    ------
    RecordingError
        Names the first line whose frame or time the recording does not have.

    Examples
    --------
    >>> camera = CameraModel(width=64, height=48, fx=60, fy=60, cx=31.5, cy=23.5)
    >>> car = Detection(label="car", score=1.0, box_px=[-5, 0, 9, 9])
    >>> rows = (DetectionRow(line=1, frame=0, detection=car), DetectionRow(line=2, frame=2, detection=car))
    >>> table = DetectionTable(path=Path("boxes.csv"), kind="CSV", rows=rows)
    >>> [(c.stamp_ns, len(c.detections)) for c in on_frames(table, np.array([10, 20, 30]), camera).claims]
    [(10, 1), (20, 0), (30, 1)]
    """
    found: dict[int, list[Detection]] = {}
    known: set[tuple[object, ...]] = set()
    outside: list[DetectionRow] = []
    repeated: list[DetectionRow] = []
    for row in table.rows:
        stamp_ns = _time_ns(table, row, stamps_ns)
        seen = found.setdefault(stamp_ns, [])
        if row.detection is None:
            continue
        said = (stamp_ns, *_content(row.detection))
        if said in known:
            repeated.append(row)
            continue
        known.add(said)
        detection = _inside(row.detection, model)
        if detection is None:
            outside.append(row)
        else:
            seen.append(detection if T_cam_file is None else _moved(detection, T_cam_file))
    for stamp_ns in _looked_at(table, sorted(found), stamps_ns):
        found.setdefault(stamp_ns, [])
    claims = tuple(
        DetectionClaim(
            source=DETECTIONS_SOURCE,
            stamp_ns=stamp_ns,
            received_ns=stamp_ns,
            detections=tuple(found[stamp_ns]),
        )
        for stamp_ns in sorted(found)
    )
    size = f"{model.width}x{model.height} px"
    told = (
        (
            outside,
            f"have no area inside the image of {size}",
            "give left, top, right, bottom edges in pixels of these very images",
        ),
        (repeated, "stand in the file more than once", "write one row for each object of a frame"),
    )
    of = sum(row.detection is not None for row in table.rows)
    return FramedDetections(
        claims=claims,
        outside=len(outside),
        repeated=len(repeated),
        warnings=tuple(
            f"{table.path}: {len(rows)} of {of} boxes {what} (first in line {rows[0].line}) and are left out; {advice}"
            for rows, what, advice in told
            if rows
        ),
    )


def _content(detection: Detection) -> tuple[object, ...]:
    """All that a detection says, to compare it by."""
    arrays = (detection.box_px, detection.position_m, detection.dimensions_m)
    numbers = (None if array is None else tuple(array.tolist()) for array in arrays)
    return (detection.label, detection.track_id, detection.score, *numbers)


def _time_ns(table: DetectionTable, row: DetectionRow, stamps_ns: npt.NDArray[np.int64]) -> int:
    where, count = f"{table.path}, line {row.line}", len(stamps_ns)
    if row.frame is not None:
        if not 0 <= row.frame < count:
            raise RecordingError(f"{where}: frame {row.frame} (from 0), but the recording has {count} frames")
        return int(stamps_ns[row.frame])
    assert row.stamp_ns is not None
    period_ns = float(np.median(np.diff(stamps_ns))) if count > 1 else 1e9
    first, last = int(stamps_ns[0]), int(stamps_ns[-1])
    if not first - period_ns <= row.stamp_ns <= last + period_ns:
        raise RecordingError(
            f"{where}: {row.stamp_ns / 1e9:.6f} s, but the frames run from {first / 1e9:.6f} to {last / 1e9:.6f} s"
        )
    nearest = int(stamps_ns[_nearest(stamps_ns, row.stamp_ns)])
    return nearest if abs(nearest - row.stamp_ns) <= _SAME_TIME * period_ns else row.stamp_ns


def _nearest(stamps_ns: npt.NDArray[np.int64], stamp_ns: int) -> int:
    return int(np.argmin(np.abs(stamps_ns - stamp_ns)))


def _looked_at(
    table: DetectionTable, found_ns: Sequence[int], stamps_ns: npt.NDArray[np.int64]
) -> Sequence[int]:
    """Stamps of the frames that the detector must have looked at."""
    if not found_ns:
        return ()
    frames = [_nearest(stamps_ns, stamp_ns) for stamp_ns in (found_ns[0], found_ns[-1])]
    if table.rows[0].frame is None:
        at_frames = np.searchsorted(stamps_ns, found_ns)
        is_exact = np.isin(np.array(found_ns, dtype=np.int64), stamps_ns).all()
        if not is_exact or len(found_ns) < 2 or (np.diff(at_frames) == 1).mean() < 0.5:
            return ()
    looked: list[int] = stamps_ns[frames[0] : frames[1] + 1].tolist()
    return looked


def _inside(detection: Detection, model: CameraModel) -> Detection | None:
    if detection.box_px is None:
        return detection
    box_px = clipped_box_px(detection.box_px, model)
    return None if box_px is None else replace(detection, box_px=box_px)


def _moved(detection: Detection, T_cam_file: SE3) -> Detection:
    if detection.T_cam_obj is not None:
        T_cam_obj = T_cam_file @ detection.T_cam_obj
        return replace(detection, T_cam_obj=T_cam_obj, position_m=T_cam_obj.t)
    if detection.position_m is not None:
        return replace(detection, position_m=T_cam_file.apply(detection.position_m[None])[0])
    return detection


def whole(path: Path, line: int, text: str, what: str) -> int:
    """A whole number of a row, which may be written ``7.0``.

    Raises
    ------
    RecordingError
        Names file and line.

    Examples
    --------
    >>> whole(Path("boxes.txt"), 3, "7", "a frame number")
    7
    """
    (value,) = numbers_of(path, line, [text], what)
    if value != int(value):
        raise RecordingError(f"{path}, line {line}: expected {what}, found {text!r}")
    return int(value)


def ordered_box_px(path: Path, line: int, edges: Sequence[float]) -> list[float]:
    """Left, top, right, bottom of a row, in order.

    Raises
    ------
    RecordingError
        Where right lies left of left, or bottom above top; names file and line.

    Examples
    --------
    >>> ordered_box_px(Path("boxes.txt"), 3, [5.0, 2.0, 9.0, 4.0])
    [5.0, 2.0, 9.0, 4.0]
    """
    left, top, right, bottom = edges
    if right < left or bottom < top:
        numbers = " ".join(f"{edge:g}" for edge in edges)
        amiss = "right is less than left" if right < left else "bottom is less than top"
        raise RecordingError(
            f"{path}, line {line}: expected left, top, right, bottom, found {numbers}: {amiss}; "
            "where the last two are width and height, add left and top to them"
        )
    return [left, top, right, bottom]


def score_of(value: float) -> float:
    """A score between 0 and 1: detectors that score beyond are as sure, or as unsure, as can be.

    >>> score_of(7.5), score_of(-0.2)
    (1.0, 0.0)
    """
    return min(max(value, 0.0), 1.0)
