"""How far a detector's edges lie from where the pixels expect them: their usual noise, and jumps."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from belie.geometry import FloatArray

_LEAST = 0.035  # of the box's sides: at 3 % jitter
_MOST = 0.2  # beyond, nothing can be seen to pass
_LEARNS = 0.01  # share by which one edge corrects it
_MEDIAN = 0.6745  # of a normal error's size, in deviations
_STEPS = 5  # messages: two jumps among them are none of its habits


@dataclass(slots=True)
class EdgeNoise:
    """A running median of one stream's errors.

    >>> noise = EdgeNoise()
    >>> for _ in range(60):
    ...     noise.learn(np.full(4, 0.06))
    >>> round(noise.deviation, 2)
    0.09
    """

    deviation: float = _LEAST  # of the box's sides

    def learn(self, error: FloatArray) -> None:
        """Correct it by some edges, shape (N,), as shares of the sides; a few wild ones change it little."""
        larger = np.count_nonzero(error > _MEDIAN * self.deviation)
        deviation = self.deviation * float(np.exp(_LEARNS * (2.0 * larger - len(error))))
        self.deviation = min(max(deviation, _LEAST), _MOST)


@dataclass(slots=True)
class BoxSteps:
    """How the told box of one object moves against the pixels in it, from message to message.

    An object's box keeps with its pixels; through a box with nothing in it they go steadily. Neither jumps.

    >>> steps = BoxSteps()
    >>> for step in (0.01, -0.02, 0.0):
    ...     excess = steps.excess(np.full(4, step))
    >>> steps.excess(np.array([0.3, 0.0, 0.3, 0.0])).round(2).tolist()
    [0.3, 0.0, 0.3, 0.0]
    """

    _latest: deque[FloatArray] = field(default_factory=lambda: deque(maxlen=_STEPS))

    def excess(self, step: FloatArray) -> FloatArray:
        """By how much a step of the edges, shape (4,), in sides, is larger than the median of the latest."""
        self._latest.append(step)
        return np.asarray(step - np.median(np.array(self._latest), axis=0))
