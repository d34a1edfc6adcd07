"""Lies about where the body is: one law for odometry poses and for position claims.

A law maps the true position p to the claimed one p' and the true velocity v to the velocity that fits it,
``v' = gain v + offset``, both in the coordinates of the claim.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from belie.attacks.plan import Plan
from belie.attacks.waveform import ADDITIVE, waveform
from belie.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Displaced:
    """A claimed position, and the velocity that fits it.

    Parameters
    ----------
    position_m : array (3,)
        What is claimed.
    velocity_gain : array (3, 3)
        Applied to the true velocity.
    velocity_offset_m_s : array (3,)
        Added to it.
    """

    position_m: FloatArray
    velocity_gain: FloatArray
    velocity_offset_m_s: FloatArray


TranslationLaw = Callable[[int, FloatArray], Displaced]
"""Stamp (ns) and true position (3,) to the lie; to be called with growing stamps."""


def translation_law(
    plan: Plan,
    *,
    direction: FloatArray | None,
    anchor_m: FloatArray,
    anchor_ns: int,
    rng: np.random.Generator,
) -> TranslationLaw:
    """The law of an offset, ramp, bias, sinusoid, noise, scale, set or flip of positions.

    Parameters
    ----------
    direction : array (3,) or None
        Unit vector that the attack acts along; None: all three (scale, noise).
    anchor_m : array (3,)
        The last honest position: scale and flip act on the motion since, so that nothing jumps.
    anchor_ns : int
        When a growing error was last zero.

    Examples
    --------
    >>> from belie.attacks import parse_attack
    >>> from belie.attacks.timing import FrameClock
    >>> plan = Plan.of(parse_attack("position-scale:factor=2,start=1"), FrameClock(np.arange(9)), "flu")
    >>> law = translation_law(plan, direction=None, anchor_m=np.array([5.0, 0.0, 0.0]), anchor_ns=0,
    ...                       rng=plan.random("/gps"))
    >>> law(3, np.array([6.0, 0.0, 1.0])).position_m
    array([7., 0., 2.])
    """
    if plan.spec.kind in ADDITIVE:
        return _additive(plan, direction, anchor_ns, rng)
    along = np.eye(3) if direction is None else np.outer(direction, direction)
    match plan.spec.kind:
        case "scale":
            return _about(anchor_m, np.eye(3) + (plan.spec.number("factor") - 1.0) * along)
        case "flip":
            return _about(anchor_m, np.eye(3) - 2.0 * along)
        case "set" if direction is not None:
            return _about(plan.si("value") * direction, np.eye(3) - along)
        case kind:
            raise ValueError(f"{kind} is no law of translation")


def _about(fixed_m: FloatArray, gain: FloatArray) -> TranslationLaw:
    return lambda _, position_m: Displaced(
        position_m=fixed_m + gain @ (position_m - fixed_m),
        velocity_gain=gain,
        velocity_offset_m_s=np.zeros(3),
    )


def _additive(
    plan: Plan, direction: FloatArray | None, anchor_ns: int, rng: np.random.Generator
) -> TranslationLaw:
    directions = np.eye(3) if direction is None else direction[None]
    errors = [waveform(plan, anchor_ns, rng) for _ in directions]

    def law(stamp_ns: int, position_m: FloatArray) -> Displaced:
        sampled = np.array([error(stamp_ns) for error in errors])
        return Displaced(
            position_m=position_m + sampled[:, 0] @ directions,
            velocity_gain=np.eye(3),
            velocity_offset_m_s=sampled[:, 1] @ directions,
        )

    return law
