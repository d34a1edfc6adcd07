"""How far a detector's edges lie from where the pixels expect them: their usual noise, and jumps."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from belie.geometry import FloatArray

_LEAST = 0.035  # of the box's sides: at 3 % jitter
_MOST = 0.2  # beyond, nothing can be seen to pass
_KEPT, _PRIOR = 200, 8  # edges; those that the expectation counts
_AT_ONCE = 8  # edges
_MEDIAN = 0.6745  # of a normal error's size, in deviations
_STEPS = 5  # messages: two jumps among them are none of its habits
_KNOWN = 3  # messages from which on their median means anything
_OF_A_STEP = math.sqrt(2.0 * (1.0 + 0.3))  # deviations of an edge: that of a step less the median of some


@dataclass(slots=True)
class EdgeNoise:
    """The noise of one stream's edges, by the median of the latest.

    >>> noise = EdgeNoise()
    >>> for _ in range(10):
    ...     noise.learn(np.full(4, 0.06))
    >>> round(noise.deviation, 2)
    0.09
    """

    deviation: float = _LEAST  # of the box's sides
    _new: int = 0  # edges since it was last told
    _errors: deque[float] = field(default_factory=lambda: deque([_MEDIAN * _LEAST] * _PRIOR, maxlen=_KEPT))

    def learn(self, errors: FloatArray) -> None:
        """Take over the errors of some edges, shape (N,), as shares of the sides; a few wild ones change it little."""
        self._errors.extend(errors.tolist())
        self._new += len(errors)
        if self._new >= _AT_ONCE:
            self._new = 0
            self.deviation = min(max(median(self._errors) / _MEDIAN, _LEAST), _MOST)


@dataclass(slots=True)
class BoxSteps:
    """How the told box of one object moves against the pixels in it, from message to message.

    An object's box keeps with its pixels; through a box with nothing in it they go steadily. Neither jumps.

    >>> steps = BoxSteps()
    >>> for step in (0.01, -0.02, 0.0):
    ...     excess = steps.excess(np.full(4, step))
    >>> steps.excess(np.array([0.3, 0.0, 0.3, 0.0])).round(2).tolist()
    [0.29, 0.0, 0.29, 0.0]
    >>> steps.noise is None, steps.noise.round(2).tolist()
    (False, [0.19, 0.0, 0.19, 0.0])
    """

    noise: FloatArray | None = None  # of one told edge, (4,), by the latest step; None until some are known
    _middle: FloatArray = field(default_factory=lambda: np.zeros(4))  # of the latest
    _latest: deque[FloatArray] = field(default_factory=lambda: deque(maxlen=_STEPS))

    def excess(self, step: FloatArray) -> FloatArray:
        """By how much a step of the edges, shape (4,), in sides, is larger than the median of the latest."""
        if len(self._latest) >= _KNOWN:  # both boxes of a step err, and a little their median
            self.noise = np.abs(step - self._middle) / _OF_A_STEP
        self._latest.append(step)
        # The (upper) median, edge by edge.
        self._middle = np.sort(np.array(self._latest), axis=0)[len(self._latest) // 2]
        return np.asarray(step - self._middle)
