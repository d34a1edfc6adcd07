"""Every stream of claims, buffered by stamp, and what each says of the camera's motion between two images."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from pydantic import Field

from belie.detector.claim_buffer import LONGEST_GAP_NS, ClaimBuffer, motion_between, pose_at
from belie.geometry import SE3, FloatArray
from belie.types import Claim, DetectionClaim, MotionClaim, PoseClaim, PositionClaim, Settings

MotionCheck = Literal["odometry", "twist", "imu"]
_MOST_AHEAD_NS = 5_000_000_000  # of the frame: the slowest stream's next message, not a broken clock's
_MOST_GAP_S = 0.3  # between two claims: over half a second an honest vehicle's turns raise alerts
_FARTHEST_M = 1e8
_FASTEST = 1e4  # m/s and rad/s
StreamKey = tuple[MotionCheck, str]  # what is checked, and the topic


class StreamSettings(Settings):
    """How claims are read between their messages.

    >>> StreamSettings().longest_gap_ns
    150000000
    """

    longest_gap_s: float = Field(
        LONGEST_GAP_NS / 1e9,
        gt=0.0,
        le=_MOST_GAP_S,
        description="between two messages of a claimed motion, at most, for it to be interpolated [s]; one that comes "
        "more seldom is not judged; what bends in between counts as noise, so that a turn hides more",
    )

    @property
    def longest_gap_ns(self) -> int:
        """The same in nanoseconds."""
        return round(self.longest_gap_s * 1e9)


@dataclass(slots=True)
class Streams:
    """Buffers of all claims, by topic; a stream exists from its first message on.

    Examples
    --------
    >>> streams = Streams()
    >>> streams.take([PoseClaim(source="/odom", frame_id="odom", stamp_ns=i * 10**8, received_ns=0,
    ...                         T_odom_body=SE3.from_translation([0.1 * i, 0, 0])) for i in range(3)], 0)
    >>> streams.motions(0, 10**8, SE3.identity())["odometry", "/odom"].t
    array([0.1, 0. , 0. ])
    """

    settings: StreamSettings = field(default_factory=StreamSettings)
    poses: dict[str, ClaimBuffer[PoseClaim]] = field(default_factory=dict)
    rates: dict[StreamKey, ClaimBuffer[MotionClaim]] = field(default_factory=dict)
    positions: dict[str, list[PositionClaim]] = field(default_factory=dict)
    odom_frame: str = ""

    def take(self, claims: Iterable[Claim], now_ns: int) -> None:
        """Sort new claims into their buffers; those that cannot be true of any time are left out.

        Those that cannot be true of any robot are kept, as large as numbers allow: to be contradicted.
        """
        gap_ns = self.settings.longest_gap_ns
        for told in claims:
            if isinstance(told, DetectionClaim):
                continue  # what stands around the robot says nothing of its motion
            if told.stamp_ns - now_ns > _MOST_AHEAD_NS:
                continue
            claim = _bounded(told)
            if isinstance(claim, PoseClaim):
                self.odom_frame = self.odom_frame or claim.frame_id
                self.poses.setdefault(claim.source, ClaimBuffer(gap_ns)).add(claim)
            elif isinstance(claim, MotionClaim):
                self.rates.setdefault((claim.kind, claim.source), ClaimBuffer(gap_ns)).add(claim)
            else:
                self.positions.setdefault(claim.source, []).append(claim)

    def motion_streams(self) -> list[StreamKey]:
        """All streams that claim a motion."""
        return [*(("odometry", source) for source in self.poses), *self.rates]

    def pose(self, source: str, stamp_ns: int) -> SE3 | None:
        """``T_odom_body`` of a pose stream at `stamp_ns`."""
        return pose_at(self.poses[source], stamp_ns)

    def pose_motion(self, source: str, start_ns: int, stop_ns: int, T_body_cam: SE3) -> SE3 | None:
        """The camera's motion between two stamps, as a pose stream claims it, or None."""
        before, after = self.pose(source, start_ns), self.pose(source, stop_ns)
        if before is None or after is None:
            return None
        return T_body_cam.inverse() @ before.inverse() @ after @ T_body_cam

    def odometry_pose(self, stamp_ns: int) -> SE3 | None:
        """``T_odom_body`` of the first odometry stream at `stamp_ns`."""
        source = next(iter(self.poses), None)
        return None if source is None else self.pose(source, stamp_ns)

    def odometry_motion(self, start_ns: int, stop_ns: int, T_body_cam: SE3) -> SE3 | None:
        """The same as the first odometry stream claims it."""
        source = next(iter(self.poses), None)
        return None if source is None else self.pose_motion(source, start_ns, stop_ns, T_body_cam)

    def motions(self, start_ns: int | None, stop_ns: int, T_body_cam: SE3) -> dict[StreamKey, SE3 | None]:
        """The camera's motion ``T_prev_cur`` between two stamps, as each stream claims it; None where it does not.

        An IMU claims a rotation only; its translation is zero here, and not to be used.
        """
        found: dict[StreamKey, SE3 | None] = dict.fromkeys(self.motion_streams())
        if start_ns is None or start_ns >= stop_ns:
            return found
        for key in found:
            T_body = self._body_motion(key, start_ns, stop_ns)
            if T_body is not None:
                found[key] = T_body_cam.inverse() @ T_body @ T_body_cam
        return found

    def why_unknown(self, key: StreamKey) -> str | None:
        """Why no motion of a stream is ever known, where its messages are too far apart; else None."""
        check, source = key
        return too_seldom(self.poses[source] if check == "odometry" else self.rates[key])

    def _body_motion(self, key: StreamKey, start_ns: int, stop_ns: int) -> SE3 | None:
        check, source = key
        if check == "odometry":
            before, after = pose_at(self.poses[source], start_ns), pose_at(self.poses[source], stop_ns)
            return None if before is None or after is None else before.inverse() @ after
        integrated = motion_between(self.rates[key], start_ns, stop_ns)
        if integrated is None:
            return None
        R, t = integrated
        if t is None:
            return SE3(R, np.zeros(3)) if check == "imu" else None
        return SE3(R, t)

    def due_positions(self, source: str, stamp_ns: int) -> list[PositionClaim]:
        """Take out the position claims of a stream that are stamped up to `stamp_ns`, in order."""
        waiting = sorted(self.positions[source], key=lambda claim: claim.stamp_ns)
        due = [claim for claim in waiting if claim.stamp_ns <= stamp_ns]
        self.positions[source] = waiting[len(due) :]
        return due


