"""The trajectory that the camera vouches for: the odometry's steps while believed, the camera's where not."""

from __future__ import annotations

from dataclasses import dataclass

from belie.detector.claim_buffer import ClaimBuffer, pose_at
from belie.geometry import SE3

_LONGEST_GAP_NS = 1_000_000_000  # between two frames that a position may be interpolated in


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Pose:
    stamp_ns: int
    T_odom_body: SE3


class TrustedTrajectory:
    """Grows by one step a frame; positions are judged against it.

    Examples
    --------
    >>> trajectory = TrustedTrajectory(SE3.identity())
    >>> trajectory.begin(0, SE3.identity())
    >>> _ = trajectory.extend(10**8, believed=None, seen=SE3.from_translation([0.0, 0.0, 1.0]))
    >>> trajectory.at(5 * 10**7).t
    array([0. , 0. , 0.5])
    """

    def __init__(self, T_body_cam: SE3) -> None:
        self._T_body_cam = T_body_cam
        self._poses: ClaimBuffer[_Pose] = ClaimBuffer(_LONGEST_GAP_NS)
        self.T_odom_cam_seen: SE3 | None = None

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the latest pose, or None while there is none."""
        last = self._poses.newest()
        return None if last is None else last.stamp_ns

    def begin(self, stamp_ns: int, T_odom_body: SE3) -> None:
        """Start, or start anew after a gap, where the odometry says that the robot is."""
        self._poses = ClaimBuffer(_LONGEST_GAP_NS)
        self._poses.add(_Pose(stamp_ns=stamp_ns, T_odom_body=T_odom_body))
        self.T_odom_cam_seen = T_odom_body @ self._T_body_cam

    def extend(self, stamp_ns: int, *, believed: SE3 | None, seen: SE3 | None) -> bool:
        """Add the camera's motion ``T_prev_cur``: as claimed where `believed`, else as `seen`; metres.

        False where neither is known: what was travelled then is lost, and the trajectory must begin anew.
        """
        step = believed if believed is not None else seen
        last = self._poses.newest()
        if step is None or last is None:
            return False
        T_odom_body = last.T_odom_body @ self._T_body_cam @ step @ self._T_body_cam.inverse()
        self._poses.add(_Pose(stamp_ns=stamp_ns, T_odom_body=T_odom_body))
        if self.T_odom_cam_seen is not None:
            self.T_odom_cam_seen = self.T_odom_cam_seen @ (seen if seen is not None else step)
        return True

    def at(self, stamp_ns: int) -> SE3 | None:
        """``T_odom_body`` at a stamp, or None where the trajectory does not reach."""
        return pose_at(self._poses, stamp_ns)
