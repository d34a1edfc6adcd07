"""Position (GNSS or localisation) against the odometry that the camera vouches for.

The position's innovation against dead reckoning is tested (`alignment` has the model, `innovation_test` the
tests): a jump shows at once, and a drag-off shows as a run of innovations of one sign, which is what a CUSUM
adds up. For a change of a linear Gaussian system the innovations hold all the evidence there is (Willsky and
Jones, "A generalized likelihood ratio approach to the detection and estimation of jumps in linear systems",
IEEE TAC 1976); the bank of shifts plays the part of several windows and shares one false-alarm rate among
them. Windows of plain displacement are used only while the rotation between the frames is unknown
(`unaligned`).

A random-walk offset swallows slow drifts: a filter of gain k leaves ``s dt / k`` of a drift s in its
innovations, so one that leaves too little, for good, is absorbed within about ``dt / k`` seconds. Both are
stated: the smallest drift is the floor of every result, the time constant is `PositionCheck.absorption_s`.
The gain is no larger than odometry drift and the noise of the stream (learned, `position_noise`) call for.
Nothing is learned from a claim that is contradicted, and once a lie is found what was learned since its
onset is taken back; from there on positions are compared with pure dead reckoning (`return_test`), and
believed again where they agree with it.
"""

from __future__ import annotations

import math

import numpy as np

from belie.checks.alignment import Alignment
from belie.checks.heights import Heights
from belie.checks.innovation_test import InnovationTest
from belie.checks.noise_scale import NoiseScaleSettings
from belie.checks.position_noise import PositionNoise
from belie.checks.position_settings import PositionSettings
from belie.checks.return_test import Return
from belie.checks.sequential import Evidence, SequentialSettings
from belie.checks.unaligned import Unaligned
from belie.geometry import SE3, FloatArray, so3_exp
from belie.types import CheckResult, PositionClaim, Status

__all__ = ["PositionCheck", "PositionSettings"]

_AXES = ("x", "y", "z", "x + y", "x - y", "y + z", "y - z", "x + z", "x - z")
_HALF = 0.5**0.5
# A lie along no axis would show only 0.7 of itself; with the diagonals it is 0.9.
_DIRECTIONS = np.concatenate(
    [np.eye(3), _HALF * np.array([[1, 1, 0], [1, -1, 0], [0, 1, 1], [0, 1, -1], [1, 0, 1], [1, 0, -1]])]
)
_NEVER_TOLD_M = 1e3
_FLOOR_CLAIMS = (10, 30, 100)


