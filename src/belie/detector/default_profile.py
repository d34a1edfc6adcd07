"""The `default` profile: independent visual evidence, then every claim against it, each on its own.

The camera is looked at first; what it cannot vouch for, it does not judge. Its motion is estimated without any
claim. Odometry, twist and IMU are compared with that motion; positions with the trajectory that the camera vouches
for.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from belie.checks import CameraCheck, ImuCheck, OdometryCheck, PositionCheck
from belie.detector.alerts import Judgement
from belie.detector.config import Config
from belie.detector.eyes import Eyes
from belie.detector.object_habits import ObjectHabits
from belie.detector.object_view import ObjectView
from belie.detector.objects import ObjectStage
from belie.detector.seen_path import SeenPath
from belie.detector.streams import StreamKey, Streams
from belie.detector.trajectory import TrustedTrajectory
from belie.geometry import SE3
from belie.odometry import VisualOdometry
from belie.types import CheckResult, Claim, Frame, MountedCamera, Status, VisualEstimate

_TESTS = 4  # odometry, twist, IMU and position share the stated false-alarm rate
_DOUBT = 0.5  # of the threshold: evidence against the odometry that makes a position's accuser wait
_MOST_WAITED = 2  # claims
# Of the smallest lie that shows within a few frames: of a third nothing is left in a CUSUM, whose drift is half of what
# it looks for.
_TRACELESS = 1.0 / 3.0
_HIDDEN_FRAMES = 300  # kept to tell whether a position or the odometry lies
_STANDS_NS = 1_000_000_000
_MOST_WITHHELD = 3  # frames: so long may the camera's doubts about itself protect a claim


class DefaultProfile:
    """All checks by one camera."""

    def __init__(self, name: str, camera: MountedCamera, config: Config, *, eyes: Eyes | None = None) -> None:
        self._camera, self._config = camera, config
        self._odometry: Eyes = eyes or VisualOdometry(camera.model, config.visual_odometry, config.tracking)
        self._camera_check = CameraCheck(name, config.camera)
        self._motion_checks: dict[StreamKey, OdometryCheck | ImuCheck] = {}
        self._position_checks: dict[str, PositionCheck] = {}
        self._streams = Streams(config.streams)
        self._objects = ObjectStage(
            camera.model, config.objects, config.tracking, config.sequential.false_alarms_per_hour
        )
        self._trajectory = TrustedTrajectory(camera.T_body_cam)
        self._withheld = 0
        self._odometry_accused = False
        self._vouched_ns = 0
        self._standing: set[str] = set()  # positions that are accused
        self._hidden_m: deque[tuple[int, float]] = deque(maxlen=_HIDDEN_FRAMES)
        self._waited: dict[str, int] = {}
        self._last_positions: dict[str, tuple[int, CheckResult]] = {}
        self._flow_px_per_m = 0.0
        self._path = SeenPath()
        self._last_ns: int | None = None
        self._looked_at: tuple[Frame, bool, VisualEstimate | None] | None = None
        self.estimate: VisualEstimate | None = None
        self.T_odom_cam_claimed: SE3 | None = None

    @property
    def T_odom_cam_seen(self) -> SE3 | None:
        """Pose of the camera as the images tell it, in the claim's scale."""
        return self._trajectory.T_odom_cam_seen

    @property
    def objects(self) -> tuple[ObjectView, ...]:
        """The objects that detectors told of, as they stand after the last frame."""
        return self._objects.views

    def object_habits(self) -> dict[str, ObjectHabits]:
        """How each object detector errs, by source; see `Detector.object_habits`."""
        return self._objects.habits()

    def noise_scales(self) -> dict[str, dict[str, float]]:
        """How many times noisier than its model each component of each stream is, keyed ``check:source``."""
        return {
            f"{check}:{source}": judge.noise_scales()
            for (check, source), judge in self._motion_checks.items()
        }

    def look(self, frame: Frame) -> None:
        """Do what needs no claim: tell whether the image is usable, and how the camera has moved."""
        if self._looked_at is not None and self._looked_at[0] is frame:
            return
        unusable = self._camera_check.look(frame)
        self._looked_at = frame, unusable, None if unusable else self._odometry.update(frame)

    def update(self, frame: Frame, claims: Iterable[Claim]) -> list[Judgement]:
        """Judge every stream at this frame."""
        claims = tuple(claims)
        self._streams.take(claims, frame.stamp_ns)
        self._objects.take(claims, frame.stamp_ns)
        self._open_checks()
        # Kept until the frame is judged: if this raises, it may be asked for again, or the next one.
        self.look(frame)
        assert self._looked_at is not None
        _, unusable, self.estimate = self._looked_at
        estimate = self.estimate
        start_ns = self._last_ns if estimate is None else estimate.previous_stamp_ns
        motions = self._streams.motions(start_ns, frame.stamp_ns, self._camera.T_body_cam)
        seen = self._look_at_camera(frame, estimate, motions, start_ns)
        judgements = [Judgement(result=seen, onset_ns=self._camera_check.onset_ns)]
        if estimate is None or self._must_withhold(seen):
            judgements += self._withhold(f"not judged: {seen.reason}")
            self._path.add(None)
            self._note_blindness(frame, motions, judged=False)
            self._follow(frame, None)
            if estimate is None or seen.status is Status.CONTRADICTED:
                # No position is judged later by this frame; where the camera only doubts itself, it may wait.
                for source in self._position_checks:
                    self._streams.due_positions(source, frame.stamp_ns)
        else:
            self._path.add(estimate)
            judgements += [self._judge(key, T, estimate) for key, T in motions.items()]
            self._note_blindness(frame, motions, judged=True)
            self._follow(frame, estimate)
            judgements += [
                self._judge_positions(source, frame, estimate) for source in self._streams.positions
            ]
        judgements += self._objects.update(
            frame,
            estimate,
            self._odometry.scene(),
            doubted=self._why_objects_wait(unusable, seen),
            half=None if estimate is None else self._odometry.half(),
        )
        self._last_ns, self._looked_at = frame.stamp_ns, None
        pose = self._streams.odometry_pose(frame.stamp_ns)
        self.T_odom_cam_claimed = None if pose is None else pose @ self._camera.T_body_cam
        return corroborated(judgements)

    # -- the camera itself ---------------------------------------------------------------------------

    def _look_at_camera(
        self,
        frame: Frame,
        estimate: VisualEstimate | None,
        motions: dict[StreamKey, SE3 | None],
        start_ns: int | None,
    ) -> CheckResult:
        """Hold the image against the motion that each witness claims; pose and twist of a topic are one."""
        flows: dict[str, float] = {}
        speeds = []
        for (check, source), T in motions.items():
            if T is None or start_ns is None:
                continue
            flows[source] = min(self._flow_px(check, T), flows.get(source, math.inf))
            if check != "imu":
                speeds.append(float(np.linalg.norm(T.t)) / ((frame.stamp_ns - start_ns) * 1e-9))
        return self._camera_check.update(frame, estimate, flows, min(speeds, default=None))

    def _flow_px(self, check: str, T_prev_cur: SE3) -> float:
        """Displacement in px that the image should show under a claimed motion: rotation and parallax."""
        model = self._camera.model
        omega = np.abs(T_prev_cur.log()[3:])
        turning = math.hypot(omega[0] * model.fy, omega[1] * model.fx, omega[2] * 0.25 * model.width)
        moving = 0.0 if check == "imu" else float(np.linalg.norm(T_prev_cur.t)) * self._flow_px_per_m
        return math.hypot(turning, moving)

    def _learn_flow(self, estimate: VisualEstimate, T_prev_cur: SE3) -> None:
        distance = float(np.linalg.norm(T_prev_cur.t))
        if distance > 1e-3 and estimate.parallax_px > 1.0:
            ratio = estimate.parallax_px / distance
            self._flow_px_per_m += (ratio - self._flow_px_per_m) * (0.1 if self._flow_px_per_m else 1.0)

    @staticmethod
    def _why_objects_wait(unusable: bool, seen: CheckResult) -> str:
        """Objects are held against the pixels of this very image: a camera that lies is no witness."""
        return (seen.reason or "the image") if unusable or seen.status is Status.CONTRADICTED else ""

    def _must_withhold(self, seen: CheckResult) -> bool:
        """A camera that doubts itself judges nobody; but doubts without end must not shield a liar."""
        self._withheld = 0 if seen.status is Status.CONSISTENT else self._withheld + 1
        return seen.status is Status.CONTRADICTED or 0 < self._withheld <= _MOST_WITHHELD

    def _withhold(self, reason: str) -> list[Judgement]:
        results = [
            CheckResult(check=check, source=source, status=Status.UNDECIDED, unit="llr", reason=reason)
            for check, source in self._motion_checks
        ]
        results += [check.skip(reason) for check in self._position_checks.values()]
        return [Judgement(result=result) for result in results]

    # -- claims --------------------------------------------------------------------------------------

    def _open_checks(self) -> None:
        """A check for every stream that has spoken."""
        c = self._config
        for key in self._streams.motion_streams():
            if key in self._motion_checks:
                continue
            check, source = key
            self._motion_checks[key] = (
                ImuCheck(source, tests=_TESTS, settings=c.imu, sequential=c.sequential, noise=c.noise)
                if check == "imu"
                else OdometryCheck(
                    source, check, tests=_TESTS, settings=c.odometry, sequential=c.sequential, noise=c.noise
                )
            )
        for source in self._streams.positions:
            if source not in self._position_checks:
                self._position_checks[source] = self._new_position_check(source)

    def _odometry_may_lie(self, source: str) -> bool:
        """Whether a position must wait to be accused: while evidence against the odometry builds up."""
        doubts = [
            check.evidence.statistic / check.evidence.threshold
            for check in self._motion_checks.values()
            if isinstance(check, OdometryCheck) and check.evidence is not None
        ]
        if max(doubts, default=0.0) < _DOUBT:
            self._waited[source] = 0
            return False
        self._waited[source] = self._waited.get(source, 0) + 1
        return self._waited[source] <= _MOST_WAITED

    def _followed_odometry(self) -> tuple[StreamKey, OdometryCheck | None]:
        """The odometry that positions are held against, and its check, if there is one."""
        for key, check in self._motion_checks.items():
            if key[0] == "odometry":
                assert isinstance(check, OdometryCheck)
                return key, check
        return ("odometry", ""), None

    def _note_blindness(self, frame: Frame, motions: dict[StreamKey, SE3 | None], *, judged: bool) -> None:
        """Keep by how much the odometry may have lied since the last frame without a trace, m."""
        key, check = self._followed_odometry()
        T_prev_cur = motions.get(key)
        if check is None or T_prev_cur is None or self._last_ns is None:
            return
        hidden_m = float(np.linalg.norm(T_prev_cur.t))  # where nobody looked, all of it
        if judged and check.floor_m_s is not None:
            seconds = (frame.stamp_ns - self._last_ns) * 1e-9
            hidden_m = min(hidden_m, _TRACELESS * check.floor_m_s * seconds)
        self._hidden_m.append((frame.stamp_ns, hidden_m))

    def _may_be_the_odometry(self, check: PositionCheck) -> float | None:
        """What a lie of the odometry since the onset may come to unseen, m, where it explains what a position shows.

        Who was accused once stays accused: a jump does not grow while the odometry goes on.
        """
        if check.evidence is None or check.apart_m is None:
            self._standing.discard(check.source)
            return None
        if check.source in self._standing:
            return None
        # The first claim that differs tells of the way since the one before it.
        since_ns = check.evidence.onset_ns - check.interval_ns
        hidden_m = sum(m for stamp_ns, m in self._hidden_m if stamp_ns > since_ns)
        if check.apart_m < hidden_m:
            return hidden_m
        self._standing.add(check.source)
        return None

    def _new_position_check(self, source: str) -> PositionCheck:
        c = self._config
        return PositionCheck(source, tests=_TESTS, settings=c.position, sequential=c.sequential)

    def _judge(self, key: StreamKey, T_prev_cur: SE3 | None, estimate: VisualEstimate) -> Judgement:
        check = self._motion_checks[key]
        if isinstance(check, ImuCheck):
            result = check.update(estimate, None if T_prev_cur is None else T_prev_cur.R)
        else:
            since, T_since = estimate, T_prev_cur
            if T_prev_cur is None and key[0] == "odometry":
                since, T_since = self._over_gap(key[1], estimate)
            result = check.update(since, T_since, over_gap=T_since is not T_prev_cur)
            if result.status is Status.CONSISTENT and T_prev_cur is not None:
                self._learn_flow(estimate, T_prev_cur)
        if T_prev_cur is None and check.evidence is None and estimate.inliers > 0:
            why = self._streams.why_unknown(key)
            result = result if why is None else replace(result, reason=why)
        return Judgement(result=result, onset_ns=check.evidence.onset_ns if check.evidence else None)

    def _over_gap(self, source: str, estimate: VisualEstimate) -> tuple[VisualEstimate, SE3 | None]:
        """What was seen, and what a pose stream claims, since the last frame before a gap in its messages."""
        if self._streams.pose(source, estimate.stamp_ns) is not None:
            for since in self._path.stretches(estimate):
                T_since = self._streams.pose_motion(
                    source, since.previous_stamp_ns, estimate.stamp_ns, self._camera.T_body_cam
                )
                if T_since is not None:
                    return since, T_since
        return estimate, None

    def _follow(self, frame: Frame, estimate: VisualEstimate | None) -> None:
        """Extend the trusted trajectory: by the odometry's step while it is believed, else by the camera's."""
        _, check = self._followed_odometry()
        if check is None:
            return
        start_ns = self._trajectory.newest_ns
        if check.evidence is not None:  # untested, it stays as accused or as innocent as it was
            self._odometry_accused = check.evidence.contradicted
        seen: SE3 | None = None
        unit_m = check.metres_per_unit
        if estimate is not None and estimate.reason is None and unit_m is not None:
            T = estimate.T_prev_cur
            seen = SE3(T.R, T.t * unit_m) if estimate.previous_stamp_ns == start_ns else None
        claimed: SE3 | None = None
        if start_ns is not None and not self._odometry_accused:
            claimed = self._streams.odometry_motion(start_ns, frame.stamp_ns, self._camera.T_body_cam)
        if start_ns is not None and self._trajectory.extend(frame.stamp_ns, believed=claimed, seen=seen):
            return
        pose = self._streams.odometry_pose(frame.stamp_ns)
        if pose is not None:
            self._trajectory.begin(frame.stamp_ns, pose)
        for position in self._position_checks.values():
            position.skip("no trusted odometry", odometry_lost=True)

    def _judge_positions(self, source: str, frame: Frame, estimate: VisualEstimate) -> Judgement:
        check = self._position_checks[source]
        if estimate.inliers == 0:
            # A claim waits for the next frame that the camera vouches for, unless too long has gone by.
            lost = frame.stamp_ns - self._vouched_ns > _STANDS_NS
            if lost:
                self._streams.due_positions(source, frame.stamp_ns)
            reason = f"nobody vouches for the odometry: {estimate.reason}"
            return Judgement(result=check.skip(reason, odometry_lost=lost))
        due = self._streams.due_positions(source, frame.stamp_ns)
        self._vouched_ns = frame.stamp_ns
        if self._odometry_accused:
            # The camera alone drifts too far to accuse a position by; whatever was learned ends here.
            self._position_checks[source] = check = self._new_position_check(source)
            self._last_positions.pop(source, None)
            return Judgement(
                result=check.skip("the odometry is contradicted: there is nothing to hold it against")
            )
        result: CheckResult | None = None
        for claim in due:
            T_odom_body = self._trajectory.at(claim.stamp_ns)
            if T_odom_body is None:
                continue
            shares_axes = bool(claim.frame_id) and claim.frame_id == self._streams.odom_frame
            answer = check.update(claim, T_odom_body, shares_axes=shares_axes)
            if result is None or result.status is not Status.CONTRADICTED:
                result = answer
        if result is not None and result.status is Status.CONTRADICTED and self._odometry_may_lie(source):
            reason = f"{result.reason}; or the odometry lies: waiting for its own check"
            result = replace(result, status=Status.UNDECIDED, reason=reason)
        elif result is not None and result.status is Status.CONTRADICTED:
            hidden_m = self._may_be_the_odometry(check)
            if hidden_m is not None:
                reason = f"{result.reason}; or the odometry lies: the camera would not see {hidden_m:.2g} m of that"
                result = replace(result, status=Status.UNDECIDED, reason=reason)
        if check.apart_m is None:
            self._standing.discard(source)
        if result is not None:
            self._last_positions[source] = frame.stamp_ns, result
        elif due:
            result = check.skip("no trusted odometry")
        else:
            result = self._between_claims(source, frame)
        return Judgement(result=result, onset_ns=check.evidence.onset_ns if check.evidence else None)

    def _between_claims(self, source: str, frame: Frame) -> CheckResult:
        """Positions come more seldom than images: the last answer stands until it is a second old."""
        stamp_ns, last = self._last_positions.get(source, (0, None))
        if last is not None and frame.stamp_ns - stamp_ns <= _STANDS_NS:
            return last
        return self._position_checks[source].skip("no claim")


def corroborated(judgements: list[Judgement]) -> list[Judgement]:
    """Say with every accusation of a motion who sides with the camera, and who is accused with it.

    >>> lie = CheckResult(check="odometry", source="/odom", status=Status.CONTRADICTED, reason="differs")
    >>> truth = CheckResult(check="imu", source="/imu", status=Status.CONSISTENT)
    >>> corroborated([Judgement(result=lie), Judgement(result=truth)])[0].result.reason
    'differs; /imu sides with the camera'
    """
    motions = [j.result for j in judgements if j.result.check in ("odometry", "twist", "imu")]
    accused = [result for result in motions if result.status is Status.CONTRADICTED]
    sources = sorted({result.source for result in accused})
    siding = sorted({r.source for r in motions if r.status is Status.CONSISTENT} - set(sources))
    if siding:
        note = f"; {', '.join(siding)} sides with the camera"
    elif len(sources) > 1:
        note = f"; {' and '.join(sources)} both differ from the camera"
    else:
        return judgements
    return [
        replace(j, result=replace(j.result, reason=j.result.reason + note)) if j.result in accused else j
        for j in judgements
    ]
