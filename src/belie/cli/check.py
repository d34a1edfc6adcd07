"""``belie check``: a recording against its own camera."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from belie.cli.damage import tell_damage
from belie.cli.detection_warnings import tell_detections
from belie.cli.errors import ALERT_RAISED, keep_apart
from belie.cli.options import (
    CameraInfo,
    ConfigFile,
    Detections,
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
    Source,
)
from belie.cli.own_detector import with_own_detector

if TYPE_CHECKING:
    from collections.abc import Callable

    from belie.attacks import AttackLabel
    from belie.evaluation.run import Run
    from belie.types import Verdict

STDOUT = Path("-")
_LEAST_UNGROUPED = 0.1  # of the boxes: fewer in no class group are no sign of misnamed classes


def check(
    source: Source,
    profile: Profile = None,
    config: ConfigFile = None,
    json: Annotated[
        Path | None,
        typer.Option(
            "--json",
            metavar="FILE|-",
            help="Write one JSON object a frame; with '-' to stdout, and the table to stderr.",
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="out.html", help="Write one self-contained page that explains all."),
    ] = None,
    labels: Annotated[
        Path | None,
        typer.Option(
            "--labels",
            metavar="FILE",
            help="Score against the labels of 'belie attack': hits, misses, delays.",
        ),
    ] = None,
    false_alarms_per_hour: FalseAlarms = None,
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
    """Check the claims in a recording against its camera, frame by frame.

    Every claim gets one of three answers: consistent, contradicted (an alert), or undecided with the reason.
    Topics are found by message type; where several would do, you are asked to name one.

    \b
    Examples:
      belie check drive.mcap
      belie check drive.mcap --report drive.html
      belie check bag/ --image /front/image_raw --imu none
      belie check kitti/00 --position poses       the trajectory as position claim too
      belie check drive.mcap --json - | jq 'select(.alerts != [])'
      belie check attacked.mcap --labels attacked.mcap.labels.json
      belie check kitti/00 --detections label_02/0000.txt
      belie check drive.mp4 --detector yolov8n.onnx --detector-labels coco.txt

    \b
    Exit codes: 0 no alert, 1 alert raised, 2 usage or data error.
    """  # noqa: D301 (\b keeps the lines of the examples)
    from belie.attacks import read_labels
    from belie.cli.check_table import print_summary
    from belie.cli.progress import frame_count, progress
    from belie.cli.settings import config_from_flags
    from belie.evaluation.run import run_detector
    from belie.recordings import open_recording

    settings = config_from_flags(config, profile, false_alarms_per_hour)
    truth = None if labels is None else read_labels(labels)
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
    recording = with_own_detector(recording, detector, detector_labels, detector_threads)
    if report is not None:
        keep_apart(source, report, "--report")
        _require_folder(report)
    if json is not None and json != STDOUT:
        keep_apart(source, json, "--json")
    with ExitStack() as stack:
        write = _json_writer(json, stack)
        bar_spoils_output = json == STDOUT and sys.stdout.isatty()
        text = f"checking {source.name}"
        advance = stack.enter_context(progress(text, frame_count(recording), enabled=not bar_spoils_output))

        def on_verdict(verdict: Verdict) -> None:
            write(verdict)
            advance()

        run = run_detector(
            recording, settings, labels=truth, on_verdict=on_verdict, pictures=report is not None
        )
    if report is not None:  # before the table: whoever reads that through `head` hangs up
        _write_report(run, report, truth)
    print_summary(run, labels=truth, to_stderr=json == STDOUT)
    tell_damage(recording)
    classes = settings.objects.classes if run.profile == "default" else None
    tell_detections(recording, run.told, classes, least_share=_LEAST_UNGROUPED)
    _mention_labels(source, labels)
    if run.alerts:
        raise typer.Exit(ALERT_RAISED)


def _json_writer(json: Path | None, stack: ExitStack) -> Callable[[Verdict], None]:
    if json is None:
        return lambda verdict: None
    from belie.types.json_lines import json_line

    out = sys.stdout if json == STDOUT else stack.enter_context(json.open("w", encoding="utf-8"))

    def write(verdict: Verdict) -> None:
        out.write(json_line(verdict) + "\n")
        out.flush()  # whoever listens is told now, not when a buffer is full

    return write


def _require_folder(report: Path) -> None:
    """Say before a long run, not after it, that the report has no place to go."""
    from belie.types import RecordingError

    if not report.resolve().parent.is_dir():
        raise RecordingError(f"--report {report}: the folder {report.parent} does not exist")


def _write_report(run: Run, report: Path, truth: tuple[AttackLabel, ...] | None) -> None:
    from belie.evaluation.report import write_report

    write_report(run, report, labels=truth)
    print(f"report: {report}", file=sys.stderr)


def _mention_labels(source: Path, labels: Path | None) -> None:
    from belie.attacks import labels_path

    beside = labels_path(source)
    if labels is None and beside.is_file():
        print(f"labels lie beside this recording: add --labels {beside} to score the answer", file=sys.stderr)
