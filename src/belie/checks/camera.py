"""The camera itself: frozen, replayed, black or covered.

A camera is accused of what no honest one shows: images that repeat while the robot is claimed to move, an
old sequence entered from elsewhere, a scene that is gone from one frame to the next and does not come back.
What may be honest (dusk, fog, a wall, a lone duplicate, one claim against a plausible stop) is UNDECIDED.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median

import numpy as np

from belie.checks.blankness import Blankness
from belie.checks.camera_settings import CameraSettings
from belie.checks.image_signature import ImageSignature, image_signature
from belie.checks.replay import ReplaySearch
from belie.checks.stillness import Stillness
from belie.types import CheckResult, Frame, Status, VisualEstimate

_LEAST_KNOWN = 4  # images before a median of them means anything


@dataclass(frozen=True, slots=True, kw_only=True)
class _Finding:
    status: Status
    reason: str
    statistic: float
    threshold: float
    since_ns: int
    unit: str = "frames"


class CameraCheck:
    """Judges one camera: `look` at each image first, `update` with the claims of the same frame after.

    Parameters
    ----------
    source : str
        The camera's topic.
    settings : CameraSettings or None

    Examples
    --------
    >>> check = CameraCheck("/image")
    >>> rng = np.random.default_rng(0)
    >>> scenes = [np.kron(rng.integers(0, 256, (18, 32)), np.ones((6, 6))).astype(np.uint8) for _ in range(9)]
    >>> for k, image in enumerate([*scenes, scenes[-1], scenes[-1]]):
    ...     frame = Frame(camera="/image", stamp_ns=k * 10**8, received_ns=0, image=image)
    ...     unusable = check.look(frame)
    ...     result = check.update(frame, None, {"/odom": 9.0, "/imu": 4.0})
    >>> unusable, result.status.value, check.onset_ns
    (True, 'contradicted', 900000000)
    >>> result.reason
    'frozen: 2 frames without a change, while /odom and /imu say that the image moves'
    """

    def __init__(self, source: str, settings: CameraSettings | None = None) -> None:
        self.source = source
        self.settings = s = settings or CameraSettings()
        self._stillness = Stillness(s.stillness)
        self._replays = ReplaySearch(s)
        self._blankness = Blankness(s)
        self._path_px = 0.0
        self._inliers: deque[int] = deque(maxlen=2 * _LEAST_KNOWN)
        self._signature: ImageSignature | None = None
        self._stamp_ns, self._interval_s = -1, 0.0
        self._fault: _Finding | None = None
        self._fault_seen_ns = 0
        self._speed_m_s: float | None = None

    @property
    def onset_ns(self) -> int | None:
        """When the present fault began; None where there is none."""
        return None if self._fault is None else self._fault.since_ns

    # -- the image alone ---------------------------------------------------------------------------

    def look(self, frame: Frame) -> bool:
        """Take in the image; True if nobody must be judged by it (a repeat, blank, suddenly motionless)."""
        before = self._signature
        self._signature = signature = image_signature(frame.image)
        self._interval_s = max(0.0, (frame.stamp_ns - self._stamp_ns) * 1e-9) if before is not None else 0.0
        self._stamp_ns = frame.stamp_ns
        blank = self._blankness.look(signature, frame.stamp_ns)
        unchanged = self._stillness.look(signature, frame.stamp_ns)
        replayed = self._replays.look(
            signature, before, frame.stamp_ns, self._path_px, blank=blank, unchanged=unchanged
        )
        run = self._stillness.run
        stopped = run is not None and (self._stillness.repeated or bool(run.movers) or self._sudden())
        return blank or replayed or stopped

    def _sudden(self) -> bool:
        run = self._stillness.run
        return run is not None and run.count == 1 and (run.abrupt or run.after_cut)

    # -- image and claims --------------------------------------------------------------------------

    def update(
        self,
        frame: Frame,
        estimate: VisualEstimate | None,
        claimed_flow_px: Mapping[str, float],
        speed_m_s: float | None = None,
    ) -> CheckResult:
        """Judge the camera by the image that `look` has just taken in.

        Parameters
        ----------
        estimate : VisualEstimate or None
            None where the odometry was spared this image.
        claimed_flow_px : mapping of str to float
            For each *independent* stream, by how much the image should have moved since the last frame if the
            claim were true: median displacement, full-resolution px. Two keys count as two witnesses.
        speed_m_s : float or None
            The slowest speed that is claimed now; tells whether a sudden stop is possible.

        Raises
        ------
        ValueError
            If `look` has not taken in this frame, or a displacement is negative or not a number.
        """
        signature = self._signature
        if signature is None or frame.stamp_ns != self._stamp_ns:
            raise ValueError("look(frame) must be called before update(frame, ...)")
        if any(not 0.0 <= flow < np.inf for flow in claimed_flow_px.values()):
            raise ValueError(
                f"claimed displacements must be numbers of 0 or more, got {dict(claimed_flow_px)}"
            )
        cut = self._is_cut(estimate)
        typical = not (cut or self._blankness.is_or_was)
        self._stillness.compare(claimed_flow_px, frame.stamp_ns, cut=cut, typical=typical)
        fastest = max(claimed_flow_px.values(), default=0.0)
        if fastest >= self.settings.stillness.moving_px:
            self._path_px += fastest
        finding = self._find(signature, estimate, bool(claimed_flow_px))
        if self._stillness.run is None:
            self._speed_m_s = speed_m_s
        return self._answer(self._hold(finding, frame.stamp_ns))

    def _is_cut(self, estimate: VisualEstimate | None) -> bool:
        """Whether the corners of the scene were lost at once."""
        if estimate is None:
            return False
        usual = float(median(self._inliers)) if len(self._inliers) >= _LEAST_KNOWN else 0.0
        cut = estimate.inliers < self.settings.lost_ratio * usual
        if not cut and estimate.inliers > 0:
            self._inliers.append(estimate.inliers)
        return cut

    def _find(self, signature: ImageSignature, estimate: VisualEstimate | None, claimed: bool) -> _Finding:
        return (
            self._find_blank(signature)
            or self._find_replay(claimed)
            or self._find_stillness()
            or self._find_nothing(estimate)
        )

    def _find_blank(self, signature: ImageSignature) -> _Finding | None:
        blank = self._blankness.run
        if blank is None:
            return None
        look = "dark" if signature.mean_gray < 30.0 else "white" if signature.mean_gray > 225.0 else "blank"
        seen = f"{look}: gray values vary by {signature.spread_gray:.1f} about {signature.mean_gray:.0f}"
        if not blank.abrupt:
            return self._undecided(f"{seen} (night, fog, a wall or a cover)", blank.since_ns, blank.count)
        if blank.count < self.settings.blank_frames:
            return self._undecided(f"{seen}, all at once", blank.since_ns, blank.count)
        return _Finding(
            status=Status.CONTRADICTED,
            reason=f"black or covered: the scene was gone from one frame to the next; {seen}",
            statistic=blank.count,
            threshold=self.settings.blank_frames,
            since_ns=blank.since_ns,
        )

    def _find_replay(self, claimed: bool) -> _Finding | None:
        replay = self._replays.run
        if replay is None:
            return None
        moved = self._path_px - replay.last.path_px > self.settings.stillness.moved_px
        least = self.settings.replayed_frames
        if not claimed:  # without a claim to say that the robot moved, the images alone must
            least += 1
            moved = replay.distinct >= least
        how = "bit by bit" if replay.exact else "but for its encoding"
        if replay.count < least or not moved or (self._stillness.noise_free and replay.distinct < least):
            return self._undecided(f"repeats an older image {how}", replay.since_ns, replay.count, least)
        return _Finding(
            status=Status.CONTRADICTED,
            reason=f"replayed: {replay.count} frames repeat older ones {how}, although the robot has moved",
            statistic=replay.count,
            threshold=least,
            since_ns=replay.since_ns,
        )

    def _find_stillness(self) -> _Finding | None:
        stillness, run = self._stillness, self._stillness.run
        if run is None or not (run.movers or stillness.repeated or self._sudden()):
            return None
        movers = " and ".join(run.movers)
        limit = stillness.limit
        since_ns = run.since_ns if run.against else self._stamp_ns
        if not stillness.overdue:
            reason = "duplicate frame" if stillness.repeated else "the image has suddenly stopped moving"
            return self._undecided(reason, since_ns, run.against, limit) if run.movers else None
        if not self._proven():
            reason = f"the image does not move, {movers} says that it does: one stream against the camera"
            return self._undecided(reason, since_ns, run.against, limit)
        return _Finding(
            status=Status.CONTRADICTED,
            reason=f"{'covered' if run.after_cut else 'frozen'}: {run.against} frames without a change, "
            f"while {movers} {'say' if len(run.movers) > 1 else 'says'} that the image moves",
            statistic=run.against,
            threshold=limit,
            since_ns=run.anchor_ns if run.after_cut else since_ns,
        )

    def _proven(self) -> bool:
        """Whether it is the camera that lies, and not the one stream that says that the robot moves."""
        run = self._stillness.run
        if run is None or len(run.movers) >= 2 or run.after_cut:
            return True
        if self._stillness.repeated and not self._stillness.noise_free:
            return True  # a real sensor's noise never repeats, whoever else lies
        fast = self._speed_m_s is not None and self._interval_s > 0.0
        return fast and run.abrupt and (self._speed_m_s or 0.0) / self._interval_s > self.settings.stop_m_s2

    def _find_nothing(self, estimate: VisualEstimate | None) -> _Finding:
        if estimate is not None and estimate.inliers == 0 and estimate.reason is not None:
            return self._undecided(estimate.reason, self._stamp_ns, 0, self._stillness.limit)
        return _Finding(
            status=Status.CONSISTENT,
            reason="",
            statistic=0,
            threshold=self._stillness.limit,
            since_ns=self._stamp_ns,
        )

    def _undecided(self, reason: str, since_ns: int, count: int, limit: int | None = None) -> _Finding:
        threshold = self.settings.blank_frames if limit is None else limit
        return _Finding(
            status=Status.UNDECIDED, reason=reason, statistic=count, threshold=threshold, since_ns=since_ns
        )

    # -- the fault over time -----------------------------------------------------------------------

    def _hold(self, finding: _Finding, stamp_ns: int) -> _Finding:
        """A fault stays until normal images have been back for long enough."""
        fault = self._fault
        if finding.status is Status.CONTRADICTED:
            # what is held is the first finding's onset: a replay may go over into a freeze
            self._fault = finding if fault is None else fault
            self._fault_seen_ns = stamp_ns
            return finding
        if fault is None:
            return finding
        if finding.status is Status.UNDECIDED and self._blankness.run is None and self._replays.run is None:
            return fault
        if stamp_ns - self._fault_seen_ns < self.settings.release_s * 1e9:
            return fault
        self._fault = None
        return finding

    def _answer(self, finding: _Finding) -> CheckResult:
        return CheckResult(
            check="camera",
            source=self.source,
            status=finding.status,
            statistic=finding.statistic,
            threshold=finding.threshold,
            unit=finding.unit,
            reason=finding.reason,
        )
