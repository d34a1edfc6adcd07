"""An attack resolved on one recording: what every stage of an attack is given."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass

import numpy as np

from belie.attacks.catalogue import ROTATIONS, VEHICLE_AXES
from belie.attacks.source import BodyAxes
from belie.attacks.spec import AttackSpec
from belie.attacks.timing import FrameClock, Span
from belie.types import Claim, DetectionClaim, MotionClaim, MountedCamera, PoseClaim, PositionClaim


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """A specification, the span in which it acts, and the clock, axes and camera of the recording.

    Examples
    --------
    >>> clock = FrameClock(np.arange(200) * 100_000_000)
    >>> plan = Plan.of(AttackSpec.of("paper-odometry"), clock, "flu")
    >>> plan.span.start_frame, plan.span.stop_frame, plan.span.end_ns
    (100, 110, 11000000000)
    """

    spec: AttackSpec
    span: Span
    clock: FrameClock
    body_axes: BodyAxes
    camera: MountedCamera | None = None

    @classmethod
    def of(
        cls, spec: AttackSpec, clock: FrameClock, body_axes: BodyAxes, camera: MountedCamera | None = None
    ) -> Plan:
        """Resolve `spec` on a recording's clock; raises `AttackError` as `AttackSpec.span` does."""
        return cls(spec=spec, span=spec.span(clock), clock=clock, body_axes=body_axes, camera=camera)

    @property
    def turns(self) -> bool:
        """Whether the attacked quantity is an angle or an angular rate, so that the text is in degrees."""
        if self.spec.stream == "imu":
            return not self.accelerates
        return self.spec.axis in ROTATIONS

    @property
    def accelerates(self) -> bool:
        """Whether an IMU's acceleration is attacked rather than its angular rate."""
        return self.spec.stream == "imu" and self.spec.axis in VEHICLE_AXES

    def si(self, option: str) -> float:
        """A numeric option in SI units (radians for the text's degrees)."""
        value = self.spec.number(option)
        return math.radians(value) if self.turns else value

    def selects(self, claim: Claim) -> bool:
        """Whether this attack is aimed at the stream that `claim` belongs to."""
        if self.spec["source"] not in (None, claim.source):
            return False
        match claim:
            case PoseClaim():
                return self.spec.stream == "odometry"
            case PositionClaim():
                return self.spec.stream == "position"
            case DetectionClaim():
                return self.spec.stream == "detections"
            case MotionClaim(kind="twist"):
                return self.spec.stream == "odometry"
            case MotionClaim():
                needed = claim.acceleration_m_s2 if self.accelerates else claim.angular_rad_s
                stale = self.spec.kind in ("freeze", "replay", "delay")
                return self.spec.stream == "imu" and (stale or needed is not None)

    def anchor_ns(self, last_honest_ns: int | None) -> int:
        """When a growing error was last zero: at the last honest message, but at most one frame before start.

        With one message a frame, the first attacked one thus lies by one frame's worth, as in the paper;
        with fifty a second, the error grows from the first message on without a jump.
        """
        earliest_ns = self.clock.stamp_at(self.span.start_frame - 1)
        return earliest_ns if last_honest_ns is None else max(last_honest_ns, earliest_ns)

    def random(self, source: str) -> np.random.Generator:
        """The generator of this attack on one source: the same for the same seed, name and source."""
        tag = zlib.crc32(f"{self.spec.name}|{source}".encode())
        return np.random.default_rng([int(self.spec.number("seed")), tag])
