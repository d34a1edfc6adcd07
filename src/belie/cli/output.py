"""How commands write a recording: names are checked first, an old file survives a failure, labels are told."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from belie.attacks import AttackedRecording, AttackLabel, Choice
    from belie.recordings import BodyAxes, GeodeticPoint
    from belie.types import MountedCamera, Step


class Encoding(StrEnum):
    """How images are stored."""

    PNG = "png"
    MONO8 = "mono8"
    JPEG = "jpeg"


def require_free(output: Path, beside: Sequence[Path], *, force: bool) -> None:
    """Refuse a recording that cannot be written as MCAP, or that would overwrite something without `force`.

    Raises
    ------
    RecordingError
        If the name does not end in ``.mcap``, is a folder's, or is taken, or one of those beside it.

    Examples
    --------
    >>> require_free(Path("out.mcap"), [], force=False)
    >>> require_free(Path("out.bag"), [], force=False)
    Traceback (most recent call last):
        ...
    belie.types.errors.RecordingError: -o out.bag: the name must end in .mcap, the format that is written
    """
    from belie.types import RecordingError

    if output.suffix != ".mcap":
        raise RecordingError(f"-o {output}: the name must end in .mcap, the format that is written")
    if output.is_dir():
        raise RecordingError(f"-o {output} is a folder; choose another name")
    taken = [str(path) for path in (output, *beside) if path.exists()]
    if taken and not force:
        exist, them = ("exists", "it") if len(taken) == 1 else ("exist", "them")
        raise RecordingError(f"{' and '.join(taken)} {exist} already; --force overwrites {them}")


def write_recording(
    output: Path,
    steps: Iterable[Step],
    *,
    doing: str,
    frames: int,
    cameras: Mapping[str, MountedCamera],
    body_axes: BodyAxes,
    encoding: Encoding,
    jpeg_quality: int | None = None,
    geodetic_origin: GeodeticPoint | None,
) -> None:
    """Write an MCAP under a progress bar, first under another name: what was there before survives a failure."""
    from belie.cli.progress import progress
    from belie.recordings import write_mcap
    from belie.recordings.messages import JPEG_QUALITY

    partial = output.with_name(f".{output.stem}.partial{output.suffix}")
    partial.unlink(missing_ok=True)
    try:
        with progress(f"{doing} {output.name}", frames) as advance:
            write_mcap(
                partial,
                steps,
                cameras=cameras,
                body_axes=body_axes,
                image_encoding=encoding.value,
                jpeg_quality=JPEG_QUALITY if jpeg_quality is None else jpeg_quality,
                geodetic_origin=geodetic_origin,
                progress=lambda count: advance(),
            )
        partial.replace(output)
    finally:
        partial.unlink(missing_ok=True)


def write_labels(path: Path, attacked: AttackedRecording) -> None:
    """Write the labels of an attacked recording, tell what they say, and warn of attacks that may pass unseen."""
    from belie.attacks import FrameClock
    from belie.attacks import write_labels as write

    labels, stamps_ns = attacked.labels, attacked.frame_stamps_ns()
    write(path, labels)
    clock = FrameClock(stamps_ns)
    for label in labels:
        onset_s = (label.onset_ns - int(stamps_ns[0])) * 1e-9
        sources = ", ".join(label.sources)
        about = f", {named}" if (named := label.about()) else ""
        print(
            f"{label.text}: {sources} lies from {onset_s:.2f} s, frame {clock.nearest(label.onset_ns)} to "
            f"{label.stop_frame}; labelled {label.alert.value}{about}"
        )
    for caution in attacked.cautions:
        print(f"belie: warning: {caution}", file=sys.stderr)


def tell_choices(choices: Sequence[Choice], labels: Sequence[AttackLabel]) -> None:
    """Which objects were chosen, or that none stays."""
    for choice, label in zip(choices, labels, strict=True):
        why = (
            "as it stays in view"
            if choice.stays
            else "as it stays for a while, and none until the attack ends"
        )
        for one in choice.objects:
            width, height = one.size_px
            print(
                f"  object {one.track_id} was chosen, {why}: {one.label}, {width}x{height} px in frame "
                f"{label.start_frame}, told of in frames {one.first_frame} to {one.last_frame}"
            )
        if choice.lacks:
            lacking = (
                "second object, apart from the first,"
                if choice.objects
                else "object with a track id, large enough,"
            )
            print(
                f"belie: warning: {label.text}: no {lacking} stays in view: taken is the largest that is held for a "
                "second, and a lie about what leaves may pass unseen; name one, or try another start",
                file=sys.stderr,
            )
