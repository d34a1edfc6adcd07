"""Old content under new stamps: freeze, replay, delay."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from belie.attacks.plan import Plan
from belie.attacks.timing import Timing
from belie.types import Claim, MotionClaim

STALE = ("freeze", "replay", "delay")


class StaleForger:
    """Sends earlier claims again, bit for bit but for their stamps.

    Freeze repeats the last honest claim. Replay sends the claim of `delay` ago, so it goes back in time at
    the onset. Delay never goes back: it repeats the last honest claim until that is `delay` old, then runs
    that much late. While an odometry's pose stands still its twist is zero, for a twist is the pose's
    derivative.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        lag = dict(plan.spec.options).get("delay")
        self._lag = lag if isinstance(lag, Timing) else None
        self._histories: dict[type, _History] = {}

    def before(self, claim: Claim) -> None:
        """Remember an honest claim."""
        history = self._history(claim)
        if not (history.begun or history.is_late(claim)):
            history.append(claim)
            history.last_honest = claim
            history.forget_before(self._lagged_ns(claim.stamp_ns))

    def during(self, claim: Claim) -> Claim:
        """The old claim that is sent instead."""
        history = self._history(claim)
        if history.last_honest is None:
            history.last_honest = claim
        history.begun = True
        if self._lag is not None and not history.is_late(claim):
            history.append(claim)
        old = self._old(claim.stamp_ns, history, history.last_honest)
        sent = replace(old, stamp_ns=claim.stamp_ns, received_ns=claim.received_ns)
        stands_still = old is history.last_honest and self._plan.spec.kind != "replay"
        if isinstance(sent, MotionClaim) and sent.kind == "twist" and stands_still:
            return replace(
                sent,
                linear_m_s=None if sent.linear_m_s is None else np.zeros(3),
                angular_rad_s=None if sent.angular_rad_s is None else np.zeros(3),
            )
        return sent

    def after(self, claim: Claim) -> Claim:
        """The claim itself."""
        return claim

    def _history(self, claim: Claim) -> _History:
        return self._histories.setdefault(type(claim), _History())

    def _lagged_ns(self, stamp_ns: int) -> int:
        # A frozen stream needs no history: only what is remembered as the last honest claim.
        return stamp_ns if self._lag is None else self._plan.clock.before(stamp_ns, self._lag)

    def _old(self, stamp_ns: int, history: _History, last_honest: Claim) -> Claim:
        if self._lag is None:
            return last_honest
        wanted_ns = self._lagged_ns(stamp_ns)
        history.forget_before(wanted_ns)
        if self._plan.spec.kind == "delay" and wanted_ns <= last_honest.stamp_ns:
            return last_honest
        return history.nearest(wanted_ns)


class _History:
    """The claims of one type that may still be wanted."""

    def __init__(self) -> None:
        self._claims: deque[Claim] = deque()
        self.last_honest: Claim | None = None
        # A late honest claim must not change what is being repeated.
        self.begun = False

    def is_late(self, claim: Claim) -> bool:
        return bool(self._claims) and claim.stamp_ns < self._claims[-1].stamp_ns

    def append(self, claim: Claim) -> None:
        self._claims.append(claim)

    def forget_before(self, wanted_ns: int) -> None:
        while len(self._claims) > 1 and self._claims[1].stamp_ns <= wanted_ns:
            self._claims.popleft()

    def nearest(self, wanted_ns: int) -> Claim:
        # Stamps jitter: the newest claim not after the wanted time would slip by one message now and then.
        pair = [self._claims[0], self._claims[min(1, len(self._claims) - 1)]]
        return min(pair, key=lambda claim: abs(claim.stamp_ns - wanted_ns))
