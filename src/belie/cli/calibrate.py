"""``belie calibrate``: settings from attack-free driving."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from belie.cli.damage import tell_damage
from belie.cli.detection_warnings import tell_detections
from belie.cli.options import (
    CameraInfo,
    ConfigFile,
    DetectorLabels,
    DetectorModel,
    DetectorThreads,
    FalseAlarms,
    Image,
    Imu,
    Odometry,
    Position,
    Profile,
    Rate,
)
from belie.cli.own_detector import with_own_detector

_MOST_PASSES = 10  # of the whole, at most: the learning passes read two thirds


def calibrate(
    sources: Annotated[
        list[Path],
        typer.Argument(metavar="SOURCE...", help="Recordings of attack-free driving.", show_default=False),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="belie.toml", help="Where to write the settings.")
    ],
    force: Annotated[bool, typer.Option("--force", help="Overwrite the settings file.")] = False,
    profile: Profile = None,
    config: ConfigFile = None,
    false_alarms_per_hour: FalseAlarms = None,
    image: Image = None,
    camera_info: CameraInfo = None,
    odometry: Odometry = None,
    position: Position = None,
    imu: Imu = None,
    detections: Annotated[
        list[str] | None,
        typer.Option(
            "--detections",
            metavar="TOPIC|FILE",
            help="Object detections: a topic, 'none', or files (see 'belie check'), one for each SOURCE, in order.",
        ),
    ] = None,
    detector: DetectorModel = None,
    detector_labels: DetectorLabels = None,
    detector_threads: DetectorThreads = 2,
    rate: Rate = None,
) -> None:
    """Learn how noisy your streams are from attack-free driving, and write it as settings.

    Learned are the noise of odometry and IMU, how often your object detector misses and misnames, and a stated
    rate that the tails of the statistics keep; told are clock offsets and correlations. The first two thirds of
    each recording teach; the last third is checked with the outcome, and must raise no alert. Recordings that
    raise alerts as they are look attacked and are refused. The written file says
    how much driving stands behind it, and which false-alarm rate so much driving can prove.

    \b
    Examples:
      belie calibrate monday.mcap tuesday.mcap -o belie.toml
      belie calibrate drive.mcap --false-alarms-per-hour 0.01 -o belie.toml
      belie calibrate 00 01 --detections 00.txt --detections 01.txt -o belie.toml    a file for each
      belie calibrate drive.mcap --profile paper -o paper.toml    the paper's T1 to T3 instead
      belie check other.mcap --config belie.toml
    """  # noqa: D301 (\b keeps the lines of the examples)
    from belie.cli.progress import frame_count, progress
    from belie.cli.settings import config_from_flags
    from belie.evaluation.calibrate import calibrate as learn_from
    from belie.evaluation.config_toml import to_toml
    from belie.recordings import open_recording
    from belie.types import ConfigError

    if output.exists() and not force:
        raise ConfigError(f"{output} exists already; --force overwrites it")
    settings = config_from_flags(config, profile, false_alarms_per_hour)
    recordings = [
        open_recording(
            source,
            image=image,
            camera_info=camera_info,
            odometry=odometry,
            position=position,
            imu=imu,
            detections=told,
            detection_names=detector_labels,
            rate_hz=rate,
        )
        for source, told in zip(sources, _of_each(detections or [], len(sources)), strict=True)
    ]
    recordings = [
        with_own_detector(recording, detector, detector_labels, detector_threads, remember=True)
        for recording in recordings
    ]
    frames = sum(frame_count(recording) for recording in recordings)
    with progress("calibrating", frames * _MOST_PASSES) as advance:
        found = learn_from(recordings, settings, on_frame=advance)
    for recording in recordings:
        tell_damage(recording)
        tell_detections(recording)
    words = found.words()
    header = "\n".join(
        ["Settings of belie, made by belie calibrate from:", *(f"  {s}" for s in sources), *words]
    )
    output.write_text(to_toml(found.config, notes=found.notes, header=header), encoding="utf-8")
    for line in [*words, *found.set_words()]:
        print(line)
    print(f"wrote {output}; now: belie check SOURCE --config {output}")


def _of_each(detections: list[str], sources: int) -> list[str | None]:
    """What `--detections` says of each source; a file is about one recording.

    >>> _of_each([], 2), _of_each(["/boxes"], 2), _of_each(["a.csv", "b.csv"], 2)
    ([None, None], ['/boxes', '/boxes'], ['a.csv', 'b.csv'])
    """
    from belie.types import ConfigError

    if len(detections) == sources:
        return [*detections]
    if len(detections) > 1 or any(Path(each).is_file() for each in detections):
        raise ConfigError(
            f"--detections {' '.join(detections)}: {len(detections)} for {sources} recordings, a file is about one: "
            "give --detections once for each SOURCE, in their order"
        )
    return [next(iter(detections), None)] * sources
