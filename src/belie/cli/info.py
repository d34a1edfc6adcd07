"""``belie info``: what is in a recording, what would be checked, and what is missing."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from belie.cli.detection_warnings import tell_detections
from belie.cli.options import (
    CameraInfo,
    Detections,
    DetectorLabels,
    DetectorModel,
    DetectorThreads,
    Image,
    Imu,
    Odometry,
    Position,
    Rate,
    Source,
)
from belie.cli.own_detector import with_own_detector

if TYPE_CHECKING:
    from belie.evaluation.told_objects import ToldObjects
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
    detector: DetectorModel = None,
    detector_labels: DetectorLabels = None,
    detector_threads: DetectorThreads = 2,
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
    from belie.checks.objects.class_groups import ClassGroups
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
    recording = with_own_detector(recording, detector, detector_labels, detector_threads)
    print(f"{recording.path} ({recording.format})")
    info_table.print_streams(recording.streams)
    info_table.print_cameras(recording)
    info_table.print_use(recording)
    joined, unjudged, told = _join(recording, None if whole else _SCANNED_FRAMES)
    info_table.print_join_warnings(recording, joined)
    for line in unjudged:
        print(line)
    for stream in told:
        print(f"  {stream.in_words()}")
    tell_detections(recording, told, ClassGroups())


def _join(recording: Recording, limit: int | None) -> tuple[int, list[str], tuple[ToldObjects, ...]]:
    """Join the first frames, so that what goes wrong is counted.

    How many, what 'belie check' cannot judge, and what object detectors told.
    """
    from contextlib import closing

    from belie.cli.progress import frame_count, progress
    from belie.detector.streams import StreamKey, Streams
    from belie.evaluation.told_objects import ToldObjectsRecorder
    from belie.geometry import SE3

    total, joined = frame_count(recording), 0
    streams, start_ns, told = Streams(), None, set[StreamKey]()
    objects = ToldObjectsRecorder()
    with (
        progress("joining", min(total, limit or total)) as advance,
        closing(recording.steps()) as steps,  # type: ignore[type-var]
    ):
        for step in steps:
            stamp_ns = step.frame.stamp_ns
            streams.take(step.claims, stamp_ns)
            objects.hear(step.claims)
            motions = streams.motions(start_ns, stamp_ns, SE3.identity())
            told.update(key for key, T_prev_cur in motions.items() if T_prev_cur is not None)
            start_ns = stamp_ns
            joined += 1
            advance()
            if joined == limit:
                break
    untold = [key for key in streams.motion_streams() if key not in told]
    lines = [f"  not judged: {key[1]}: {why}" for key in untold if (why := streams.why_unknown(key))]
    return joined, list(dict.fromkeys(lines)), objects.finish()


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
