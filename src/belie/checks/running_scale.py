"""A robust scale over a long memory, cheap enough to be asked for at every claim.

A slow lie takes seconds to prove itself, so the noise that it is tested against must come from a longer
memory than that, and from before: what was seen in the last seconds waits, and is thrown away if it turns
out to be contradicted.
"""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections import deque

_ONE_SIGMA = 0.6827
# The largest of five Gaussian values is below a third of sigma once in 800 times.
FEW, FEW_CAUTION = 5, 3.0


class RunningScale:
    """The 68 % quantile of ``|x|`` over the last values, and their lag-one correlation.

    Parameters
    ----------
    prior : float
        Scale while fewer than `learning` values are known.
    least : float
        The scale never falls below this.
    memory, learning : int
        Values kept, and values needed.
    waiting : int
        A value counts when so many more have followed it, or half of those known if that is fewer.

    Examples
    --------
    >>> scale = RunningScale(prior=3.0, least=0.01, memory=600, learning=20, waiting=50)
    >>> scale.value
    3.0
    >>> for i in range(400): scale.learn(math.sin(0.1 * i) * 2.0)
    >>> round(scale.value, 1), scale.correlation > 0.8
    (1.8, True)
    """

    def __init__(self, *, prior: float, least: float, memory: int, learning: int, waiting: int) -> None:
        self._prior, self._least = max(prior, least), least
        self._memory, self._learning, self._wait = memory, learning, waiting
        self._waiting: deque[float] = deque()
        self._seen: deque[float] = deque()
        self._sizes: list[float] = []
        self._agreements = 0
        self._value: float | None = None

    @property
    def count(self) -> int:
        """How many values the scale is made of."""
        return len(self._seen)

    @property
    def missing(self) -> int:
        """How many values are still needed."""
        return max(0, self._learning - len(self._seen))

    @property
    def value(self) -> float:
        """The scale; until enough is known the prior, or what a few values can bound it to: enough to see jumps."""
        if self._value is None:  # asked for many times between two values
            self._value = self._scale()
        return self._value

    def _scale(self) -> float:
        if self.missing == 0:
            return max(self._quantile(), self._least)
        if len(self._sizes) < FEW:
            return self._prior
        return min(self._prior, max(FEW_CAUTION * self._sizes[-1], self._least))

    @property
    def correlation(self) -> float:
        """Positive lag-one correlation, from signs: ``E[sign x_t sign x_t-1] = 2/π asin φ`` for a Gaussian.

        Relative to the variance that is assumed (a small correlated part of a large one does no harm), shrunk
        by its standard error and at most 0.9. A negative one only makes false alarms rarer: 0 then.
        """
        n = len(self._seen)
        if n < 8 or self.missing > 0:
            return 0.0
        phi = self._sign_correlation() - 0.5 * math.pi / math.sqrt(n)
        share = min(self._quantile() / max(self.value, 1e-12), 1.0)
        return min(max(phi, 0.0), 0.9) * share**2

    @property
    def independent(self) -> float:
        """How many independent values those seen are worth: ``n (1 - φ) / (1 + φ)`` of an AR(1), at least 1."""
        phi = min(max(self._sign_correlation(), 0.0), 1.0)
        return max(len(self._seen) * (1.0 - phi) / (1.0 + phi), 1.0)

    def learn(self, x: float) -> None:
        """Take in a believed value."""
        self._waiting.append(float(x))
        # While little is known, news is worth more than caution.
        if self.missing == 0 and len(self._waiting) <= min(self._wait, len(self._seen) // 2):
            return
        x = self._waiting.popleft()
        self._value = None
        if self._seen:
            self._agreements += _agreement(x, self._seen[-1])
        self._seen.append(x)
        insort(self._sizes, abs(x))
        if len(self._seen) > self._memory:
            old = self._seen.popleft()
            self._agreements -= _agreement(old, self._seen[0])
            del self._sizes[bisect_left(self._sizes, abs(old))]

    def _sign_correlation(self) -> float:
        return math.sin(0.5 * math.pi * self._agreements / max(len(self._seen) - 1, 1))

    def _quantile(self) -> float:
        return self._sizes[min(int(_ONE_SIGMA * len(self._sizes)), len(self._sizes) - 1)]

    def drop_waiting(self) -> None:
        """Forget what has not counted yet: it was contradicted."""
        self._waiting.clear()


def _agreement(a: float, b: float) -> int:
    """Product of the signs."""
    if a == 0.0 or b == 0.0:
        return 0
    return 1 if (a > 0.0) == (b > 0.0) else -1
