"""``belie attack``: an attacked copy of a recording, and its labels."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from belie.cli.damage import tell_damage
from belie.cli.detection_warnings import tell_detections
from belie.cli.errors import keep_apart
from belie.cli.live import (
    Domain,
    Endpoint,
    Interface,
    LiveConfig,
    Master,
    Middleware,
    Remap,
    network_flags,
    pairs_of,
    settings_of,
)
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
from belie.cli.output import Encoding, require_free, tell_choices, write_labels, write_recording

if TYPE_CHECKING:
    from belie.bridges.settings import LiveSettings
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
        list[str] | None,
        typer.Argument(
            metavar="SPEC...", help="Attacks, name:option=value,…; see below.", show_default=False
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="OUT.mcap", help="Where to write; labels go beside it."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite OUT.mcap and its labels.")] = False,
    encoding: Annotated[
        Encoding, typer.Option("--encoding", help="How to store images; png and mono8 lose nothing.")
    ] = Encoding.PNG,
    on_robot: Annotated[
        Middleware | None,
        typer.Option(
            "--live",
            metavar="dds|zenoh|ros1",
            help="Attack a running system: no SOURCE, only SPECs. Each attacked topic goes on as TOPIC_attacked, or "
            "as --remap says.",
        ),
    ] = None,
    image: Image = None,
    camera_info: CameraInfo = None,
    odometry: Odometry = None,
    position: Position = None,
    imu: Imu = None,
    detections: Detections = None,
    detector_labels: DetectorLabels = None,
    rate: Rate = None,
    config: LiveConfig = None,
    remap: Remap = None,
    domain: Domain = None,
    interface: Interface = None,
    endpoint: Endpoint = None,
    master: Master = None,
) -> None:
    """Write an attacked copy of a recording (ROS 2 MCAP), with labels of what lies and when.

    SOURCE is never changed. The labels, OUT.mcap.labels.json, tell 'belie check --labels' the truth. With --live,
    topics of a running system are altered on their way; only for systems that are yours to test.

    \b
    Examples:
      belie attack drive.mcap paper-odometry -o attacked.mcap
      belie attack drive.mcap odometry-offset:axis=lateral,rate=0.05,start=100,stop=150 -o slow.mcap
      belie attack drive.mcap imu-bias:axis=yaw,rate=0.5,start=20s -o gyro.mcap
      belie attack kitti/00 --position poses position-ramp:rate=0.05,start=60 -o drag.mcap
      belie attack drive.mcap camera-freeze:start=50 odometry-freeze:start=50 -o both.mcap
      belie attack --live dds odometry-offset:axis=left,rate=0.2,start=100 --remap /odom:=/odom_attacked
    """  # noqa: D301 (\b keeps the lines of the examples)
    if on_robot is not None:
        topics = {
            "image": image,
            "camera_info": camera_info,
            "odometry": odometry,
            "position": position,
            "imu": imu,
            "detections": detections,
        }
        flags = {"topics": topics, **network_flags(domain, interface, endpoint, master)}
        attack_live(
            on_robot, [str(source), *(specs or [])], settings_of(config, flags), pairs_of(remap) or {}
        )
        return
    if not specs or output is None:
        raise typer.BadParameter("SOURCE, SPEC... and -o OUT.mcap are needed (or --live, and SPEC...)")
    from belie.attacks import attack as attacked_by
    from belie.attacks import choose_objects, labels_path
    from belie.checks.objects import ObjectSettings
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
    choices = choose_objects(recording, specs, least_px=ObjectSettings().least_side_px)
    attacked = attacked_by(recording, [choice.spec for choice in choices])
    labels = attacked.labels  # where there is nothing to attack, before anything is written
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
    tell_damage(recording)
    tell_detections(recording)
    write_labels(sidecar, attacked)
    tell_choices(choices, labels)
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


def attack_live(
    middleware: Middleware, specs: list[str], settings: LiveSettings, names: dict[str, str]
) -> None:
    """Attack a running system until SIGINT or SIGTERM."""
    import signal

    from belie.attacks import parse_attack
    from belie.bridges.hijack import Hijack
    from belie.bridges.transports.opening import TransportName, open_transport

    def say(text: str) -> None:
        print(f"belie attack: {' '.join(text.split())}", file=sys.stderr, flush=True)

    parsed = [parse_attack(spec) for spec in specs]
    transport = open_transport(TransportName(middleware.value), settings)
    try:
        hijack = Hijack(transport, settings, parsed, names=names, on_event=say)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: hijack.stop())
        hijack.run()
    finally:
        transport.close()
    say(f"stop: {hijack.altered} messages altered")
