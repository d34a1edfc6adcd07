"""Whether heights can be compared: a wheel odometry or a 2-D localisation knows of none."""

from __future__ import annotations

import numpy as np

from belie.geometry import FloatArray

_AFTER_M = 5.0
_FLAT_M = 1e-6


class Heights:
    """Watches position and odometry for a z that never changes though the other one's does.

    Examples
    --------
    >>> heights = Heights()
    >>> for i in range(20): heights.see(np.array([1.0 * i, 0.0, 0.05 * i]), np.array([1.0 * i, 0.0, 0.0]))
    >>> heights.tested.tolist()
    [True, True, False]
    """

    def __init__(self) -> None:
        self._first: tuple[FloatArray, FloatArray] | None = None
        self._flat = [True, True]
        self._last_m = np.zeros(3)
        self._travelled_m = 0.0
        self.tested = np.ones(3, dtype=bool)

    def see(self, p_m: FloatArray, q_m: FloatArray) -> None:
        """Take in a position and the odometry's, both shape (3,)."""
        if self._first is None:
            self._first, self._last_m = (p_m, q_m), q_m
        self._travelled_m += float(np.linalg.norm(q_m - self._last_m))
        self._last_m = q_m
        for i, (first, now) in enumerate(zip(self._first, (p_m, q_m), strict=True)):
            self._flat[i] = self._flat[i] and abs(float(now[2] - first[2])) < _FLAT_M
        self.tested[2] = not (self._travelled_m > _AFTER_M and self._flat[0] != self._flat[1])
