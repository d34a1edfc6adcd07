"""What was attacked, and when: the truth that `belie.evaluation` scores against."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, TypeAdapter, ValidationError

from belie.types import AlertType, RecordingError

FORMAT = "belie-attack-labels"
VERSION = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackLabel:
    """One attack on one recording.

    Parameters
    ----------
    name, text : str
        The attack's name, and the specification it was made from.
    stream : str
        ``odometry``, ``imu``, ``position``, ``camera`` or ``detections``.
    sources : tuple of str
        The topics that lie.
    alert : AlertType
        The alert that a detector should raise.
    start_frame, stop_frame : int
        Attacked frames; the second is exclusive.
    start_ns : int
        Stamp of `start_frame`: messages stamped before it are honest.
    onset_ns : int
        Stamp of the first message that lies.
    end_ns : int
        Stamp of `stop_frame`, the first honest one again; of the last frame, where there is none. An attack on an
        object that is told of no more ends with that.
    seed : int
        Of everything random.
    object : str or None
        Track id of the attacked object as the stream before this attack names it; for a phantom the phantom's. None
        for other streams, where the detector gives no ids, and where all objects are attacked.
    other : str or None
        The second object of a swap.

    Examples
    --------
    >>> label = AttackLabel(name="camera-black", text="camera-black", stream="camera", sources=("/image",),
    ...                     alert="camera_fault", start_frame=1, stop_frame=2, start_ns=5, onset_ns=5,
    ...                     end_ns=6, seed=0)
    >>> label.alert
    <AlertType.CAMERA_FAULT: 'camera_fault'>
    """

    name: str
    text: str
    stream: str
    sources: tuple[str, ...]
    alert: AlertType
    start_frame: int
    stop_frame: int
    start_ns: int
    onset_ns: int
    end_ns: int
    seed: int
    object: str | None = None
    other: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "alert", AlertType(self.alert))
        object.__setattr__(self, "sources", tuple(self.sources))
        if not self.start_ns <= self.onset_ns <= self.end_ns:
            raise ValueError(
                f"start {self.start_ns}, onset {self.onset_ns}, end {self.end_ns} are out of order"
            )

    def about(self, kind: str = "") -> str:
        """The objects that it names, both of a swap; empty where it names none. `kind`: what the first one is.

        >>> label = AttackLabel(name="detections-swap", text="detections-swap", stream="detections", sources=("/d",),
        ...     alert="object_misclassification", start_frame=1, stop_frame=2, start_ns=5, onset_ns=5, end_ns=6, seed=0,
        ...     object="7", other="3")
        >>> label.about()
        'objects 7 and 3'
        """
        if self.object is None:
            return ""
        first = f"{kind or ('object' if self.other is None else 'objects')} {self.object}"
        return first if self.other is None else f"{first} and {self.other}"


AttackLabel.__pydantic_config__ = ConfigDict(extra="forbid")  # type: ignore[attr-defined]


def labels_path(recording: Path | str) -> Path:
    """Where the labels of an attacked recording lie: beside it.

    >>> labels_path("out.mcap").name
    'out.mcap.labels.json'
    """
    path = Path(recording)
    return path.with_name(f"{path.name}.labels.json")


def write_labels(path: Path | str, labels: Iterable[AttackLabel]) -> None:
    """Write labels as JSON.

    Raises
    ------
    RecordingError
        Where the file cannot be written.
    """
    document = {"format": FORMAT, "version": VERSION, "labels": [asdict(label) for label in labels]}
    try:
        Path(path).write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"cannot write labels to {path}: {error.strerror}") from None


def read_labels(path: Path | str) -> tuple[AttackLabel, ...]:
    """Read labels that `write_labels` wrote.

    Raises
    ------
    RecordingError
        On a missing file, other JSON, another version or a malformed label, in one line.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_labels(f"{folder}/out.mcap.labels.json", [])
    ...     read_labels(f"{folder}/out.mcap.labels.json")
    ()
    """
    try:
        document: Any = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise RecordingError(f"cannot read labels from {path}: {error.strerror}") from None
    except ValueError:
        raise RecordingError(f"{path} is not JSON; expected labels written by 'belie attack'") from None
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise RecordingError(f"{path} holds no attack labels; expected a file written by 'belie attack'")
    if document.get("version") != VERSION:
        raise RecordingError(
            f"{path} has label format version {document.get('version')!r}, this belie reads {VERSION}: "
            "write the labels again with 'belie attack'"
        )
    try:
        return TypeAdapter(tuple[AttackLabel, ...]).validate_python(document.get("labels"))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in ("labels", *first["loc"]))
        raise RecordingError(f"{path}: malformed label, {where}: {first['msg']}") from None
