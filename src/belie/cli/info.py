"""``belie info``: what is in a recording, what would be checked, and what is missing."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from belie.cli.options import (
    CameraInfo,
    Detections,
    DetectorLabels,
    Image,
    Imu,
    Odometry,
    Position,
    Rate,
    Source,
)

if TYPE_CHECKING:
    from belie.recordings import Recording, StreamInfo

_SCANNED_FRAMES = 200


def info(
    source: Source,
    whole: Annotated[
        bool,
        typer.Option("--all", help=f"Join all frames for the warnings, not the first {_SCANNED_FRAMES}."),
    ] = False,
    image: Image = None,
    camera_info: CameraInfo = None,
    odometry: Odometry = None,
    position: Position = None,
    imu: Imu = None,
    detections: Detections = None,
    detector_labels: DetectorLabels = None,
    rate: Rate = None,
) -> None:
    """Show a recording's streams (types, rates, spans, gaps), its camera, and what 'belie check' would use.

    A bag that cannot be checked as it stands is listed all the same, with what is missing on the last line.

    \b
    Examples:
      belie info drive.mcap
      belie info bag/ --image /front/image_raw    try a choice of topics before a long check
      belie info kitti/00 --all                   read it all: late, missing and out-of-order messages
    """  # noqa: D301 (\b keeps the lines of the examples)
    from belie.cli import info_table
    from belie.recordings import open_recording
    from belie.types import RecordingError

    try:
        recording = open_recording(
            source,
            image=image,
            camera_info=camera_info,
            odometry=odometry,
            position=position,
            imu=imu,
            detections=detections,
            detection_names=detector_labels,
            rate_hz=rate,
        )
    except RecordingError:
        info_table.print_streams(list_topics(source))
        raise
    print(f"{recording.path} ({recording.format})")
    info_table.print_streams(recording.streams)
    info_table.print_cameras(recording)
    info_table.print_use(recording)
    joined = _join(recording, None if whole else _SCANNED_FRAMES)
    info_table.print_join_warnings(recording, joined)


def _join(recording: Recording, limit: int | None) -> int:
    """Join the first frames, so that what goes wrong in it is counted; returns how many."""
    from contextlib import closing

    from belie.cli.progress import frame_count, progress

    total, joined = frame_count(recording), 0
    with (
        progress("joining", min(total, limit or total)) as advance,
        closing(recording.steps()) as steps,  # type: ignore[type-var]
    ):
        for _ in steps:
            joined += 1
            advance()
            if joined == limit:
                break
    return joined


def list_topics(source: Path) -> tuple[StreamInfo, ...]:
    """The topics of a bag that cannot be opened as a recording; none where it is no bag, or a damaged one.

    >>> list_topics(Path("no/such/file.mcap"))
    ()
    """
    from belie.recordings import StreamInfo
    from belie.recordings.storage import BagFormat, opened
    from belie.recordings.topics import Topic
    from belie.types import RecordingError

    for format in get_args(BagFormat):
        with suppress(RecordingError, OSError), opened(source, format) as bag:
            types = sorted({(c.topic, c.msgtype) for c in bag.connections})
            return tuple(
                StreamInfo.from_times(
                    name,
                    Topic(name=name, message_type=message_type, count=1).role,
                    message_type,
                    bag.receive_times_ns(name),
                    used=False,
                )
                for name, message_type in types
            )
    return ()
