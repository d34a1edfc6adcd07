"""Systematic errors that are no lies: estimated slowly, so that what is left is noise or a lie.

A camera that sits a degree askew, a focal length that is 1 % off, a gyroscope's bias, the scale that a single
camera cannot see: each shows as a steady residual. A Kalman filter carries them; its innovations are (nearly)
white while nobody lies, which is what a sequential test needs. What the filter may absorb is bounded by its prior
and by its random walk; both are settings with a unit, and both enter the minimum detectable lie.
"""

from __future__ import annotations

import numpy as np

from belie.geometry import FloatArray

_TRUSTED_SIGMA = 1.5


class SystematicErrors:
    """Kalman filter over slowly changing parameters θ with measurements ``r = H θ + noise``.

    Parameters
    ----------
    prior_sigma : array (n,)
        Standard deviations before anything was seen.
    walk_sigma : array (n,)
        Standard deviation of the random walk in one unit of the exposure given to `predict`.

    Examples
    --------
    >>> errors = SystematicErrors(np.array([1.0]), np.array([0.0]))
    >>> H, noise = np.eye(1), np.array([[0.01]])
    >>> for _ in range(50):
    ...     innovation, S = errors.innovation(np.array([0.3]), H, noise)
    ...     errors.learn(innovation, S, H)
    >>> errors.mean.round(2)
    array([0.3])
    """

    def __init__(self, prior_sigma: FloatArray, walk_sigma: FloatArray) -> None:
        self.mean = np.zeros(len(prior_sigma))
        self.covariance = np.diag(prior_sigma**2)
        self._prior = prior_sigma**2
        self._walk = walk_sigma**2

    def predict(self, exposure: FloatArray | float) -> None:
        """Let the parameters wander; `exposure` is time, distance or frames, one number or one each."""
        grown = np.diag(self.covariance) + self._walk * exposure
        # Nothing wanders further than it could have been at the start.
        bounded = np.minimum(grown, np.maximum(self._prior, np.diag(self.covariance)))
        self.covariance = self.covariance + np.diag(bounded - np.diag(self.covariance))

    def innovation(self, r: FloatArray, H: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residual that the parameters do not explain, shape (m,), and its covariance, shape (m, m)."""
        return r - H @ self.mean, H @ self.covariance @ H.T + noise

    def learn(self, innovation: FloatArray, S: FloatArray, H: FloatArray) -> None:
        """Kalman update; the further beyond 1.5 sigma an innovation is, the less it moves the parameters.

        A filter that starts up, a pothole, a lie not yet found: none of them is the camera's mount.
        """
        size = np.sqrt(max(float(innovation @ np.linalg.solve(S, innovation)) / len(innovation), 1e-12))
        weight = min(1.0, (_TRUSTED_SIGMA / size) ** 2)
        # S - H P H' is the noise that S was made of; less weight is more noise.
        explained = H @ self.covariance @ H.T
        noise = (S - explained) / weight
        gain = np.linalg.solve(explained + noise, H @ self.covariance).T
        self.mean = self.mean + gain @ innovation
        A = np.eye(len(self.mean)) - gain @ H  # Joseph's form keeps the covariance positive
        P = A @ self.covariance @ A.T + gain @ noise @ gain.T
        self.covariance = 0.5 * (P + P.T)

    def forget(self, index: int, sigma: float) -> None:
        """Widen one parameter to `sigma` and cut its ties to the others: it may have jumped."""
        self.covariance[index, :] = 0.0
        self.covariance[:, index] = 0.0
        self.covariance[index, index] = sigma**2
