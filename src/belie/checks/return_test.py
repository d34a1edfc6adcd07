"""After a contradiction: whether the position is back where dead reckoning from before the lie leads.

While nothing is learned the prediction's own error is common to all claims, so their innovations are not
white and a CUSUM of them would never end. The mean of the last claims is tested instead,
``x' (H P H' + R / n)^-1 x`` against a χ² of three degrees of freedom: P is the prediction's covariance, which
grows with the odometry's drift as long as the lie lasts, R the noise of one of n claims.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from scipy.special import chdtri

from belie.checks.sequential import Evidence
from belie.geometry import FloatArray

_GATE = float(chdtri(3, 0.01))
_FEWEST = 3


class Return:
    """Waits for positions to return.

    Parameters
    ----------
    accusation : Evidence
        What began the contradiction.
    release_s : float
        How long positions must agree.

    Examples
    --------
    >>> accusation = Evidence(
    ...     contradicted=True, statistic=9.0, threshold=8.0, unit="llr", component=0, onset_ns=0)
    >>> wait, S, R = Return(accusation, 0.3), 0.1 * np.eye(3), 0.05 * np.eye(3)
    >>> [wait.update(np.array([2.0, 0, 0]), S, R, i * 10**8).contradicted for i in range(5)]
    [True, True, True, True, True]
    >>> [wait.update(np.array([0.1, 0, 0]), S, R, (5 + i) * 10**8).contradicted for i in range(8)][-1]
    False
    """

    def __init__(self, accusation: Evidence, release_s: float) -> None:
        self._accusation, self._release_ns = accusation, round(release_s * 1e9)
        self._recent: deque[tuple[int, FloatArray]] = deque()

    def update(self, innovation: FloatArray, S: FloatArray, noise: FloatArray, stamp_ns: int) -> Evidence:
        """Test an innovation, shape (3,), of covariance S (3, 3), of which `noise` is the claim's own."""
        recent = self._recent
        recent.append((stamp_ns, innovation))
        while len(recent) > _FEWEST and stamp_ns - recent[1][0] >= self._release_ns:
            recent.popleft()
        mean = np.mean([x for _, x in recent], axis=0)
        covariance = S - noise + noise / len(recent)
        statistic = float(mean @ np.linalg.solve(covariance, mean))
        alone = float(innovation @ np.linalg.solve(S, innovation))
        short = len(recent) < _FEWEST or stamp_ns - recent[0][0] < self._release_ns
        accusation = self._accusation
        return Evidence(
            contradicted=short or statistic > _GATE or alone > _GATE,
            statistic=max(statistic, alone), threshold=_GATE, unit="chi2",
            component=accusation.component, onset_ns=accusation.onset_ns,
        )  # fmt: skip
