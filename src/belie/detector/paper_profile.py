"""The `paper` profile: section III-B to the letter; the baseline that we measure ourselves against."""

from __future__ import annotations

from collections.abc import Iterable

from belie.checks import paper_odometry_check, paper_position_check
from belie.detector.alerts import Judgement
from belie.detector.claim_buffer import ClaimBuffer, pose_at
from belie.detector.config import Config
from belie.detector.object_view import ObjectView
from belie.geometry import SE3
from belie.odometry import PaperOdometry
from belie.types import Claim, Frame, MountedCamera, PoseClaim, PositionClaim, VisualEstimate


class PaperProfile:
    """One odometry stream builds the map and is judged by e^G; positions are judged by their step."""

    def __init__(self, name: str, camera: MountedCamera, config: Config) -> None:
        self._camera, self._config = camera, config
        self.odometry = PaperOdometry(camera, config.paper_odometry)
        self._poses: dict[str, ClaimBuffer[PoseClaim]] = {}
        self._positions: dict[str, list[PositionClaim]] = {}
        self.estimate: VisualEstimate | None = None
        self.T_odom_cam_claimed: SE3 | None = None
        self.T_odom_cam_seen: SE3 | None = None

    def update(self, frame: Frame, claims: Iterable[Claim]) -> list[Judgement]:
        """Judge the first odometry stream and every position stream at this frame."""
        for claim in claims:
            if isinstance(claim, PoseClaim):
                self._poses.setdefault(claim.source, ClaimBuffer()).add(claim)
            elif isinstance(claim, PositionClaim):
                self._positions.setdefault(claim.source, []).append(claim)
        source = next(iter(self._poses), "")
        pose = pose_at(self._poses[source], frame.stamp_ns) if source else None
        claimed = None if pose is None else pose @ self._camera.T_body_cam
        estimate = self.odometry.update(frame, claimed)
        if self.T_odom_cam_claimed is not None and estimate.reason is None:
            self.T_odom_cam_seen = self.T_odom_cam_claimed @ estimate.T_prev_cur
        self.estimate, self.T_odom_cam_claimed = estimate, claimed
        results = [paper_odometry_check(estimate, source, self._config.paper)] if source else []
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
        return [Judgement(result=result) for result in results]

    @property
    def objects(self) -> tuple[ObjectView, ...]:
        """No object is followed in this profile."""
        return ()

    def noise_scales(self) -> dict[str, dict[str, float]]:
        """Nothing is learned in this profile."""
        return {}
