"""Innovations of a Kalman filter, tested: made white by what a long memory saw of them, then added up."""

from __future__ import annotations

import numpy as np

from belie.checks.running_scale import RunningScale
from belie.checks.sequential import CusumBank, Evidence, SequentialSettings
from belie.geometry import FloatArray


class InnovationTest:
    """Scales innovations to what is seen, never below what is promised, and runs the sequential tests.

    `ResidualTest` learns from tens of frames; a drag-off of a position lasts longer than that, so the memory
    here is a minute.

    Examples
    --------
    >>> test = InnovationTest(1, SequentialSettings(), tests=1, memory=600, learning=20, waiting=50)
    >>> rng = np.random.default_rng(0)
    >>> clean = [test.update(rng.normal(size=1), np.eye(1), i * 10**8, 0.1) for i in range(300)]
    >>> any(e.contradicted for e in clean)
    False
    >>> test.update(np.array([20.0]), np.eye(1), 3 * 10**10, 0.1).contradicted
    True
    """

    def __init__(
        self,
        components: int,
        sequential: SequentialSettings,
        *,
        tests: int,
        memory: int,
        learning: int,
        waiting: int,
    ) -> None:
        self._scales = [
            RunningScale(prior=1.0, least=1.0, memory=memory, learning=learning, waiting=waiting)
            for _ in range(components)
        ]
        self._sequential, self._tests = sequential, tests
        self._bank = CusumBank(components, sequential, tests)
        self._previous = np.zeros(components)
        self.sigma = np.full(components, np.inf)

    @property
    def missing(self) -> int:
        """How many believed innovations are missing before slow lies are looked for."""
        return self._scales[0].missing

    @property
    def scale(self) -> FloatArray:
        """How many times larger innovations are than promised, at least 1, shape (components,)."""
        return np.array([scale.value for scale in self._scales])

    def update(self, innovation: FloatArray, S: FloatArray, stamp_ns: int, interval_s: float) -> Evidence:
        """Test an innovation, shape (m,), of covariance S, shape (m, m); learn from it if it is believed."""
        promised = np.sqrt(np.diag(S))
        self.sigma = self.scale * promised
        x = innovation / self.sigma
        phi = np.array([scale.correlation for scale in self._scales])
        white = (x - phi * self._previous) / np.sqrt(1.0 - phi**2)
        evidence = self._bank.update(white, stamp_ns, interval_s, self.missing > 0)
        self._previous = x
        for scale, y in zip(self._scales, innovation / promised, strict=True):
            if evidence.contradicted:
                scale.drop_waiting()
            else:
                scale.learn(float(y))
        return evidence

    def restart(self) -> None:
        """Begin the tests anew, with the noise that is known."""
        self._bank = CusumBank(len(self._scales), self._sequential, self._tests)
        self._previous = np.zeros(len(self._scales))

    def floor(self, claims: int) -> FloatArray:
        """Steady innovation, in its own unit, that is found within `claims` claims on average."""
        return np.asarray(self._bank.smallest_shift(claims) * self.sigma)
