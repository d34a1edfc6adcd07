"""The `default` profile: independent visual evidence, then every claim against it, each on its own.

The camera is looked at first; what it cannot vouch for, it does not judge. Its motion is estimated without any
claim. Odometry, twist and IMU are compared with that motion; positions with the trajectory that the camera
vouches for: the odometry's steps while they are believed, the camera's own steps where they are not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from belie.checks import CameraCheck, ImuCheck, OdometryCheck, PositionCheck
from belie.detector.alerts import Judgement
from belie.detector.claim_buffer import ClaimBuffer, motion_between, pose_at
from belie.detector.config import Config
from belie.geometry import SE3
from belie.odometry import VisualOdometry
from belie.types import (
    CheckResult,
    Claim,
    Frame,
    MotionClaim,
    MountedCamera,
    PoseClaim,
    PositionClaim,
    Status,
    VisualEstimate,
)

_TESTS = 4  # odometry, twist, IMU and position share the stated false-alarm rate
_MOST_WITHHELD = 3  # frames: so long may the camera's doubts about itself protect a claim


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Trusted:
    """A pose of the trajectory that the camera vouches for."""

    stamp_ns: int
    T_odom_body: SE3


class DefaultProfile:
    """All checks of one camera, with the buffers of the claims that they judge."""

    def __init__(self, name: str, camera: MountedCamera, config: Config) -> None:
        self._camera, self._config = camera, config
        self.odometry = VisualOdometry(camera.model, config.visual_odometry, config.tracking)
        self._camera_check = CameraCheck(name, config.camera)
        self._poses: dict[str, ClaimBuffer[PoseClaim]] = {}
        self._motions: dict[tuple[str, str], ClaimBuffer[MotionClaim]] = {}
        self._positions: dict[str, list[PositionClaim]] = {}
        self._checks: dict[tuple[str, str], OdometryCheck | ImuCheck] = {}
        self._position_checks: dict[str, PositionCheck] = {}
        self._trusted: ClaimBuffer[_Trusted] = ClaimBuffer()
        self._odom_frame = ""
        self._withheld = 0
        self._flow_px_per_m = 0.0
        self._last_ns: int | None = None
        self.estimate: VisualEstimate | None = None
        self.T_odom_cam_claimed: SE3 | None = None
        self.T_odom_cam_seen: SE3 | None = None

    # -- one frame ---------------------------------------------------------------------------------

    def update(self, frame: Frame, claims: Iterable[Claim]) -> list[Judgement]:
        """Judge every stream at this frame."""
        self._take(claims)
        unusable = self._camera_check.look(frame)
        self.estimate = estimate = None if unusable else self.odometry.update(frame)
        start_ns = estimate.previous_stamp_ns if estimate is not None else self._last_ns
        motions = self._claimed_motions(start_ns, frame.stamp_ns)
        flows = {f"{source}:{check}": self._flow_px(T, check) for (check, source), T in motions.items() if T}
        seen = self._camera_check.update(frame, estimate, flows)
        judgements = [Judgement(result=seen, onset_ns=self._camera_check.onset_ns)]
        if seen.status is Status.CONSISTENT:
            self._withheld = 0
        else:
            self._withheld += 1
        # A camera that doubts itself judges nobody; but doubts without end must not shield a liar.
        withheld = seen.status is Status.CONTRADICTED or 0 < self._withheld <= _MOST_WITHHELD
        if estimate is None or withheld:
            judgements += self._withhold(f"not judged: {seen.reason}")
            if estimate is not None or seen.status is Status.CONTRADICTED:
                self._follow(frame, motions, None)
        else:
            results = [self._judge(key, T, estimate) for key, T in motions.items()]
            judgements += results
            self._follow(frame, motions, estimate)
            judgements += self._judge_positions(frame, estimate)
        self._last_ns = frame.stamp_ns
        self._note_poses(frame)
        return _corroborated(judgements)

    # -- claims ------------------------------------------------------------------------------------

    def _take(self, claims: Iterable[Claim]) -> None:
        c = self._config
        shared = {"tests": _TESTS, "sequential": c.sequential, "noise": c.noise}
        for claim in claims:
            source = claim.source
            if isinstance(claim, PoseClaim):
                self._odom_frame = self._odom_frame or claim.frame_id
                self._poses.setdefault(source, ClaimBuffer()).add(claim)
                if ("odometry", source) not in self._checks:
                    self._checks["odometry", source] = OdometryCheck(
                        source, "odometry", settings=c.odometry, **shared
                    )
            elif isinstance(claim, MotionClaim):
                check = claim.kind
                self._motions.setdefault((check, source), ClaimBuffer()).add(claim)
                if (check, source) not in self._checks:
                    self._checks[check, source] = (
                        ImuCheck(source, settings=c.imu, **shared)
                        if check == "imu"
                        else OdometryCheck(source, "twist", settings=c.odometry, **shared)
                    )
            else:
                self._positions.setdefault(source, []).append(claim)
                if source not in self._position_checks:
                    self._position_checks[source] = PositionCheck(source, settings=c.position, **shared)

    def _claimed_motions(self, start_ns: int | None, stop_ns: int) -> dict[tuple[str, str], SE3 | None]:
        """What each stream says of the camera's motion between two stamps, ``T_prev_cur``."""
        motions: dict[tuple[str, str], SE3 | None] = dict.fromkeys(self._checks)
        if start_ns is None or start_ns >= stop_ns:
            return motions
        T_body_cam = self._camera.T_body_cam
        for check, source in self._checks:
            T_body: SE3 | None = None
            if check == "odometry":
                buffer = self._poses[source]
                before, after = pose_at(buffer, start_ns), pose_at(buffer, stop_ns)
                T_body = before.inverse() @ after if before is not None and after is not None else None
            else:
                integrated = motion_between(self._motions[check, source], start_ns, stop_ns)
                if integrated is not None and (check == "imu" or integrated[1] is not None):
                    R, t = integrated
                    T_body = SE3(R, np.zeros(3) if t is None else t)
            if T_body is not None:
                motions[check, source] = T_body_cam.inverse() @ T_body @ T_body_cam
        return motions

    def _flow_px(self, T_prev_cur: SE3, check: str) -> float:
        """Displacement in px that the image should show under a claimed motion: rotation and parallax."""
        model = self._camera.model
        omega = np.abs(T_prev_cur.log()[3:])
        turning = math.hypot(omega[0] * model.fy, omega[1] * model.fx, omega[2] * 0.25 * model.width)
        moving = 0.0 if check == "imu" else float(np.linalg.norm(T_prev_cur.t)) * self._flow_px_per_m
        return math.hypot(turning, moving)

    # -- judging -----------------------------------------------------------------------------------

    def _judge(self, key: tuple[str, str], T: SE3 | None, estimate: VisualEstimate) -> Judgement:
        check = self._checks[key]
        if isinstance(check, ImuCheck):
            result = check.update(estimate, None if T is None else T.R)
        else:
            result = check.update(estimate, T)
            if result.status is Status.CONSISTENT and T is not None:
                self._learn_flow(estimate, T)
        return Judgement(result=result, onset_ns=check.evidence.onset_ns if check.evidence else None)

    def _learn_flow(self, estimate: VisualEstimate, T: SE3) -> None:
        distance = float(np.linalg.norm(T.t))
        if distance > 1e-3 and estimate.parallax_px > 1.0:
            ratio = estimate.parallax_px / distance
            self._flow_px_per_m += (ratio - self._flow_px_per_m) * (0.1 if self._flow_px_per_m else 1.0)

    def _withhold(self, reason: str) -> list[Judgement]:
        results = [
            CheckResult(check=check, source=source, status=Status.UNDECIDED, unit="llr", reason=reason)
            for check, source in self._checks
        ]
        results += [check.skip(reason) for check in self._position_checks.values()]
        return [Judgement(result=result) for result in results]

    def _judge_positions(self, frame: Frame, estimate: VisualEstimate) -> list[Judgement]:
        judgements = []
        for source, check in self._position_checks.items():
            waiting = sorted(self._positions[source], key=lambda claim: claim.stamp_ns)
            due = [claim for claim in waiting if claim.stamp_ns <= frame.stamp_ns]
            self._positions[source] = waiting[len(due) :]
            result: CheckResult | None = None
            for claim in due:
                T_odom_body = pose_at(self._trusted, claim.stamp_ns)
                if T_odom_body is None:
                    continue
                answer = check.update(
                    claim,
                    T_odom_body,
                    shares_axes=bool(claim.frame_id) and claim.frame_id == self._odom_frame,
                )
                if (
                    result is None
                    or answer.status is Status.CONTRADICTED
                    or result.status is not Status.CONTRADICTED
                ):
                    result = answer
            if result is None:
                result = check.skip("no claim since the last frame" if not due else "no trusted odometry")
            elif estimate.inliers == 0 and result.status is Status.CONSISTENT:
                result = check.skip(f"nobody vouches for the odometry: {estimate.reason}")
            judgements.append(
                Judgement(result=result, onset_ns=check.evidence.onset_ns if check.evidence else None)
            )
        return judgements

    # -- the trajectory that the camera vouches for --------------------------------------------------

    def _odometry_check(self) -> tuple[str, OdometryCheck] | None:
        for (check, source), judge in self._checks.items():
            if check == "odometry" and isinstance(judge, OdometryCheck):
                return source, judge
        return None

    def _follow(
        self, frame: Frame, motions: dict[tuple[str, str], SE3 | None], estimate: VisualEstimate | None
    ) -> None:
        """Extend the trusted trajectory: by the odometry's step while it is believed, else by the camera's."""
        found = self._odometry_check()
        if found is None:
            return
        source, check = found
        T_body_cam = self._camera.T_body_cam
        claimed = motions["odometry", source]
        T_seen = self._seen_step(estimate, check)
        last = self._trusted.newest()
        if last is None:
            pose = pose_at(self._poses[source], frame.stamp_ns)
            if pose is not None:
                self._trusted.add(_Trusted(stamp_ns=frame.stamp_ns, T_odom_body=pose))
                self.T_odom_cam_seen = pose @ T_body_cam
            return
        believed = check.evidence is None or not check.evidence.contradicted
        step = claimed if believed and claimed is not None else T_seen
        if step is not None:
            T_odom_body = last.T_odom_body @ T_body_cam @ step @ T_body_cam.inverse()
            self._trusted.add(_Trusted(stamp_ns=frame.stamp_ns, T_odom_body=T_odom_body))
        if self.T_odom_cam_seen is not None:
            shown = T_seen if T_seen is not None else step
            self.T_odom_cam_seen = self.T_odom_cam_seen @ shown if shown is not None else self.T_odom_cam_seen

    def _seen_step(self, estimate: VisualEstimate | None, check: OdometryCheck) -> SE3 | None:
        if estimate is None or estimate.reason is not None or check.metres_per_unit is None:
            return None
        T = estimate.T_prev_cur
        return SE3(T.R, T.t * check.metres_per_unit)

    def _note_poses(self, frame: Frame) -> None:
        found = self._odometry_check()
        pose = pose_at(self._poses[found[0]], frame.stamp_ns) if found else None
        self.T_odom_cam_claimed = None if pose is None else pose @ self._camera.T_body_cam

    def noise_scales(self) -> dict[str, dict[str, float]]:
        """How many times noisier than its model each component of each stream is, keyed ``check:source``."""
        return {f"{check}:{source}": judge.noise_scales() for (check, source), judge in self._checks.items()}


def _corroborated(judgements: list[Judgement]) -> list[Judgement]:
    """Say with every accusation of a motion who sides with the camera, and who with the accused."""
    motion = [j.result for j in judgements if j.result.check in ("odometry", "twist", "imu")]
    accused = [r for r in motion if r.status is Status.CONTRADICTED]
    if not accused:
        return judgements
    siding = sorted({r.source for r in motion if r.status is Status.CONSISTENT} - {r.source for r in accused})
    sources = {r.source for r in accused}
    if siding:
        note = f"; {', '.join(siding)} sides with the camera"
    elif len(sources) > 1:
        note = f"; {' and '.join(sorted(sources))} both differ from the camera"
    else:
        return judgements
    return [
        Judgement(result=_with_note(j.result, note), onset_ns=j.onset_ns) if j.result in accused else j
        for j in judgements
    ]


def _with_note(result: CheckResult, note: str) -> CheckResult:
    return CheckResult(**(result.to_json() | {"reason": result.reason + note}))
