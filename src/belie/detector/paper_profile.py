"""The `paper` profile: section III to the letter; the baseline that we measure ourselves against."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from belie.checks import paper_odometry_check, paper_position_check
from belie.detector.alerts import Judgement
from belie.detector.claim_buffer import ClaimBuffer, pose_at
from belie.detector.config import Config
from belie.detector.object_habits import ObjectHabits
from belie.detector.object_view import ObjectView
from belie.detector.paper_objects import PaperObjectStage
from belie.detector.streams import too_seldom
from belie.geometry import SE3
from belie.odometry import LocalConsistency, PaperOdometry
from belie.types import (
    Claim,
    DetectionClaim,
    Frame,
    MountedCamera,
    PoseClaim,
    PositionClaim,
    VisualEstimate,
)


class PaperProfile:
    """One odometry stream builds the map and is judged by e^G, positions by their step, objects by e^L."""

    def __init__(self, name: str, camera: MountedCamera, config: Config) -> None:
        self._camera, self._config = camera, config
        self.odometry = PaperOdometry(camera, config.paper_odometry)
        self._local = LocalConsistency(camera.model, config.paper_odometry)
        self._objects = PaperObjectStage(camera.model, config.paper)
        self._poses: dict[str, ClaimBuffer[PoseClaim]] = {}
        self._positions: dict[str, list[PositionClaim]] = {}
        self.estimate: VisualEstimate | None = None
        self.T_odom_cam_claimed: SE3 | None = None
        self.T_odom_cam_seen: SE3 | None = None

    def update(self, frame: Frame, claims: Iterable[Claim]) -> list[Judgement]:
        """Judge the first odometry stream, every position stream and every detector at this frame."""
        gap_ns = self._config.streams.longest_gap_ns
        for claim in claims:
            if isinstance(claim, PoseClaim):
                self._poses.setdefault(claim.source, ClaimBuffer(gap_ns)).add(claim)
            elif isinstance(claim, PositionClaim):
                self._positions.setdefault(claim.source, []).append(claim)
            elif isinstance(claim, DetectionClaim):
                self._objects.take([claim])
        source = next(iter(self._poses), "")
        pose = pose_at(self._poses[source], frame.stamp_ns) if source else None
        claimed = None if pose is None else pose @ self._camera.T_body_cam
        estimate = self.odometry.update(frame, claimed)
        if self.T_odom_cam_claimed is not None and estimate.reason is None:
            self.T_odom_cam_seen = self.T_odom_cam_claimed @ estimate.T_prev_cur
        untold = claimed is None or self.T_odom_cam_claimed is None
        self.estimate, self.T_odom_cam_claimed = estimate, claimed
        results = [paper_odometry_check(estimate, source, self._config.paper)] if source else []
        if untold and source and (why := too_seldom(self._poses[source])):
            results = [replace(results[0], reason=why)]
        for claims_of_one in self._positions.values():
            due = sorted(
                (c for c in claims_of_one if c.stamp_ns <= frame.stamp_ns), key=lambda claim: claim.stamp_ns
            )
            for i, claim in enumerate(due):
                previous = due[i - 1] if i else None
                if previous is not None or len(due) == 1:
                    results.append(paper_position_check(estimate, previous, claim, self._config.paper))
            for old in due[:-1]:  # the last one stays, for the next step
                claims_of_one.remove(old)
        return [*(Judgement(result=result) for result in results), *self._judge_objects(frame)]

    def _judge_objects(self, frame: Frame) -> list[Judgement]:
        """Section III-C, with the corners that the odometry extracted."""
        features = self.odometry.features
        if features is None or not self._objects.streams:
            return []
        self._local.observe(self.odometry.pyramid, features)
        return self._objects.update(frame.stamp_ns, self._local)

    @property
    def objects(self) -> tuple[ObjectView, ...]:
        """Films are drawn from what the default profile follows; this one keeps no pixels."""
        return ()

    def object_habits(self) -> dict[str, ObjectHabits]:
        """Nothing is learned in this profile."""
        return {}

    def noise_scales(self) -> dict[str, dict[str, float]]:
        """Nothing is learned in this profile."""
        return {}
