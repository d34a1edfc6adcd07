"""The walk over a recording that every attack on claims shares."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Protocol

from belie.attacks.plan import Plan
from belie.types import AttackError, Claim, PoseClaim, Step

Upstream = Callable[[], Iterator[Step]]
"""Starts the recording (or the attack below this one) over from its first step."""


@contextmanager
def reading(upstream: Upstream) -> Iterator[Iterator[Step]]:
    """The steps of `upstream`, closed in the end, so that a reader's decoding thread stops.

    >>> with reading(lambda: iter(())) as steps:
    ...     list(steps)
    []
    """
    steps = upstream()
    try:
        yield steps
    finally:
        close = getattr(steps, "close", None)
        if close is not None:
            close()


class Forger(Protocol):
    """One attack on one source; it sees the source's claims in the order in which they are handed out.

    That is the order of their stamps, but for late ones, which may come after their successors.
    """

    def before(self, claim: Claim) -> None:
        """An honest claim, stamped before the span."""
        ...

    def during(self, claim: Claim) -> Claim:
        """What is sent instead of `claim`, stamped within the span."""
        ...

    def after(self, claim: Claim) -> Claim:
        """What is sent instead of `claim`, stamped after the span; usually `claim` itself."""
        ...


class ClaimForgery:
    """One attack in one pass over the claims of a recording, or of a running robot.

    Parameters
    ----------
    plan : Plan
        What, where, when.
    forger_of : callable
        Source name to a fresh forger.

    Attributes
    ----------
    touched : bool
        Whether a claim was attacked.
    """

    def __init__(self, plan: Plan, forger_of: Callable[[str], Forger]) -> None:
        self.touched = False
        self._plan, self._forger_of = plan, forger_of
        self._forgers: dict[str, Forger] = {}

    def forge(self, claim: Claim) -> Claim:
        """What is sent instead of `claim`; a pose must come before the twist of its message."""
        plan = self._plan
        if not plan.selects(claim):
            return claim
        if claim.source not in self._forgers:
            self._forgers[claim.source] = self._forger_of(claim.source)
        forger = self._forgers[claim.source]
        if plan.span.holds(claim.stamp_ns):
            self.touched = True
            return forger.during(claim)
        if claim.stamp_ns >= plan.span.start_ns:
            return forger.after(claim)
        forger.before(claim)
        return claim


def forged_steps(plan: Plan, upstream: Upstream, forger_of: Callable[[str], Forger]) -> Iterator[Step]:
    """The steps of `upstream` with the claims that `plan` selects forged.

    A step is handed out once the next one is known: the twist of an odometry message may come one step
    before its pose, and is forged to fit it.

    Parameters
    ----------
    forger_of : callable
        Source name to a fresh forger.

    Raises
    ------
    AttackError
        At the end, where the span held no claim to attack.
    """
    forgery = ClaimForgery(plan, forger_of)
    forge = forgery.forge
    held: Step | None = None
    with reading(upstream) as steps:
        for step in steps:
            claims = tuple(forge(claim) if isinstance(claim, PoseClaim) else claim for claim in step.claims)
            if held is not None:
                yield _with_others_forged(held, forge)
            held = replace(step, claims=claims)
    if held is not None:
        yield _with_others_forged(held, forge)
    if not forgery.touched:
        raise nothing_to_attack(plan, ())


def nothing_to_attack(plan: Plan, present: tuple[str, ...]) -> AttackError:
    """The error for an attack whose span holds no claim of its stream."""
    wanted = plan.spec.stream + (f" claims of {plan.spec['source']}" if plan.spec["source"] else " claims")
    found = f"; the recording has {', '.join(present)}" if present else ""
    frames = f"{plan.span.start_frame} to {plan.span.stop_frame}"
    return AttackError(f"{plan.spec.to_text()}: no {wanted} in frames {frames}{found}")


def _with_others_forged(step: Step, forge: Callable[[Claim], Claim]) -> Step:
    claims = tuple(claim if isinstance(claim, PoseClaim) else forge(claim) for claim in step.claims)
    return replace(step, claims=claims)
