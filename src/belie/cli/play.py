"""``belie play``: a recording on a middleware, as the robot sent it."""

from __future__ import annotations

import signal
import sys
import time
from contextlib import ExitStack
from typing import Annotated

import typer

from belie.cli.live import Domain, Endpoint, Interface, LiveConfig, Master, MiddlewareName, Remap
from belie.cli.options import CameraInfo, Image, Source

_LINGER_S = 0.5  # the last messages are on their way


def play(
    source: Source,
    middleware: MiddlewareName,
    rate: Annotated[
        float, typer.Option("--rate", metavar="R", help="2 plays twice as fast.", min=0.001)
    ] = 1.0,
    restamp: Annotated[
        bool, typer.Option("--restamp", help="Move header stamps so that the drive seems to happen now.")
    ] = False,
    wait: Annotated[
        int, typer.Option("--wait", metavar="N", help="First wait until N subscribe to the images.", min=0)
    ] = 0,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again after the last message.")] = False,
    config: LiveConfig = None,
    image: Image = None,
    camera_info: CameraInfo = None,
    remap: Remap = None,
    domain: Domain = None,
    interface: Interface = None,
    endpoint: Endpoint = None,
    master: Master = None,
) -> None:
    """Publish a recording as a robot would: same messages, names, types and times; /tf_static is latched.

    \b
    Examples:
      belie play drive.mcap dds --wait 1
      belie play kitti/00 dds --rate 0.5 --interface lo
      belie play drive.mcap ros1 --remap /odom:=/robot/odom
    """  # noqa: D301 (\b keeps the lines of the examples)
    from belie.bridges.player import Player, as_bag, messages_of, types_of
    from belie.bridges.transports.opening import TransportName, open_transport
    from belie.cli.live import network_flags, pairs_of, settings_of
    from belie.recordings import open_recording

    flags = {
        "topics": {"remap": pairs_of(remap)},
        **network_flags(domain, interface, endpoint, master),
    }
    settings = settings_of(config, flags)
    found = open_recording(source, image=image, camera_info=camera_info)
    stopped: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: stopped.append(number))
    with ExitStack() as whole:
        recording = as_bag(found, whole)
        transport = open_transport(TransportName(middleware.value), settings)
        whole.callback(transport.close)
        player = Player(transport, rate=rate, restamp=restamp, stopped=lambda: bool(stopped))
        player.advertise(types_of(recording))
        if wait:
            used = [stream for stream in recording.streams if stream.used]
            image_topic = next(stream.topic for stream in used if stream.role == "image")
            others = [stream.topic for stream in used if stream.topic != image_topic]
            player.wait_for_subscribers(image_topic, others, wait, timeout_s=60.0)
        while not stopped:
            with ExitStack() as stack:
                player.play(messages_of(recording, stack))
            if not loop:
                break
        time.sleep(_LINGER_S)
    print(f"played {player.sent} messages of {source}", file=sys.stderr)
