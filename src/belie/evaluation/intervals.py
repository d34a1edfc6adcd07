"""How much a count proves: Wilson (1927) for success rates; Garwood (1936) for the rate of events, a Poisson count."""

from __future__ import annotations

import math
from statistics import NormalDist

from scipy.special import chdtri


def wilson_interval(successes: int, trials: int, confidence: float = 0.95) -> tuple[float, float] | None:
    """Two-sided interval of a success rate; None without trials.

    >>> low, high = wilson_interval(20, 20)
    >>> round(low, 3), high
    (0.839, 1.0)
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"{successes} successes in {trials} trials")
    if trials == 0:
        return None
    z2 = NormalDist().inv_cdf(0.5 + confidence / 2.0) ** 2
    rate = successes / trials
    centre = (rate + z2 / (2 * trials)) / (1 + z2 / trials)
    half = math.sqrt(z2 * (rate * (1 - rate) / trials + z2 / (4 * trials**2))) / (1 + z2 / trials)
    # Rounding must not exclude what was observed.
    return max(0.0, min(rate, centre - half)), min(1.0, max(rate, centre + half))


def poisson_upper(count: int, confidence: float = 0.95) -> float:
    """One-sided upper bound of a Poisson mean of which `count` events were seen (Garwood).

    >>> round(poisson_upper(0), 3)
    2.996
    """
    if count < 0:
        raise ValueError(f"a count is not negative, got {count}")
    return float(chdtri(2 * (count + 1), 1.0 - confidence) / 2.0)
