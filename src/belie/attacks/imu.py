"""Attacks on an IMU: its angular rate or its acceleration lies, in body axes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from belie.attacks.axes import body_axis
from belie.attacks.plan import Plan
from belie.attacks.stale import STALE, StaleForger
from belie.attacks.stream import Forger, Upstream, forged_steps
from belie.attacks.waveform import ADDITIVE, Waveform, waveform
from belie.geometry import FloatArray
from belie.types import Claim, MotionClaim, Step


def imu_steps(plan: Plan, upstream: Upstream) -> Iterator[Step]:
    """The steps of `upstream` with IMU samples forged; see `forged_steps`."""
    return forged_steps(plan, upstream, partial(imu_forger, plan))


def imu_forger(plan: Plan, source: str) -> Forger:
    """A fresh forger of one IMU's samples."""
    return StaleForger(plan) if plan.spec.kind in STALE else ImuForger(plan, source)


class ImuForger:
    """Forges the samples of one IMU: ``sample' = gain sample + errors along directions``."""

    def __init__(self, plan: Plan, source: str) -> None:
        axis = plan.spec.axis
        self._plan = plan
        self._rng = plan.random(source)
        self._directions = np.eye(3) if axis is None else body_axis(axis, plan.body_axes)[None]
        self._gain = _gain(plan, self._directions)
        self._errors: list[Waveform] | None = None
        self._last_honest_ns: int | None = None

    def before(self, claim: Claim) -> None:
        """Remember when the honest samples ended."""
        self._last_honest_ns = claim.stamp_ns

    def during(self, claim: Claim) -> Claim:
        """The false sample."""
        if not isinstance(claim, MotionClaim):
            return claim
        if self._plan.accelerates:
            return replace(claim, acceleration_m_s2=self._forged(claim.stamp_ns, claim.acceleration_m_s2))
        return replace(claim, angular_rad_s=self._forged(claim.stamp_ns, claim.angular_rad_s))

    def after(self, claim: Claim) -> Claim:
        """The claim itself."""
        return claim

    def _forged(self, stamp_ns: int, sample: FloatArray | None) -> FloatArray | None:
        if sample is None:
            return None
        if self._errors is None:
            self._errors = self._make_errors()
        errors = np.array([error(stamp_ns)[0] for error in self._errors])
        return np.asarray(self._gain @ sample + errors @ self._directions)

    def _make_errors(self) -> list[Waveform]:
        if self._plan.spec.kind in ADDITIVE:
            anchor_ns = self._plan.anchor_ns(self._last_honest_ns)
            return [waveform(self._plan, anchor_ns, self._rng) for _ in self._directions]
        value = self._plan.si("value") if self._plan.spec.kind == "set" else 0.0
        return [lambda _: (value, 0.0) for _ in self._directions]


def _gain(plan: Plan, directions: FloatArray) -> FloatArray:
    along = directions.T @ directions
    match plan.spec.kind:
        case "scale":
            return np.asarray(np.eye(3) + (plan.spec.number("factor") - 1.0) * along)
        case "flip":
            return np.asarray(np.eye(3) - 2.0 * along)
        case "set":
            return np.asarray(np.eye(3) - along)
        case _:
            return np.eye(3)
