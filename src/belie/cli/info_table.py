"""The tables of ``belie info``."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from belie.recordings import Recording, StreamInfo
    from belie.types import MountedCamera

_GAP_PERIODS = 5.0  # a gap worth a mark, in periods of the stream
_CHECKS = {
    "odometry": "the claimed motion (pose and twist) against the visual motion",
    "imu": "the gyroscope's rates against the visual rotation",
    "position": "the positions against the odometry that the camera vouches for",
}
_MISHAPS = {
    "late": "came after their frame had gone (they travel with the next one)",
    "out_of_order": "stamped before their predecessor (sorted)",
    "clock_jumps": "stamped more than a second before their predecessor",
    "duplicates": "with the stamp of their predecessor",
    "missing": "frames without a claim nearby, or lost from the image stream",
    "dropped_late": "stamped after the last frame (not used)",
    "lost": "counted by the index, but not in the data: the file is damaged",
    "undecodable": "images or messages that cannot be decoded (skipped)",
    "invalid": "GNSS messages without a fix (skipped)",
    "outside": "boxes that have no area inside the image (skipped)",
    "repeated": "boxes that stand in the file more than once (skipped)",
}


def _console() -> Console:
    return Console(file=sys.stdout, width=None if sys.stdout.isatty() else 140, highlight=False)


def print_streams(streams: Sequence[StreamInfo]) -> None:
    """One line a stream: what it is, how many, how often, from when to when."""
    if not streams:
        return
    start_ns = min((stream.start_ns for stream in streams if stream.start_ns is not None), default=0)
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    table.add_column("")
    table.add_column("stream", overflow="fold")
    table.add_column("part")
    table.add_column("type", overflow="fold")
    for column in ("messages", "rate [Hz]", "from [s]", "to [s]", "longest gap [s]"):
        table.add_column(Text(column), justify="right", no_wrap=True)  # as text: [s] is no markup
    for stream in streams:
        table.add_row(*_stream_row(stream, start_ns))
    _console().print(table)


def _stream_row(stream: StreamInfo, start_ns: int) -> tuple[Text, ...]:
    times = [stream.start_ns, stream.end_ns]
    spans = ["" if time is None else f"{(time - start_ns) * 1e-9:.2f}" for time in times]
    gap = stream.longest_gap_s
    has_hole = gap is not None and stream.rate_hz is not None and gap * stream.rate_hz > _GAP_PERIODS
    cells = (
        Text("*" if stream.used else "", style="green"),
        Text(stream.topic, style="bold" if stream.used else ""),
        Text(stream.role),
        Text(stream.message_type),
        Text(str(stream.count)),
        Text("" if stream.rate_hz is None else f"{stream.rate_hz:.2f}"),
        Text(spans[0]),
        Text(spans[1]),
        Text("" if gap is None else f"{gap:.3f}", style="yellow" if has_hole else ""),
    )
    return cells


def print_cameras(recording: Recording) -> None:
    """Intrinsics and mount of each camera."""
    for name, mounted in recording.cameras.items():
        print(f"\ncamera {name}")
        for line in _camera_lines(mounted, recording.body_axes):
            print(f"  {line}")


def _camera_lines(mounted: MountedCamera, body_axes: str) -> list[str]:
    model = mounted.model
    wide = 2.0 * math.degrees(math.atan(0.5 * model.width / model.fx))
    position, ahead = mounted.T_body_cam.t, mounted.T_body_cam.R[:, 2]
    axes = "x forward, y left, z up" if body_axes == "flu" else "x right, y down, z forward"
    return [
        f"{model.width}x{model.height} pixels, {model.model}"
        + (f" {', '.join(f'{k:.5g}' for k in model.distortion)}" if model.distortion else ""),
        f"focal length {model.fx:.2f} {model.fy:.2f} px, principal point {model.cx:.2f} {model.cy:.2f} px; "
        f"about {wide:.0f} deg wide",
        f"at ({position[0]:.3f}, {position[1]:.3f}, {position[2]:.3f}) m of the body, looking along "
        f"({ahead[0]:.2f}, {ahead[1]:.2f}, {ahead[2]:.2f}); body axes: {axes}",
    ]


def print_use(recording: Recording) -> None:
    """What ``belie check`` would do with it."""
    used = {stream.role: stream.topic for stream in recording.streams if stream.used}
    print("\nbelie check would use the streams marked * and test")
    for role, meaning in _CHECKS.items():
        print(f"  {role:<9} {used[role]}: {meaning}" if role in used else f"  {role:<9} no such stream")
    print(f"  {'camera':<9} {', '.join(recording.cameras)}: frozen, replayed, dark or covered images")
    if "detections" in used:
        print(
            f"  {'objects':<9} {used['detections']}: objects that vanish or change their label while their pixels "
            "stay, or that the images do not show"
        )
    else:
        print(f"  {'objects':<9} no such stream")
    if not used.keys() & {*_CHECKS, "detections"}:
        print("No stream makes a claim: only the camera itself can be checked.")


def print_join_warnings(recording: Recording, joined: int) -> None:
    """What the joining of the streams met."""
    counts = recording.join_counts
    found = [
        f"  {kind.replace('_', ' ')}: {', '.join(f'{n} of {s}' for s, n in counter.items() if n)}; {meaning}"
        for kind, meaning in _MISHAPS.items()
        if (counter := getattr(counts, kind)).total()
    ]
    print(f"\njoined {joined} frames: " + ("" if found else "no message late, missing or out of order"))
    for line in found:
        print(line)
