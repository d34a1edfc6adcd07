"""A small recording in memory: a curve at changing speed, with every stream that can be attacked."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from belie.geometry import SE3, CameraModel
from belie.types import (
    Claim,
    Detection,
    DetectionClaim,
    Frame,
    MotionClaim,
    MountedCamera,
    PoseClaim,
    PositionClaim,
    Step,
)

MS = 1_000_000
EPOCH_NS = 1_700_000_000_000_000_000
FRAME_NS = 100 * MS
# Body twists of the curve: 5 m/s forward, 0.3 rad/s to the left, a little roll and pitch.
TWISTS = {
    "flu": np.array([5.0, 0.1, 0.05, 0.02, -0.01, 0.3]),
    "rdf": np.array([-0.1, -0.05, 5.0, 0.01, -0.3, 0.02]),
}


class Curve:
    """Ten images a second, odometry with twist, IMU and positions; `odometry_ms` may equal a frame's."""

    def __init__(self, frames: int, body_axes: str, odometry_ms: int, position_frame: str) -> None:
        self.body_axes = body_axes
        model = CameraModel(width=24, height=16, fx=20, fy=20, cx=11.5, cy=7.5)
        self.cameras = {"/image": MountedCamera(model=model, T_body_cam=SE3.identity())}
        self.position_frame = position_frame
        self._stamps_ns = EPOCH_NS + np.arange(frames) * FRAME_NS
        self.opened = 0
        rng = np.random.default_rng(0)
        self._images = rng.integers(0, 255, (frames, 16, 24), dtype=np.uint8)
        claims = [
            *(c for t in range(0, frames * 100, odometry_ms) for c in self._odometry(t * MS)),
            *(self._imu(t * MS) for t in range(2, frames * 100, 5)),
            *(self._position(t * MS) for t in range(33, frames * 100, 100)),
            *(self._detections(t * MS) for t in range(0, frames * 100, 100)),
        ]
        claims.sort(key=lambda claim: claim.stamp_ns)
        self._claims = self._by_frame(claims)

    def _by_frame(self, claims: list[Claim]) -> list[tuple[Claim, ...]]:
        # The first claim after the frame comes with it, be it a pose without its twist.
        stamps = [claim.stamp_ns for claim in claims]
        ends = [bisect_right(stamps, stamp) + 1 for stamp in self._stamps_ns.tolist()]
        return [tuple(claims[a:b]) for a, b in pairwise([0, *ends])]

    def frame_stamps_ns(self) -> np.ndarray:
        return self._stamps_ns

    def steps(self) -> Iterator[Step]:
        self.opened += 1
        for index, stamp in enumerate(self._stamps_ns.tolist()):
            image = self._images[index].copy()
            yield Step(
                frame=Frame(camera="/image", stamp_ns=stamp, received_ns=stamp + 7, image=image),
                claims=self._claims[index],
                decode_ms=1.5,
            )

    def pose(self, t_ns: int) -> tuple[SE3, np.ndarray]:
        t = t_ns / 1e9
        twist = TWISTS[self.body_axes]
        start = SE3.exp([3.0, -2.0, 1.0, 0.1, 0.2, 0.3])
        return start @ SE3.exp(twist * (t + 0.2 * np.sin(t))), twist * (1.0 + 0.2 * np.cos(t))

    def _odometry(self, t_ns: int) -> list[Claim]:
        T, twist = self.pose(t_ns)
        stamps: Any = {
            "source": "/odom",
            "stamp_ns": EPOCH_NS + t_ns,
            "received_ns": EPOCH_NS + t_ns + 3 * MS,
        }
        return [
            PoseClaim(**stamps, frame_id="odom", T_odom_body=T, covariance=np.eye(6) * 0.01),
            MotionClaim(**stamps, kind="twist", linear_m_s=twist[:3], angular_rad_s=twist[3:]),
        ]

    def _imu(self, t_ns: int) -> Claim:
        T, twist = self.pose(t_ns)
        return MotionClaim(
            source="/imu",
            kind="imu",
            stamp_ns=EPOCH_NS + t_ns,
            received_ns=EPOCH_NS + t_ns,
            angular_rad_s=twist[3:],
            acceleration_m_s2=T.R.T @ np.array([0.0, 0.0, 9.81]),
        )

    def _detections(self, t_ns: int) -> Claim:
        return DetectionClaim(
            source="/detections",
            stamp_ns=EPOCH_NS + t_ns,
            received_ns=EPOCH_NS + t_ns + 20 * MS,
            detections=tuple(
                Detection(
                    label=label,
                    score=0.8,
                    track_id=str(index),
                    box_px=[left, 4, left + 4 - 0.5 * index, 11],
                    position_m=[(left - 10) / 2.0, 0.1, 10.0 + index],
                )
                for index, (label, left) in enumerate(
                    zip(("car", "van", "bus", "car", "truck"), (0, 5, 10, 15, 20), strict=True), start=1
                )
            ),
        )

    def _position(self, t_ns: int) -> Claim:
        return PositionClaim(
            source="/gps",
            frame_id=self.position_frame,
            kind="gnss",
            stamp_ns=EPOCH_NS + t_ns,
            received_ns=EPOCH_NS + t_ns + 40 * MS,
            position_m=self.pose(t_ns)[0].t,
            covariance=np.eye(3) * 0.25,
        )


CurveMaker = Callable[..., Curve]


@pytest.fixture(scope="session")
def curve() -> CurveMaker:
    """Makes a `Curve`; the same arguments give the same object, for no attack may change it."""

    @lru_cache
    def make(
        frames: int = 30, body_axes: str = "flu", odometry_ms: int = 20, position_frame: str = "enu"
    ) -> Curve:
        return Curve(frames, body_axes, odometry_ms, position_frame)

    return make


def flat(value: Any) -> Any:
    """Nested tuples of plain values and bytes: equal if and only if every bit is."""
    if isinstance(value, np.ndarray):
        return (value.shape, value.dtype.str, value.tobytes())
    if is_dataclass(value):
        return (type(value).__name__, *(flat(getattr(value, field.name)) for field in fields(value)))
    return tuple(flat(item) for item in value) if isinstance(value, tuple) else value


@pytest.fixture(scope="session")
def bits() -> Callable[[Any], Any]:
    """A step, claim or list of them as comparable bits."""
    return lambda value: [flat(item) for item in value] if isinstance(value, list) else flat(value)


@pytest.fixture(scope="session")
def claims_of() -> Callable[..., list[Any]]:
    """All claims of a type (and source) of a recording, in the order in which they are handed out."""

    def collect(recording: Any, kind: type, source: str | None = None) -> list[Any]:
        return [
            claim
            for step in recording.steps()
            for claim in step.claims
            if isinstance(claim, kind) and source in (None, claim.source)
        ]

    return collect
