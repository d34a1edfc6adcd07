"""Errors over time: constant, growing, swinging, random; each with its derivative, for the twist."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from belie.attacks.plan import Plan
from belie.attacks.timing import NS_PER_S

Waveform = Callable[[int], tuple[float, float]]
"""Stamp (ns) to the error and its time derivative (a second), SI; to be called with growing stamps."""

ADDITIVE = ("offset", "ramp", "bias", "sinusoid", "noise")


def waveform(plan: Plan, anchor_ns: int, rng: np.random.Generator) -> Waveform:
    """The error that an additive attack adds, zero at `anchor_ns` except for offset and noise.

    Parameters
    ----------
    plan : Plan
        Of one of the kinds in `ADDITIVE`.
    anchor_ns : int
        When a growing error was last zero (`Plan.anchor_ns`).
    rng : Generator
        For noise.

    Examples
    --------
    >>> from belie.attacks import parse_attack
    >>> from belie.attacks.timing import FrameClock
    >>> clock = FrameClock(np.arange(20) * 100_000_000)
    >>> plan = Plan.of(parse_attack("odometry-offset:rate=0.2,start=10"), clock, "flu")
    >>> error, slope = waveform(plan, anchor_ns=900_000_000, rng=plan.random("/odom"))(1_100_000_000)
    >>> round(error, 6), round(slope, 6)
    (0.4, 2.0)
    """
    match plan.spec.kind:
        case "offset" if dict(plan.spec.options).get("magnitude") is not None:
            return _constant(plan.si("magnitude"))
        case "offset":
            return _per_frame(plan, plan.si("rate"), anchor_ns)
        case "bias" if plan.spec.stream == "imu":
            return _constant(plan.si("rate"))
        case "bias":
            return _per_frame(plan, plan.si("rate"), anchor_ns)
        case "ramp":
            return _per_second(plan.si("rate"), anchor_ns)
        case "sinusoid":
            return _sinusoid(plan.si("amplitude"), plan.spec.number("period"), anchor_ns)
        case "noise":
            return _noise(plan.si("sigma"), anchor_ns, rng)
        case kind:
            raise ValueError(f"{kind} adds no error")


def _constant(value: float) -> Waveform:
    # The jump at the onset has no derivative; the messages after it are honest about the speed.
    return lambda stamp_ns: (value, 0.0)


def _per_frame(plan: Plan, rate: float, anchor_ns: int) -> Waveform:
    first = plan.clock.frame_at(anchor_ns)

    def at(stamp_ns: int) -> tuple[float, float]:
        frames = plan.clock.frame_at(stamp_ns) - first
        return rate * frames, rate * plan.clock.frames_per_second(stamp_ns)

    return at


def _per_second(rate: float, anchor_ns: int) -> Waveform:
    return lambda stamp_ns: (rate * (stamp_ns - anchor_ns) / NS_PER_S, rate)


def _sinusoid(amplitude: float, period_s: float, anchor_ns: int) -> Waveform:
    omega = 2.0 * math.pi / period_s

    def at(stamp_ns: int) -> tuple[float, float]:
        phase = omega * (stamp_ns - anchor_ns) / NS_PER_S
        return amplitude * math.sin(phase), amplitude * omega * math.cos(phase)

    return at


def _noise(sigma: float, anchor_ns: int, rng: np.random.Generator) -> Waveform:
    last_ns, last = anchor_ns, 0.0

    def at(stamp_ns: int) -> tuple[float, float]:
        nonlocal last_ns, last
        value = sigma * float(rng.standard_normal())
        elapsed_s = (stamp_ns - last_ns) / NS_PER_S
        slope = (value - last) / elapsed_s if elapsed_s > 0.0 else 0.0
        last_ns, last = stamp_ns, value
        return value, slope

    return at
