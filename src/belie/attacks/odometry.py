"""Attacks on odometry: the pose lies, and the twist is its derivative."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from belie.attacks.axes import world_direction
from belie.attacks.catalogue import ROTATIONS
from belie.attacks.plan import Plan
from belie.attacks.rotation import PoseLaw, TwistMap, rotation_law
from belie.attacks.stale import STALE, StaleForger
from belie.attacks.stream import Forger, Upstream, forged_steps
from belie.attacks.translation import translation_law
from belie.geometry import SE3
from belie.types import AttackError, Claim, MotionClaim, PoseClaim, Step


def odometry_steps(plan: Plan, upstream: Upstream) -> Iterator[Step]:
    """The steps of `upstream` with poses and twists forged; see `forged_steps`."""
    return forged_steps(plan, upstream, partial(odometry_forger, plan))


def odometry_forger(plan: Plan, source: str) -> Forger:
    """A fresh forger of one source's poses and twists."""
    forger = StaleForger(plan) if plan.spec.kind in STALE else OdometryForger(plan, source)
    return forger if plan.spec["restore"] else _Unrestored(forger)


class OdometryForger:
    """Forges the poses of one source by a law, and its twists by the law's derivative."""

    def __init__(self, plan: Plan, source: str) -> None:
        self._plan = plan
        self._rng = plan.random(source)
        self._last_honest: PoseClaim | None = None
        self._law: PoseLaw | None = None
        # Poses run up to one frame ahead of the twists (`forged_steps`); this covers one at 1 kHz and 0.5 Hz.
        self._twist_maps: deque[tuple[int, TwistMap]] = deque(maxlen=2048)

    def before(self, claim: Claim) -> None:
        """Remember where the honest poses ended."""
        if isinstance(claim, PoseClaim):
            self._last_honest = claim

    def during(self, claim: Claim) -> Claim:
        """The false pose, or the twist that fits it."""
        if isinstance(claim, PoseClaim):
            self._law = self._law or self._make_law(claim)
            T_odom_body, twist_map = self._law(claim.stamp_ns, claim.T_odom_body)
            self._twist_maps.append((claim.stamp_ns, twist_map))
            return replace(claim, T_odom_body=T_odom_body)
        if isinstance(claim, MotionClaim):
            return self._forged_twist(claim)
        return claim

    def after(self, claim: Claim) -> Claim:
        """The claim itself."""
        return claim

    def _forged_twist(self, claim: MotionClaim) -> MotionClaim:
        if self._last_honest is None and not self._twist_maps:
            raise AttackError(
                f"{self._plan.spec.to_text()}: {claim.source} sends twists but no poses; set source"
            )
        for stamp_ns, twist_map in reversed(self._twist_maps):
            if stamp_ns <= claim.stamp_ns:
                linear, angular = twist_map.apply(claim.linear_m_s, claim.angular_rad_s)
                return replace(claim, linear_m_s=linear, angular_rad_s=angular)
        return claim

    def _make_law(self, first: PoseClaim) -> PoseLaw:
        plan, anchor = self._plan, self._last_honest or first
        anchor_ns = plan.anchor_ns(None if self._last_honest is None else self._last_honest.stamp_ns)
        if plan.spec.axis in ROTATIONS:
            return rotation_law(plan, anchor=anchor.T_odom_body, anchor_ns=anchor_ns, rng=self._rng)
        axis = plan.spec.axis
        law = translation_law(
            plan,
            direction=None if axis is None else world_direction(axis, first.T_odom_body.R, plan.body_axes),
            anchor_m=anchor.T_odom_body.t,
            anchor_ns=anchor_ns,
            rng=self._rng,
        )

        def pose_law(stamp_ns: int, T_odom_body: SE3) -> tuple[SE3, TwistMap]:
            R = T_odom_body.R
            displaced = law(stamp_ns, T_odom_body.t)
            twist_map = TwistMap(
                linear_gain=R.T @ displaced.velocity_gain @ R,
                linear_offset_m_s=R.T @ displaced.velocity_offset_m_s,
            )
            return SE3(R, displaced.position_m), twist_map

        return pose_law


class _Unrestored:
    """Another forger whose last error stays: after the span, poses move honestly from the false pose on."""

    def __init__(self, forger: Forger) -> None:
        self._forger = forger
        self._T_claimed_true = SE3.identity()

    def before(self, claim: Claim) -> None:
        self._forger.before(claim)

    def during(self, claim: Claim) -> Claim:
        forged = self._forger.during(claim)
        if isinstance(claim, PoseClaim) and isinstance(forged, PoseClaim):
            self._T_claimed_true = forged.T_odom_body @ claim.T_odom_body.inverse()
        return forged

    def after(self, claim: Claim) -> Claim:
        if not isinstance(claim, PoseClaim):
            return claim
        return replace(claim, T_odom_body=self._T_claimed_true @ claim.T_odom_body)