def too_seldom(buffer: ClaimBuffer[PoseClaim] | ClaimBuffer[MotionClaim]) -> str | None:
    """That a stream's messages are too far apart to interpolate, and what to set; None where they are not.

    >>> too_seldom(ClaimBuffer())
    """
    period_ns = buffer.period_ns()
    if period_ns is None or period_ns <= buffer.longest_gap_ns:
        return None
    apart = f"claims are {period_ns * 1e-6:.0f} ms apart"
    enough_s = min(_MOST_GAP_S, math.ceil(period_ns * 1.2e-7) * 1e-2)
    if period_ns * 1e-9 > enough_s:
        return f"{apart}: too far to tell the motion in between"
    return (
        f"{apart}, more than {buffer.longest_gap_ns * 1e-9:g} s: set streams.longest_gap_s = {enough_s:.2f}"
    )


def _bounded(claim: PoseClaim | MotionClaim | PositionClaim) -> PoseClaim | MotionClaim | PositionClaim:
    """The claim, no farther and no faster than any robot on Earth could be: larger numbers overflow what follows."""
    if isinstance(claim, PoseClaim):
        R, t = claim.T_odom_body.R, claim.T_odom_body.t
        near = _clipped(t, _FARTHEST_M)
        return claim if near is t else replace(claim, T_odom_body=SE3(R, near))
    if isinstance(claim, PositionClaim):
        position_m = _clipped(claim.position_m, _FARTHEST_M)
        return claim if position_m is claim.position_m else replace(claim, position_m=position_m)
    rates = claim.linear_m_s, claim.angular_rad_s
    linear, angular = (None if rate is None else _clipped(rate, _FASTEST) for rate in rates)
    if linear is claim.linear_m_s and angular is claim.angular_rad_s:
        return claim
    return replace(claim, linear_m_s=linear, angular_rad_s=angular)


def _clipped(values: FloatArray, most: float) -> FloatArray:
    """The very same array where nothing in it is larger than `most`."""
    return values if float(np.abs(values).max()) <= most else np.clip(values, -most, most)
