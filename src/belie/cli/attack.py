"""``belie attack``: an attacked copy of a recording, and its labels."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from belie.cli.errors import keep_apart
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
from belie.cli.output import Encoding, require_free, write_labels, write_recording

if TYPE_CHECKING:
    from belie.types import Step


class AttackCommand(TyperCommand):
    """A command whose help ends with the catalogue of attacks, as `belie.attacks` knows it."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the usual help, then the catalogue."""
        from belie.attacks import describe_attacks

        super().format_help(ctx, formatter)
        formatter.write(f"\n{describe_attacks()}\n")


def attack(
    source: Source,
    specs: Annotated[
        list[str],
        typer.Argument(
            metavar="SPEC...", help="Attacks, name:option=value,…; see below.", show_default=False
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="OUT.mcap", help="Where to write; labels go beside it.")
    ],
    force: Annotated[bool, typer.Option("--force", help="Overwrite OUT.mcap and its labels.")] = False,
    encoding: Annotated[
        Encoding, typer.Option("--encoding", help="How to store images; png and mono8 lose nothing.")
    ] = Encoding.PNG,
    image: Image = None,
    camera_info: CameraInfo = None,
    odometry: Odometry = None,
    position: Position = None,
    imu: Imu = None,
    detections: Detections = None,
    detector_labels: DetectorLabels = None,
    rate: Rate = None,
) -> None:
    """Write an attacked copy of a recording (ROS 2 MCAP), with labels of what lies and when.

    SOURCE is never changed. The labels, OUT.mcap.labels.json, tell 'belie check --labels' the truth.

    \b
    Examples:
      belie attack drive.mcap paper-odometry -o attacked.mcap
      belie attack drive.mcap odometry-offset:axis=lateral,rate=0.05,start=100,stop=150 -o slow.mcap
      belie attack drive.mcap imu-bias:axis=yaw,rate=0.5,start=20s -o gyro.mcap
      belie attack kitti/00 --position poses position-ramp:rate=0.05,start=60 -o drag.mcap
      belie attack drive.mcap camera-freeze:start=50 odometry-freeze:start=50 -o both.mcap
    """  # noqa: D301 (\b keeps the lines of the examples)
    from belie.attacks import attack as attacked_by
    from belie.attacks import labels_path
    from belie.cli.progress import frame_count
    from belie.recordings import open_recording

    sidecar = labels_path(output)
    keep_apart(source, output, "-o")
    require_free(output, [sidecar], force=force)
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
    attacked = attacked_by(recording, specs)
    labels = attacked.labels
    write_recording(
        output,
        _fit_for_messages(attacked.steps()),
        doing="writing",
        frames=frame_count(recording),
        cameras=recording.cameras,
        body_axes=recording.body_axes,
        encoding=encoding,
        geodetic_origin=recording.geodetic_origin,
    )
    write_labels(sidecar, labels, int(attacked.frame_stamps_ns()[0]))
    print(f"wrote {output} and {sidecar}; now: belie check {output} --labels {sidecar}")


def _fit_for_messages(steps: Iterator[Step]) -> Iterator[Step]:
    """The steps as ROS messages can hold them; what they cannot is told once."""
    from dataclasses import replace

    from belie.recordings.vision_messages import without_sizes_of_boxed
    from belie.types import DetectionClaim

    is_told = False
    for step in steps:
        claims = tuple(
            without_sizes_of_boxed(claim) if isinstance(claim, DetectionClaim) else claim
            for claim in step.claims
        )
        if claims != step.claims and not is_told:
            print(
                "dimensions of objects with image boxes are left out: vision_msgs holds the one or the other",
                file=sys.stderr,
            )
            is_told = True
        yield replace(step, claims=claims)
