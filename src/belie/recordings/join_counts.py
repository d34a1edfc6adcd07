"""What the joining of streams met, for the report."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass(slots=True, kw_only=True)
class JoinCounts:
    """What the joining met, per stream (topic).

    Attributes
    ----------
    late : Counter
        Claims that came after their frame had gone; they travel with the next frame.
    out_of_order : Counter
        Messages stamped before their predecessor on the same stream.
    clock_jumps : Counter
        Claims stamped more than `JoinSettings.clock_jump_s` before their predecessor.
    duplicates : Counter
        Frames with the stamp of an earlier one (skipped), claims likewise (handed out).
    missing : Counter
        For claims, frames without a claim within two periods; for a camera, frames absent from gaps.
    dropped_late : Counter
        Claims for which no frame was left: stamped after the last one.
    lost : Counter
        Messages that the index of a bag counts, but that are not in its data: it is damaged.
    undecodable : Counter
        Images and messages that could not be decoded (skipped).
    invalid : Counter
        GNSS messages without a fix (skipped).
    outside : Counter
        Boxes of a detections file that have no area inside the image (skipped).
    repeated : Counter
        Rows of a detections file that say again what another one says (skipped).

    Examples
    --------
    >>> counts = JoinCounts()
    >>> counts.late["/odom"] += 1
    >>> counts.late.total(), counts.late["/imu"]
    (1, 0)
    """

    late: Counter[str] = field(default_factory=Counter)
    out_of_order: Counter[str] = field(default_factory=Counter)
    clock_jumps: Counter[str] = field(default_factory=Counter)
    duplicates: Counter[str] = field(default_factory=Counter)
    missing: Counter[str] = field(default_factory=Counter)
    dropped_late: Counter[str] = field(default_factory=Counter)
    lost: Counter[str] = field(default_factory=Counter)
    undecodable: Counter[str] = field(default_factory=Counter)
    invalid: Counter[str] = field(default_factory=Counter)
    outside: Counter[str] = field(default_factory=Counter)
    repeated: Counter[str] = field(default_factory=Counter)
