"""How often an object is told of while nearer ones cover a part of it.

Where two boxes overlap, nobody knows how much of the hidden object looks out: a detector may lose it, or hold it for
minutes. What tells is whether it was told of while it was covered as much as now.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

_KEPT = 100  # messages
_JITTER = 0.05  # of the box: what the errors of detected edges make of its cover


@dataclass(slots=True)
class CoverHabit:
    """One object's detections and misses, by the share of its box that was covered.

    Examples
    --------
    >>> habit = CoverHabit()
    >>> habit.miss(0.5) is None  # it was never told of while it was covered so much
    True
    >>> for _ in range(20):
    ...     habit.tell(0.5)
    >>> [round(habit.miss(0.5), 3) for _ in range(3)]
    [0.087, 0.125, 0.16]
    >>> habit.miss(0.7) is None
    True
    """

    told: deque[float] = field(default_factory=lambda: deque(maxlen=_KEPT))
    missed: deque[float] = field(default_factory=lambda: deque(maxlen=_KEPT))

    def tell(self, cover: float) -> None:
        """It was told of."""
        self.told.append(cover)

    def miss(self, cover: float) -> float | None:
        """It was not; the probability of that because of its cover, None if it was never told of with that much.

        Laplace's rule of succession: it was told of n times while it was covered at least as much, and missed m times
        while it was covered no more. Before any of them, every probability of a miss is equally likely.
        """
        told = sum(other >= cover - _JITTER for other in self.told)
        missed = sum(other <= cover + _JITTER for other in self.missed)
        self.missed.append(cover)
        return (missed + 1) / (told + missed + 2) if told else None
