"""A scripted detector and a made recording: runs whose outcome is known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from belie.evaluation.run import Run, run_detector
from belie.geometry import SE3, CameraModel
from belie.recordings import JoinCounts
from belie.types import (
    Alert,
    AlertType,
    CheckResult,
    Frame,
    MountedCamera,
    PoseClaim,
    PositionClaim,
    Settings,
    Status,
    Step,
    Verdict,
    VisualEstimate,
)

FRAME_NS = 100_000_000
START_NS = 1_700_000_000_000_000_000
CAMERA = CameraModel(width=160, height=120, fx=100, fy=100, cx=79.5, cy=59.5)
MOUNTED = {"/image": MountedCamera(model=CAMERA, T_body_cam=SE3.identity())}


class MadeRecording:
    """Frames at 10 Hz along z, with odometry, and GNSS in axes of its own."""

    path = Path("made.mcap")
    format = "made"
    body_axes = "rdf"
    cameras = MOUNTED

    def __init__(self, frames: int) -> None:
        self.join_counts = JoinCounts()
        self._frames = frames

    def frame_stamps_ns(self):
        return START_NS + np.arange(self._frames) * FRAME_NS

    def steps(self):
        image = np.random.default_rng(0).integers(0, 256, (120, 160), dtype=np.uint8)
        for k in range(self._frames):
            stamp_ns = START_NS + k * FRAME_NS
            at = {"stamp_ns": stamp_ns, "received_ns": stamp_ns}
            pose = PoseClaim(
                source="/odom", frame_id="odom", T_odom_body=SE3.from_translation([0, 0, 0.5 * k]), **at
            )
            fix = PositionClaim(
                source="/gnss",
                frame_id="enu",
                kind="gnss",
                position_m=[7.0 + 0.5 * k, 3.0, 100.0],
                **at,
            )
            if k == 3:
                self.join_counts.late["/gnss"] += 1
            yield Step(frame=Frame(camera="/image", image=image, **at), claims=(pose, fix), decode_ms=2.0)


class ScriptedDetector:
    """Undecided for five frames, then consistent; contradicts from `onset` + 2 to `end`."""

    def __init__(self, onset: int | None = None, end: int = 10**9) -> None:
        self.onset, self.end = onset, end
        self.objects = ()
        self.estimate: VisualEstimate | None = None
        self.T_odom_cam_claimed: SE3 | None = None
        self.T_odom_cam_seen: SE3 | None = None
        self._frame = 0

    def update(self, frame, claims) -> Verdict:
        k, self._frame = self._frame, self._frame + 1
        pose = next(claim for claim in claims if isinstance(claim, PoseClaim))
        self.T_odom_cam_claimed = pose.T_odom_body
        drift = 0.0 if self.onset is None else max(0.0, 0.2 * (k - self.onset + 1))
        self.T_odom_cam_seen = pose.T_odom_body @ SE3.from_translation([drift, 0, 0])
        px = np.array([[40.0, 30.0], [100.0, 80.0]])
        self.estimate = VisualEstimate(
            stamp_ns=frame.stamp_ns,
            previous_stamp_ns=frame.stamp_ns - FRAME_NS,
            T_prev_cur=SE3.identity(),
            covariance=np.eye(6),
            corners=2,
            matches=2,
            inliers=2,
            parallax_px=1.0,
            observed_px=px,
            predicted_px=px + np.array([3.0, 4.0]),
        )
        lies = self.onset is not None and self.onset + 2 <= k < self.end
        status = Status.UNDECIDED if k < 5 else Status.CONTRADICTED if lies else Status.CONSISTENT
        odometry = CheckResult(
            check="odometry",
            source="/odom",
            status=status,
            statistic=None if k < 5 else 30.0 if lies else 5.0,
            threshold=20.0,
            unit="llr",
            floor="0.1 m/s, 0.5 deg/s",
            reason=f"learning: {5 - k} more frames" if k < 5 else "sideways" if lies else "agree",
        )
        alerts = ()
        if self.onset is not None and k == self.onset + 2:
            onset_ns = START_NS + self.onset * FRAME_NS
            alerts = (Alert(type=AlertType.ODOMETRY_SPOOFING, source="/odom", onset_ns=onset_ns),)
        return Verdict(
            frame=k, stamp_ns=frame.stamp_ns, status=status, latency_ms=4.0, checks=(odometry,), alerts=alerts
        )


@pytest.fixture
def made_run() -> Callable[..., Run]:
    def make(frames: int = 60, onset: int | None = None, end: int = 10**9, config=None, **kwargs) -> Run:
        detector = ScriptedDetector(onset, end)
        return run_detector(MadeRecording(frames), config or Settings(), detector=detector, **kwargs)

    return make


@pytest.fixture
def made() -> SimpleNamespace:
    return SimpleNamespace(
        Recording=MadeRecording, Detector=ScriptedDetector, camera=CAMERA, start_ns=START_NS
    )
