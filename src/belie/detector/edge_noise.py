"""How far a detector's edges lie from where the pixels expect them: each detector has its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from belie.geometry import FloatArray

_LEAST = 0.035  # of the box's sides: at 3 % jitter
_MOST = 0.2  # beyond, nothing can be seen to pass
_LEARNS = 0.01  # share by which one edge corrects it
_MEDIAN = 0.6745  # of a normal error's size, in deviations


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
