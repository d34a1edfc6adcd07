"""The options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Source = Annotated[
    Path,
    typer.Argument(
        metavar="SOURCE",
        help="A ROS 2 bag (MCAP, sqlite3), ROS 1 bag, KITTI, EuRoC or TUM folder, or a video with a TUM "
        "trajectory beside it; recognised by its contents.",
        show_default=False,
    ),
]
Image = Annotated[str | None, typer.Option("--image", metavar="TOPIC", help="Image topic (or camera).")]
CameraInfo = Annotated[
    str | None,
    typer.Option("--camera-info", metavar="TOPIC", help="Camera info topic; for TUM and videos a file."),
]
Odometry = Annotated[
    str | None, typer.Option("--odometry", metavar="TOPIC", help="Odometry topic; 'none' leaves it out.")
]
Position = Annotated[
    str | None,
    typer.Option(
        "--position",
        metavar="TOPIC",
        help="GNSS or localisation topic; 'none' leaves it out; 'poses' takes a folder's trajectory.",
    ),
]
Imu = Annotated[str | None, typer.Option("--imu", metavar="TOPIC", help="IMU topic; 'none' leaves it out.")]
Detections = Annotated[
    str | None,
    typer.Option(
        "--detections",
        metavar="TOPIC|FILE",
        help="Object detections: a topic, or a file of KITTI tracking labels, MOT text or CSV (frame,track_id,label,"
        "score,left,top,right,bottom); 'none' leaves them out.",
    ),
]
DetectorLabels = Annotated[
    Path | None,
    typer.Option(
        "--detector-labels",
        metavar="names.txt",
        help="Names of the detector's classes (or MOT's), one a line.",
    ),
]
DetectorModel = Annotated[
    Path | None,
    typer.Option(
        "--detector",
        metavar="model.onnx",
        help="Run a detector on the images, too: an ONNX model in YOLO's output layout (extra 'onnx').",
    ),
]
DetectorThreads = Annotated[
    int, typer.Option("--detector-threads", metavar="N", help="Threads that the detector may take.", min=1)
]
Rate = Annotated[
    float | None,
    typer.Option("--rate", metavar="HZ", help="Frame rate of a folder or video, instead of its own times."),
]
Profile = Annotated[
    str | None,
    typer.Option(
        "--profile",
        metavar="default|paper",
        help="'default' is what a robot should run; 'paper' is the paper to the letter.",
    ),
]
ConfigFile = Annotated[
    Path | None,
    typer.Option("--config", metavar="belie.toml", help="Settings; 'belie config' prints them all."),
]
FalseAlarms = Annotated[
    float | None,
    typer.Option(
        "--false-alarms-per-hour",
        metavar="R",
        help="False alarms that you accept, all checks together [per hour]; thresholds follow from it.",
    ),
]
