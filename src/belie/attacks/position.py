"""Attacks on claimed positions: GNSS and localisation."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from belie.attacks.axes import world_direction
from belie.attacks.plan import Plan
from belie.attacks.stale import STALE, StaleForger
from belie.attacks.stream import Forger, Upstream, forged_steps, reading
from belie.attacks.translation import TranslationLaw, translation_law
from belie.geometry import FloatArray
from belie.types import AttackError, Claim, PoseClaim, PositionClaim, Step

Headings = dict[str, deque[tuple[int, FloatArray]]]
"""Name of a frame to the recent attitudes ``R_odom_body`` claimed in it, by stamp."""

_COURSE_M = 10.0
_SHORTEST_COURSE_M = 2.0


def no_headings() -> Headings:
    """Headings to fill with `note_heading`."""
    return defaultdict(lambda: deque(maxlen=4096))


def note_heading(headings: Headings, claim: Claim) -> None:
    """Keep the attitude of a pose claim."""
    if isinstance(claim, PoseClaim):
        headings[claim.frame_id].append((claim.stamp_ns, claim.T_odom_body.R))


def position_steps(plan: Plan, upstream: Upstream) -> Iterator[Step]:
    """The steps of `upstream` with positions forged; see `forged_steps`."""
    headings = no_headings()

    def watched() -> Iterator[Step]:
        with reading(upstream) as steps:
            for step in steps:
                for claim in step.claims:
                    note_heading(headings, claim)
                yield step

    return forged_steps(plan, watched, lambda source: position_forger(plan, source, headings))


def position_forger(plan: Plan, source: str, headings: Headings) -> Forger:
    """A fresh forger of one source's positions."""
    return StaleForger(plan) if plan.spec.kind in STALE else PositionForger(plan, source, headings)


class PositionForger:
    """Forges the positions of one source by a law.

    The vehicle's forward, left and up come from the odometry where both share a frame. Elsewhere up is z (ENU
    and REP 105 maps) and forward is the course over the last 10 m, for a position alone has no heading.
    """

    def __init__(self, plan: Plan, source: str, headings: Headings) -> None:
        self._plan = plan
        self._rng = plan.random(source)
        self._headings = headings
        self._track: deque[PositionClaim] = deque(maxlen=5000)
        self._law: TranslationLaw | None = None

    def before(self, claim: Claim) -> None:
        """Remember the honest track, as far back as the course needs it."""
        if isinstance(claim, PositionClaim):
            self._track.append(claim)
            while len(self._track) > 1 and _travelled(self._track[1], claim) >= _COURSE_M:
                self._track.popleft()

    def during(self, claim: Claim) -> Claim:
        """The false position."""
        if not isinstance(claim, PositionClaim):
            return claim
        self._law = self._law or self._make_law(claim)
        return replace(claim, position_m=self._law(claim.stamp_ns, claim.position_m).position_m)

    def after(self, claim: Claim) -> Claim:
        """The claim itself."""
        return claim

    def _make_law(self, first: PositionClaim) -> TranslationLaw:
        last_honest = self._track[-1] if self._track else None
        return translation_law(
            self._plan,
            direction=self._direction(first),
            anchor_m=(last_honest or first).position_m,
            anchor_ns=self._plan.anchor_ns(last_honest.stamp_ns if last_honest else None),
            rng=self._rng,
        )

    def _direction(self, first: PositionClaim) -> FloatArray | None:
        axis = self._plan.spec.axis
        if axis is None:
            return None
        if axis in ("x", "y", "z"):
            return world_direction(axis, np.eye(3), self._plan.body_axes)
        if first.frame_id in self._headings:
            attitudes = self._headings[first.frame_id]
            _, R_odom_body = min(attitudes, key=lambda entry: abs(entry[0] - first.stamp_ns))
            return world_direction(axis, R_odom_body, self._plan.body_axes)
        return world_direction(axis, np.eye(3) if axis == "up" else self._course(first), "flu")

    def _course(self, first: PositionClaim) -> FloatArray:
        """``R_world_vehicle`` of a level vehicle that looks where it goes, shape (3, 3)."""
        start = self._track[0] if self._track else first
        dx, dy, _ = first.position_m - start.position_m
        travelled_m = float(np.hypot(dx, dy))
        if travelled_m < _SHORTEST_COURSE_M:
            raise AttackError(
                f"{self._plan.spec.to_text()}: axis={self._plan.spec.axis} needs a direction of travel, but "
                f"{first.source} moved {travelled_m:.1f} m before the onset and no odometry shares its frame "
                f"{first.frame_id!r}; use axis=x, y or z"
            )
        cosine, sine = dx / travelled_m, dy / travelled_m
        return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _travelled(earlier: PositionClaim, later: PositionClaim) -> float:
    return float(np.linalg.norm(later.position_m[:2] - earlier.position_m[:2]))
