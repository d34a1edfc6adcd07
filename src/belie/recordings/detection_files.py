"""A file of detections beside a recording: its format is recognised from its contents."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

from belie.recordings.detection_csv import is_detection_csv, read_detection_csv
from belie.recordings.detection_rows import DetectionTable
from belie.recordings.kitti_labels import is_kitti_labels, is_kitti_object_labels, read_kitti_labels
from belie.recordings.mot import is_mot, read_mot
from belie.recordings.trajectory import rows_of
from belie.types import RecordingError

_READ = (
    "belie reads KITTI tracking labels, MOT text, and CSV with a header "
    "(frame,track_id,label,score,left,top,right,bottom)"
)
_LEAST_COLUMNS = 5  # time, label and box, fewer than which no table of boxes can have


def read_detections(path: Path, *, names: Path | None = None) -> DetectionTable:
    r"""Read KITTI tracking labels, MOT text, or a CSV file with a header.

    Parameters
    ----------
    names : Path, optional
        Names of MOT's classes, one a line, the first for class 1.

    Raises
    ------
    RecordingError
        If it is none of these, or a line of it is malformed.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "det.txt").write_text("1,-1,794.2,247.5,71.2,174.8,0.9,-1,-1,-1\n")
    ...     read_detections(Path(folder) / "det.txt").kind
    'MOT text'
    """
    try:
        return _read(path, names)
    except RecordingError as error:
        if isinstance(error.__cause__, UnicodeDecodeError):
            raise RecordingError(f"{error}; {_READ}") from error
        raise


def _read(path: Path, names: Path | None) -> DetectionTable:
    for _, line in islice(rows_of(path, separator="\n"), 1):
        if line[0].startswith(("{", "[")):
            what = "COCO's JSON" if '"image_id"' in line[0] or '"annotations"' in line[0] else "JSON"
            raise RecordingError(
                f"{path} is {what}; docs/detection-files.md shows how three lines of Python make a CSV file of it; "
                f"{_READ}"
            )
        separated = [field.strip(' "') for field in line[0].split(",")]
        if is_detection_csv(separated):
            return read_detection_csv(path)
        if is_mot(separated):
            return read_mot(path, None if names is None else dict(enumerate(read_names(names), start=1)))
        if is_kitti_labels(line[0].split()):
            return read_kitti_labels(path)
        raise RecordingError(f"{path} {_what_it_is(line[0])}; {_READ}")
    raise RecordingError(f"{path} is empty; {_READ}")


def _what_it_is(line: str) -> str:
    """What a file seems to be that is no format of ours, by its first line."""
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if is_detection_csv([field.strip(' "') for field in line.split(separator)]):
            return f"separates its columns by {name}; write it with commas (and points in numbers)"
    if is_kitti_object_labels(line.split()):
        return (
            "holds KITTI's object labels (15 fields, no frame and no track id); put both before each line, as "
            "tracking labels have them (17 fields)"
        )
    if line.count(",") >= _LEAST_COLUMNS:
        return f"has no header: it starts with {line[:60]!r}; name its columns in the first line"
    return f"holds no detections that belie knows: it starts with {line[:60]!r}"


def read_names(path: Path) -> tuple[str, ...]:
    r"""Names of classes, one a line.

    Raises
    ------
    RecordingError
        If there are none.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "names.txt").write_text("person\nbicycle\ntraffic light\n")
    ...     read_names(Path(folder) / "names.txt")
    ('person', 'bicycle', 'traffic light')
    """
    names = tuple(fields[0] for _, fields in rows_of(path, separator="\n"))
    if not names:
        raise RecordingError(f"{path} holds no names; expected one a line")
    return names
