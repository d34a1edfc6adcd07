"""Odometry against the camera: III-B of the paper, scored at the claim instead of after the optimiser.

Compared are two motions between the same two images, the claimed one and the visual one,

    r = ( t_claim - e^s t_visual,  log(R_visual' R_claim) )

with both covariances. A single camera does not see the scale e^s: it is learned from the claim while the claim is
believed, so a *change* of scale is tested and an absolute one is not. Systematic errors that are estimated beside:
rotation and lever arm of the camera's mount, a gain of the visual rotation (an error of the focal length), and the
slow corrections of the heading that follow a turn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydantic import Field

from belie.checks.noise_scale import NoiseScaleSettings
from belie.checks.residual_test import ResidualTest
from belie.checks.sequential import Evidence, SequentialSettings
from belie.checks.systematic import SystematicErrors, rotation_correction
from belie.geometry import SE3, FloatArray, skew, so3_log
from belie.types import CheckResult, Settings, Status, VisualEstimate

_MOUNT, _LEVER, _GAIN, _SCALE, _CORRECTION = slice(0, 3), slice(3, 6), 6, 7, slice(8, 11)
_PARAMETERS = 11
_DIRECTED = 5.0  # standard errors
# Of a map's scale, the share that a frame renews: near corners carry it and pass by in some five frames, in which they
# err together.
_RENEWED = 0.2
_PLANAR = 1e-8  # of the turns' second moment lies off their axis; a body in space has 1e-3 and more
_MAINLY = 0.5  # an axis is mainly along those of the camera that it has more than this in common with
_SHORT_M = 0.1  # a step that may well go unseen: what a standing camera errs by is less
_COMPONENTS = (
    "sideways (camera x)", "upwards (camera y)", "forwards (camera z)",
    "pitch (about camera x)", "yaw (about camera y)", "roll (about camera z)",
    "along the motion (its length)",
)  # fmt: skip


class OdometrySettings(Settings):
    """Noise and systematic errors of an honest odometry, and of the camera beside it."""

    translation_noise: float = Field(
        0.01, gt=0.0,
        description="standard deviation of a claimed step, each axis [m per m travelled]; 1 % is what wheel and "
        "inertial odometry reach",
    )  # fmt: skip
    translation_floor_m: float = Field(0.0002, gt=0.0, description="the same at standstill [m a frame]")
    rotation_noise_deg: float = Field(
        0.05,
        gt=0.0,
        description="angle random walk of a claimed rotation [deg per sqrt(s)]: a MEMS gyroscope's 0.01 to 0.03, and "
        "the corrections of the odometry's own filter",
    )
    rotation_gain_noise: float = Field(
        0.01, ge=0.0, description="error of a claimed rotation that grows with it [deg per deg turned]"
    )
    clock_jitter_s: float = Field(
        0.0005, ge=0.0, description="standard deviation between the clocks of claim and camera [s]"
    )
    correction_gain: float = Field(
        0.0125, ge=0.0,
        description="slow corrections of the heading that a turn brings about: error of the turn, worked off in "
        "`correction_s` [deg/s per deg/s]",
    )  # fmt: skip
    correction_s: float = Field(
        3.0, gt=0.0, description="how long an odometry's filter works off such an error [s]"
    )
    mount_sigma_deg: float = Field(
        3.0, ge=0.0, description="how askew the camera may sit against its stated mount [deg]"
    )
    mount_walk_deg: float = Field(
        0.2, ge=0.0, description="how the direction error may wander [deg per sqrt(s)]"
    )
    lever_sigma_m: float = Field(0.1, ge=0.0, description="error of the camera's stated position [m]")
    gain_sigma: float = Field(
        0.02, ge=0.0, description="relative error of the visual rotation, from the focal length [1]"
    )
    scale_walk: float = Field(
        0.005, ge=0.0, description="how the scale of the visual map drifts [relative, per sqrt(frame)]"
    )


@dataclass(slots=True)
class _Scale:
    """Metres per map unit, as a logarithm; None until claim and images have both moved."""

    log_m: float | None = None
    map_id: int = -1


class OdometryCheck:
    """Judges one stream of claimed motion (a pose stream or a twist) against the visual motion.

    Parameters
    ----------
    source : str
        The stream's topic.
    check : str
        ``odometry`` or ``twist``.
    tests : int
        How many residual tests share the stated false-alarm rate.

    Examples
    --------
    >>> check = OdometryCheck("/odom", "odometry", tests=1)
    >>> blind = VisualEstimate(stamp_ns=1, previous_stamp_ns=0, T_prev_cur=SE3.identity(), covariance=np.eye(6),
    ...     corners=0, matches=0, inliers=0, parallax_px=0.0, reason="dark: mean gray value 3")
    >>> check.update(blind, SE3.identity()).reason
    'dark: mean gray value 3'
    """

    def __init__(
        self,
        source: str,
        check: str,
        *,
        tests: int,
        settings: OdometrySettings | None = None,
        sequential: SequentialSettings | None = None,
        noise: NoiseScaleSettings | None = None,
    ) -> None:
        self.source, self.check = source, check
        self.settings = s = settings or OdometrySettings()
        prior = np.array(
            [np.radians(s.mount_sigma_deg)] * 3 + [s.lever_sigma_m] * 3 + [s.gain_sigma, 1.0] + [0.0] * 3
        )
        walk = np.array([np.radians(s.mount_walk_deg)] * 3 + [0.0] * 3 + [0.0, s.scale_walk] + [0.0] * 3)
        self.test = ResidualTest(
            len(_COMPONENTS),
            SystematicErrors(prior, walk),
            sequential or SequentialSettings(),
            noise or NoiseScaleSettings(),
            tests,
        )
        self._scale = _Scale()
        self._turns = np.zeros((3, 3))
        self._accused = False
        self.floor_m_s: float | None = None  # smallest lie about the last translation that would show
        self.evidence: Evidence | None = None

    @property
    def metres_per_unit(self) -> float | None:
        """Scale of the visual map learned from this stream, or None while it is unknown."""
        return None if self._scale.log_m is None else math.exp(self._scale.log_m)

    def noise_scales(self) -> dict[str, float]:
        """How many times noisier than its model each component of the claim is."""
        names = ("x", "y", "z", "pitch", "yaw", "roll")
        return dict(zip(names, self.test.scales()[:6].tolist(), strict=True))

    def update(
        self, estimate: VisualEstimate, T_prev_cur: SE3 | None, *, over_gap: bool = False
    ) -> CheckResult:
        """Compare the claimed motion of the camera ``T_prev_cur`` with the visual one of the same interval.

        Where the interval spans a gap in the claims, `over_gap`, some of it may have been judged by itself already:
        only a jump counts, and nothing is learned.
        """
        self.evidence = self.floor_m_s = None
        interval_s = (estimate.stamp_ns - estimate.previous_stamp_ns) * 1e-9
        if estimate.inliers > 0 and interval_s > 0.0 and not over_gap:
            self._predict(estimate, interval_s)
        unscaled = self._scale.log_m is None or self._scale.map_id != estimate.map_id
        if T_prev_cur is None or estimate.inliers == 0 or interval_s <= 0.0 or (over_gap and unscaled):
            reason = (
                estimate.reason if estimate.inliers == 0 and estimate.reason else "no claim for this frame"
            )
            return self._undecided(reason)
        translates = (
            estimate.reason is None
            and self._know_scale(estimate, T_prev_cur)
            and self._sees_translation(estimate, T_prev_cur)
        )
        known = np.array([translates] * 3 + [*self._turned_about(T_prev_cur)])
        r, H, noise = self._residual(estimate, T_prev_cur, interval_s, known)
        # A change of scale shows along the motion, which is seldom an axis of the camera.
        length = float(np.linalg.norm(estimate.T_prev_cur.t))
        # Where it is no longer than its error, its direction is noise, and the difference is always negative along it.
        directed = length > _DIRECTED * math.sqrt(float(np.trace(estimate.covariance[:3, :3])))
        tested = np.append(known, translates and directed)
        along = np.zeros((1, 6))
        along[0, :3] = estimate.T_prev_cur.t / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        if over_gap and not self.test.is_jump(r, H, noise, tested, along):
            return self._undecided("a gap in the claims: only a jump behind it would show")
        evidence = self.test.update(
            r, H, noise, estimate.stamp_ns, interval_s, tested, along, still=estimate.is_still
        )
        self._accused = evidence.contradicted
        self.evidence = evidence
        if self._scale.log_m is not None:  # the scale's error is folded into the scale
            self._scale.log_m += float(self.test.errors.mean[_SCALE])
            self.test.errors.mean[_SCALE] = 0.0
        return self._result(estimate, evidence, translates, interval_s)

    def _predict(self, estimate: VisualEstimate, interval_s: float) -> None:
        """Let the systematic errors wander; a turn leaves an error that the claim's filter corrects later."""
        exposure, keep, drive = np.full(_PARAMETERS, interval_s), np.ones(_PARAMETERS), np.zeros(_PARAMETERS)
        exposure[_SCALE] = 1.0
        # What a frame errs in its length stays in the map with the corners that are new to it; where none moves on,
        # none is.
        t, C = estimate.T_prev_cur.R.T @ estimate.T_prev_cur.t, estimate.covariance[:3, :3]
        length2 = float(t @ t)
        if length2 > _DIRECTED**2 * float(np.trace(C)):
            drive[_SCALE] = _RENEWED * float(t @ C @ t) / length2**2
        keep[_CORRECTION], drive[_CORRECTION] = rotation_correction(
            estimate.T_prev_cur.R,
            estimate.covariance[3:, 3:],
            interval_s,
            self.settings.correction_gain,
            self.settings.correction_s,
        )
        self.test.errors.predict(exposure, keep, drive)

    def _know_scale(self, estimate: VisualEstimate, T_prev_cur: SE3) -> bool:
        scale = self._scale
        visual, claimed = float(np.linalg.norm(estimate.T_prev_cur.t)), float(np.linalg.norm(T_prev_cur.t))
        if scale.log_m is not None and scale.map_id != estimate.map_id:
            # The new map has a unit of its own. A claim that stands contradicted does not get to set it.
            if self._accused:
                return False
            scale.log_m = None
        if scale.log_m is None:
            spread = math.sqrt(float(np.trace(estimate.covariance[:3, :3])))
            if visual < 3.0 * spread or claimed < 3.0 * self.settings.translation_floor_m:
                return False
            scale.log_m, scale.map_id = math.log(claimed / visual), estimate.map_id
            self.test.errors.forget(_SCALE, 0.5)
        return True

    def _turned_about(self, T_prev_cur: SE3) -> npt.NDArray[np.bool_]:
        """Which axes of the camera the claim ever turns about, shape (3,).

        A wheel odometry turns about one axis only. That it knows of no pitch and no roll is no claim that there is
        none: the vehicle's own would be learned as noise, and forgotten at every stop.
        """
        omega = so3_log(T_prev_cur.R)
        self._turns += np.outer(omega, omega)
        sizes, axes = np.linalg.eigh(self._turns)
        if sizes[1] > _PLANAR * sizes[2] or sizes[2] == 0.0:
            return np.ones(3, dtype=bool)
        return np.asarray(np.abs(axes[:, 2]) > _MAINLY)

    def _sees_translation(self, estimate: VisualEstimate, T_prev_cur: SE3) -> bool:
        """Whether the claimed step is more than what the images may be off by: else any claim would pass."""
        metric = self.metres_per_unit or 1.0
        spread_m = metric * math.sqrt(float(np.trace(estimate.covariance[:3, :3])))
        return spread_m < max(float(np.linalg.norm(T_prev_cur.t)), _SHORT_M)

    def _residual(
        self, estimate: VisualEstimate, T_prev_cur: SE3, interval_s: float, known: npt.NDArray[np.bool_]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """R (6,), H (6, 11) and the noise (6, 6) of the comparison; see the module's formulas.

        What is not `known`, shape (6,), tells nothing of the systematic errors either: the pitch that a wheel odometry
        does not know of would be taken for a gain of the camera's rotation, and miss in the next curve.
        """
        s, translates = self.settings, bool(known[0])
        R = estimate.T_prev_cur.R
        omega = so3_log(R)  # the seen one: a lie must not widen its own margin
        metric = (self.metres_per_unit or 1.0) if translates else 0.0
        t = metric * estimate.T_prev_cur.t
        # Mount (δ, l): the claim is exp(δ, l) T exp(δ, l)^-1 of the camera's true motion T.
        H = np.zeros((6, _PARAMETERS))
        H[:3, _MOUNT] = -skew(t)
        H[:3, _LEVER] = np.eye(3) - R
        H[:3, _SCALE] = t
        H[3:, _MOUNT] = R.T - np.eye(3)
        H[3:, _GAIN] = -omega
        H[3:, _CORRECTION] = interval_s * np.eye(3)
        A = np.zeros((6, 6))  # covariance of T exp(xi): translations turn with R
        A[:3, :3], A[3:, 3:] = (metric or 1.0) * R, np.eye(3)
        noise = A @ estimate.covariance @ A.T
        distance2 = float(T_prev_cur.t @ T_prev_cur.t)
        step = s.translation_noise**2 * max(distance2, float(t @ t)) + s.translation_floor_m**2
        turn = math.radians(s.rotation_noise_deg) ** 2 * interval_s
        noise[np.diag_indices(6)] += [step] * 3 + [turn] * 3
        noise[3:, 3:] += s.rotation_gain_noise**2 * np.outer(omega, omega)
        velocity = np.concatenate([t, omega]) / interval_s
        noise += 2.0 * s.clock_jitter_s**2 * np.outer(velocity, velocity)
        r = np.concatenate([T_prev_cur.t - t, so3_log(R.T @ T_prev_cur.R)])
        r[~known], H[~known] = 0.0, 0.0
        noise[known ^ known[:, None]] = 0.0  # nothing is inferred from what is not known to what is
        return r, H, noise

    def _result(
        self, estimate: VisualEstimate, evidence: Evidence, translates: bool, interval_s: float
    ) -> CheckResult:
        floor = self.test.floor() / interval_s
        if translates:
            self.floor_m_s = float(floor[:3].max())
        turn = f"{math.degrees(float(floor[3:6].max())):.2g} deg/s"
        text = f"{float(floor[:3].max()):.2g} m/s, {turn}" if translates else turn
        if evidence.contradicted:
            status = Status.CONTRADICTED
            reason = f"the claimed motion differs from the visual one: {_COMPONENTS[evidence.component]}"
        elif self.test.missing_frames > 0:
            status = Status.UNDECIDED
            reason = f"learning the noise of this stream: {self.test.missing_frames} more frames"
        elif not translates:
            status = Status.UNDECIDED
            reason = (
                estimate.reason
                or "no baseline, or none that shows: nothing has moved, or all corners lie in one plane; only rotation "
                "is checked"
            )
        else:
            status, reason = (
                Status.CONSISTENT,
                "claimed and visual motion agree; scale from this claim's own past",
            )
        return CheckResult(
            check=self.check, source=self.source, status=status, statistic=evidence.statistic,
            threshold=evidence.threshold, unit=evidence.unit, floor=text, reason=reason,
        )  # fmt: skip

    def _undecided(self, reason: str) -> CheckResult:
        return CheckResult(
            check=self.check, source=self.source, status=Status.UNDECIDED, unit="llr", reason=reason
        )
