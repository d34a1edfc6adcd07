"""Systematic errors that are no lies: estimated slowly, so that what is left is noise or a lie.

A camera that sits a degree askew, a focal length that is 1 % off, a gyroscope's bias, the scale that a single
camera cannot see: each shows as a steady residual. A Kalman filter carries them; its innovations are (nearly)
white while nobody lies, which is what a sequential test needs. What the filter may absorb is bounded by its prior
and by its random walk; both are settings with a unit, and both enter the minimum detectable lie.
"""

from __future__ import annotations

import numpy as np

from belie.geometry import FloatArray, so3_log

_TRUSTED_SIGMA = 1.5
_SHORTEST_S = 0.01  # between two frames; closer ones tell nothing of a rate


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

    def predict(
        self, exposure: FloatArray | float, keep: FloatArray | float = 1.0, drive: FloatArray | float = 0.0
    ) -> None:
        """Let the parameters wander.

        `exposure` is time, distance or frames; `keep` is the share of a parameter that is left (a first-order
        Gauss-Markov process), `drive` a variance that is added. Each is one number, or one for every parameter.
        """
        kept = np.broadcast_to(keep, self.mean.shape)
        self.mean = kept * self.mean
        P = np.outer(kept, kept) * self.covariance
        before = np.diag(P)
        # Nothing wanders further than it could have been at the start.
        wandered = np.minimum(before + self._walk * exposure, np.maximum(self._prior, before))
        self.covariance = P + np.diag(wandered + drive - before)

    def innovation(self, r: FloatArray, H: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residual that the parameters do not explain, shape (m,), and its covariance, shape (m, m)."""
        return r - H @ self.mean, H @ self.covariance @ H.T + noise

    def learn(self, innovation: FloatArray, S: FloatArray, H: FloatArray, calm: float = 1.0) -> None:
        """Kalman update; the further beyond 1.5 sigma a vector is, the less it moves the parameters.

        `calm` is 1 without evidence of a lie, 0 where it suffices for an accusation.
        Residuals are made of vectors of three, translations and rotations: a wild rotation is no reason to learn
        nothing from the translation.

        A filter that starts up, a pothole, a lie not yet found: none of them is the camera's mount.
        """
        vectors = (innovation**2 / np.diag(S)).reshape(-1, 3 if len(innovation) % 3 == 0 else len(innovation))
        size = np.repeat(np.sqrt(vectors.mean(axis=1)), vectors.shape[1])
        doubt = np.maximum(1.0, size / _TRUSTED_SIGMA)
        # S - H P H' is the noise that S was made of; less weight is more noise.
        explained = H @ self.covariance @ H.T
        noise = (S - explained) * np.outer(doubt, doubt)
        gain = np.linalg.solve(explained + noise, H @ self.covariance).T
        # While evidence gathers, what has a prior learns half as fast: it may be a lie. What a turn left behind is not.
        gain = gain * np.where(self._prior > 0.0, 0.5 + 0.5 * calm, 1.0)[:, None]
        self.mean = self.mean + gain @ innovation
        A = np.eye(len(self.mean)) - gain @ H  # Joseph's form keeps the covariance positive
        P = A @ self.covariance @ A.T + gain @ noise @ gain.T
        self.covariance = 0.5 * (P + P.T)

    def forget(self, index: int, sigma: float) -> None:
        """Widen one parameter to `sigma` and cut its ties to the others: it may have jumped."""
        self.covariance[index, :] = 0.0
        self.covariance[:, index] = 0.0
        self.covariance[index, index] = sigma**2


def rotation_correction(
    R_prev_cur: FloatArray, covariance: FloatArray, interval_s: float, gain: float, lasts_s: float
) -> tuple[float, FloatArray]:
    """How a slow error of a rotation evolves in a frame: the share that is left, and the variance that is added (3,).

    A first-order Gauss-Markov process, steady for tens of frames, of two origins. A turn is measured with a relative
    error, and an inertial filter works that error off over seconds, long after the turn: its stationary standard
    deviation is `gain` times the rate of the turn (rad/s). And where corners leave rotation and sideways motion hard
    to tell apart (few of them, or all at one depth), what they err by lasts as long as they are seen: no frame errs
    for itself by the `covariance`, shape (3, 3), of the seen rotation, they err together.

    >>> share, variance = rotation_correction(np.eye(3), np.diag([1e-8, 0.0, 0.0]), 0.1, 0.01, 3.0)
    >>> round(share, 3), variance.round(9)
    (0.967, array([6.4e-08, 0.0e+00, 0.0e+00]))
    """
    share = float(np.exp(-interval_s / lasts_s))
    rate_rad_s = float(np.linalg.norm(so3_log(R_prev_cur))) / interval_s
    stationary = (gain * rate_rad_s) ** 2 + np.diag(covariance) / max(interval_s, _SHORTEST_S) ** 2
    return share, np.asarray((1.0 - share**2) * stationary)