class PositionCheck:
    """Judges one stream of positions against the trusted trajectory.

    Parameters
    ----------
    source : str
        The stream's topic.
    tests : int
        How many residual tests share the stated false-alarm rate.
    settings, sequential, noise
        Model of the errors, of the sequential tests, and how quickly the noise is learned.

    Examples
    --------
    >>> check = PositionCheck("/gnss", tests=1)
    >>> rng = np.random.default_rng(0)
    >>> def fix(i, jump_m=0.0):
    ...     T_odom_body = SE3.from_translation([0.8 * i, 0.0, 0.0])
    ...     p = T_odom_body.t + (jump_m, 0.0, 0.0) + rng.normal(0.0, 0.05, 3)
    ...     claim = PositionClaim(source="/gnss", frame_id="odom", kind="gnss", stamp_ns=i * 10**8,
    ...                           received_ns=0, position_m=p)
    ...     return check.update(claim, T_odom_body, shares_axes=True)
    >>> {fix(i).status.value for i in range(60, 100)} <= {"consistent", "undecided"}
    True
    >>> [fix(i).status.value for i in range(100, 161)][-1]
    'consistent'
    >>> fix(161, jump_m=2.0).status.value
    'contradicted'
    """

    def __init__(
        self,
        source: str,
        *,
        tests: int,
        settings: PositionSettings | None = None,
        sequential: SequentialSettings | None = None,
        noise: NoiseScaleSettings | None = None,
    ) -> None:
        self.source = source
        self.settings = settings or PositionSettings()
        self._sequential, self._tests = sequential or SequentialSettings(), tests
        self._unaligned = Unaligned(self.settings, self._sequential, tests=tests)
        self._noise: PositionNoise | None = None
        self._alignment: Alignment | None = None
        self._test: InnovationTest | None = None
        self._declared = np.eye(3)
        self._heights = Heights()
        self._last: tuple[int, SE3, FloatArray] | None = None
        self._odometry_lost = False
        self._return: Return | None = None
        self._interval_s = 0.1
        self.absorption_s: float | None = None
        self.apart_m: float | None = None  # from where the odometry leads, at most since it is accused
        self.evidence: Evidence | None = None

    @property
    def interval_ns(self) -> int:
        """Between the latest two claims that were tested."""
        return round(self._interval_s * 1e9)

    def skip(self, reason: str, *, odometry_lost: bool = False) -> CheckResult:
        """UNDECIDED for a frame that cannot be tested.

        `odometry_lost`: what was travelled meanwhile is not known either; the next claim is given leeway.
        """
        self.evidence = None
        self._odometry_lost = self._odometry_lost or odometry_lost
        return self._answer(Status.UNDECIDED, reason)

    def update(self, claim: PositionClaim, T_odom_body: SE3, *, shares_axes: bool) -> CheckResult:
        """Test a position.

        Parameters
        ----------
        claim : PositionClaim
        T_odom_body : SE3
            The trusted trajectory at the claim's stamp; continuous from call to call unless `skip` was told.
        shares_axes : bool
            Whether position and odometry name the same frame; else both have z up and the yaw between
            them is unknown.
        """
        self.evidence = None
        if self._last is not None and claim.stamp_ns <= self._last[0]:
            return self._answer(Status.UNDECIDED, "this position is not newer than the last one")
        if self._noise is None:
            self._noise = PositionNoise(self.settings, declared=claim.covariance is not None)
        if claim.covariance is not None and np.diag(claim.covariance).min() > 0.0:
            self._declared = claim.covariance
        elif self._last is None:
            self._declared = np.eye(3) * self.settings.unknown_sigma_m**2
        if claim.lever_m is not None:
            T_odom_body = T_odom_body @ SE3.from_translation(claim.lever_m)
        p_m, q_m = claim.position_m, T_odom_body.t
        self._heights.see(p_m, q_m)
        self._bridge_loss(claim.stamp_ns)
        if self._alignment is None and shares_axes:
            sigma = np.full(3, math.radians(self.settings.shared_sigma_deg))
            self._align(np.eye(3), sigma, claim, T_odom_body)
        if self._alignment is None:
            result = self._test_lengths(claim, T_odom_body)
        else:
            result = self._test_innovation(self._alignment, claim, T_odom_body)
        self._last = (claim.stamp_ns, T_odom_body, q_m)
        return result

    def _test_lengths(self, claim: PositionClaim, T_odom_body: SE3) -> CheckResult:
        assert self._noise is not None
        unit_m = self._unit_m()
        self.evidence = e = self._unaligned.update(
            claim.stamp_ns, claim.position_m, T_odom_body.t, self._noise, unit_m
        )
        floor = f"{self._unaligned.floor_m(self._noise, unit_m):.2g} m jump"
        if e.contradicted:
            self.apart_m = None
            reason = "the position moved another distance than the odometry that the camera vouches for"
            return self._answer(Status.CONTRADICTED, reason, floor)
        heading = self._unaligned.heading(self._noise, unit_m)
        if heading.sigma_rad >= math.radians(self.settings.heading_known_deg):
            reason = (
                f"the yaw between {self.source} and odometry is not observable yet: "
                f"travelled {heading.extent_m:.1f} m, need about {heading.needed_m:.0f} m"
            )
        elif self._noise.missing_claims > 0:
            reason = f"learning the noise of this stream: {self._noise.missing_claims} more claims"
        else:
            tilt = math.radians(self.settings.tilt_sigma_deg)
            R_map_odom = so3_exp(np.array([0.0, 0.0, heading.yaw_rad]))
            self._align(R_map_odom, np.array([tilt, tilt, heading.sigma_rad]), claim, T_odom_body)
            reason = "aligned with the odometry by this claim, and judged from the next one on"
        return self._answer(Status.UNDECIDED, reason, floor)

    def _test_innovation(self, alignment: Alignment, claim: PositionClaim, T_odom_body: SE3) -> CheckResult:
        assert self._noise is not None
        assert self._test is not None
        unit_m = self._unit_m()
        if self._last is not None:
            self._interval_s = (claim.stamp_ns - self._last[0]) * 1e-9
        alignment.advance(T_odom_body, self._interval_s, self._noise.walk_m(unit_m))
        r, H = alignment.residual(claim.position_m), alignment.jacobian()
        noise = self._claim_noise(alignment, unit_m)
        innovation, S = alignment.errors.innovation(r, H, noise)
        if self._return is None:
            self.evidence = e = self._test.update(
                _DIRECTIONS @ innovation, _DIRECTIONS @ S @ _DIRECTIONS.T, claim.stamp_ns, self._interval_s
            )
        else:
            self.evidence = e = self._return.update(innovation, S, noise, claim.stamp_ns)
            if not e.contradicted:
                self._return = None
                self._test.restart()
        if e.contradicted:
            self._noise.reject()
            if self._return is None:
                self._return = Return(e, self._sequential.release_s)
                alignment.take_back(e.onset_ns, claim.stamp_ns, self._noise.walk_m(unit_m))
        else:
            self.apart_m = None
            self._noise.learn(claim.stamp_ns, alignment.wander(claim.position_m), unit_m)
            alignment.errors.learn(innovation, S, H)
            alignment.settle()
            alignment.remember(claim.stamp_ns)
        share = float(alignment.absorbed(noise)[self._heights.tested].max())
        self.absorption_s = self._interval_s / share
        floor = self._floor(share)
        if e.contradicted:
            return self._answer(Status.CONTRADICTED, self._accusation(alignment, claim, e), floor)
        missing = max(self._test.missing, self._noise.missing_claims)
        if missing > 0:
            return self._answer(
                Status.UNDECIDED, f"learning the noise of this stream: {missing} more claims", floor
            )
        jump_m = self._jump_floor_m()
        if jump_m > self.settings.most_floor_m:
            reason = f"the noise that this stream declares or shows hides every jump below {jump_m:.0f} m"
            return self._answer(Status.UNDECIDED, reason, floor)
        apart_m = float(np.linalg.norm(r - H @ alignment.errors.mean))
        sigma_m = float(self._test.sigma[:3][self._heights.tested].max())
        reason = (
            f"the position is {apart_m:.2g} m from where the odometry leads (sigma {sigma_m:.2g} m); "
            f"slower drifts than the floor are absorbed within {self.absorption_s:.1f} s"
        )
        return self._answer(Status.CONSISTENT, reason, floor)

    def _align(
        self, R_map_odom: FloatArray, sigma_rad: FloatArray, claim: PositionClaim, T_odom_body: SE3
    ) -> None:
        assert self._noise is not None
        self._alignment = Alignment(
            self.settings, R_map_odom, sigma_rad, claim.position_m, T_odom_body,
            offset_sigma_m=2.0 * self._noise.fast_sigma_m(self._unit_m()),
            lever_sigma_m=self.settings.lever_sigma_m if claim.kind == "gnss" else 0.0,
        )  # fmt: skip
        self._test = InnovationTest(
            len(_DIRECTIONS), self._sequential, tests=self._tests, memory=self.settings.memory_claims,
            learning=self.settings.learning_claims, waiting=self.settings.waiting_claims,
        )  # fmt: skip

    def _claim_noise(self, alignment: Alignment, unit_m: FloatArray) -> FloatArray:
        """Covariance of the fast noise of one claim, shape (3, 3), m²."""
        assert self._noise is not None
        sigma_m = self._noise.fast_sigma_m(unit_m)
        correlation = self._declared / np.outer(unit_m, unit_m)
        noise = correlation * np.outer(sigma_m, sigma_m)
        v = alignment.velocity_m_s
        noise = noise + self.settings.clock_jitter_s**2 * np.outer(v, v)
        if not self._heights.tested[2]:
            noise[2, :2] = noise[:2, 2] = 0.0
            noise[2, 2] = _NEVER_TOLD_M**2
        return np.asarray(noise)

    def _bridge_loss(self, stamp_ns: int) -> None:
        if not self._odometry_lost:
            return
        self._odometry_lost = False
        self._unaligned.forget_past()
        if self._noise is not None:
            self._noise.forget_past()
        if self._alignment is not None and self._last is not None:
            speed_m_s = float(np.linalg.norm(self._alignment.velocity_m_s))
            self._alignment.widen(speed_m_s * (stamp_ns - self._last[0]) * 1e-9)

    def _jump_floor_m(self) -> float:
        assert self._test is not None
        return float(self._test.floor(3)[:3][self._heights.tested].max())

    def _floor(self, share: float) -> str:
        """Smallest jump that three claims show, and smallest drift; the filter takes in `share` a claim."""
        assert self._test is not None
        axes = self._heights.tested
        drifts = []
        for claims in _FLOOR_CLAIMS:
            # mean over n = 1 .. claims of what n steps leave, (1 - (1 - k)^n) / k, as a geometric sum
            kept = (1.0 - share) * (1.0 - (1.0 - share) ** claims) / share
            left = (claims - kept) / (claims * share)
            drifts.append(float(self._test.floor(claims)[:3][axes].max()) / (left * self._interval_s))
        where = "" if axes[2] else " (horizontally)"
        return f"{self._jump_floor_m():.2g} m jump, {min(drifts):.2g} m/s drift{where}"

    def _accusation(self, alignment: Alignment, claim: PositionClaim, e: Evidence) -> str:
        apart_m = alignment.residual(claim.position_m) - alignment.jacobian() @ alignment.errors.mean
        length_m = float(np.linalg.norm(apart_m[self._heights.tested]))
        self.apart_m = max(length_m, self.apart_m or 0.0)
        return (
            f"the position is {length_m:.2g} m from where the odometry leads that the camera vouches for, "
            f"first along {_AXES[e.component]}"
        )

    def _unit_m(self) -> FloatArray:
        return np.asarray(np.sqrt(np.diag(self._declared)))

    def _answer(self, status: Status, reason: str, floor: str | None = None) -> CheckResult:
        e = self.evidence
        return CheckResult(
            check="position", source=self.source, status=status, statistic=e.statistic if e else None,
            threshold=e.threshold if e else None, unit=e.unit if e else "llr", floor=floor, reason=reason,
        )  # fmt: skip
