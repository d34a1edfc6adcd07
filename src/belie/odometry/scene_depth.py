"""How far the corners in a box are, if the scene stands still, and how far the ground is under it.

Inverse depth is linear in the image over any plane: ``1/Z = n·(x, y, 1) / h``. So the ground is a straight-line fit
through the depths of the corners below the horizon, and so is a facade.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, FloatArray

_LEAST = 12
_TRIES = 60
_MOST_TILTED = 0.15  # tangent; 9 degrees
_TOLERANCE = 0.08  # of the depth: roads are cambered and rough


@dataclass(frozen=True, slots=True)
class InverseDepthPlane:
    """A plane of the scene: ``1/Z = a x + b y + c`` over undistorted coordinates (X/Z, Y/Z)."""

    coefficients: FloatArray

    def at(self, xy: FloatArray) -> FloatArray:
        """Inverse depths at points (N, 2)."""
        return np.asarray(xy @ self.coefficients[:2] + self.coefficients[2])


def fit_plane(
    xy: FloatArray, inverse_depth: FloatArray, sigma: FloatArray, *, least: int = _LEAST, share: float = 0.5
) -> InverseDepthPlane | None:
    """The plane that at least `share` of the points lie on; None if there is none.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> xy = rng.uniform(-1, 1, (50, 2))
    >>> plane = fit_plane(xy, 0.2 * xy[:, 1] + 0.3, np.full(50, 1e-3))
    >>> bool(np.allclose(plane.coefficients, [0.0, 0.2, 0.3], atol=1e-3))
    True
    """
    n = len(xy)
    if n < least:
        return None
    A = np.column_stack([xy, np.ones(n)])
    limit = 2.0 * sigma + _TOLERANCE * np.abs(inverse_depth)
    rng = np.random.default_rng(0)
    chosen = rng.integers(0, n, (_TRIES, 3))
    triples = A[chosen]
    usable = np.abs(np.linalg.det(triples)) > 1e-6
    if not usable.any():
        return None
    models = np.linalg.solve(triples[usable], inverse_depth[chosen[usable]][..., None])[..., 0]
    agree = np.abs(A @ models.T - inverse_depth[:, None]) <= limit[:, None]
    inliers = agree[:, int(agree.sum(axis=0).argmax())]
    for _ in range(2):
        if inliers.sum() < max(least, share * n):
            return None
        w = 1.0 / limit[inliers]
        solution = np.linalg.lstsq(A[inliers] * w[:, None], inverse_depth[inliers] * w, rcond=None)[0]
        inliers = np.abs(A @ solution - inverse_depth) <= limit
    return (
        InverseDepthPlane(np.asarray(solution, dtype=np.float64))
        if inliers.sum() >= max(least, share * n)
        else None
    )


def ground_plane(xy: FloatArray, inverse_depth: FloatArray, sigma: FloatArray) -> InverseDepthPlane | None:
    """The ground before the camera: a plane below it on which many corners of the lower image lie.

    Its inverse depth grows downwards and little sideways; anything else is a wall.
    """
    low = xy[:, 1] > 0.05
    plane = fit_plane(xy[low], inverse_depth[low], sigma[low], least=20, share=0.3)
    if plane is None:
        return None
    a, b, c = plane.coefficients
    # Rolled and pitched by no more than a robot is that drives: its horizon is near the middle of the image.
    upright = b > 0.0 and abs(a) < _MOST_TILTED * b and abs(c) < _MOST_TILTED * b
    return plane if upright else None


def static_inverse_depth(
    first: FloatArray, now: FloatArray, T_now_first: SE3, sigma: float
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Inverse depths, in the present camera, of corners that are taken for parts of a scene that stands still.

    Parameters
    ----------
    first, now : arrays (N, 2)
        Undistorted coordinates when they were first seen, and now.
    T_now_first : SE3
        The camera's own motion, in map units.
    sigma : float
        Error of a position, in the same units as `now`.

    Returns
    -------
    inverse_depth, deviation : arrays (N,)
        1 per map unit.
    still : array (N,), bool
        Whether the corner lies on its epipolar line: what moves across it is no part of a still scene.

    Examples
    --------
    >>> rho, sd, still = static_inverse_depth(np.array([[0.1, 0.1]]), np.array([[0.125, 0.125]]),
    ...                                       SE3.from_translation([0, 0, -2.0]), 1e-3)
    >>> rho.round(3), still
    (array([0.125]), array([ True]))
    """
    a = np.column_stack([first, np.ones(len(first))]) @ T_now_first.R.T
    t = T_now_first.t
    g = now * t[2] - t[:2]
    h = a[:, :2] - now * a[:, 2:3]
    power = np.maximum((g * g).sum(axis=1), 1e-18)
    rho_first = (g * h).sum(axis=1) / power
    z = np.maximum(a[:, 2] + rho_first * t[2], 0.05)
    off = h - rho_first[:, None] * g
    still = np.sqrt((off * off).sum(axis=1)) / np.abs(z) <= 3.0 * sigma
    rho = rho_first / z
    deviation = sigma * np.abs(a[:, 2]) / np.sqrt(power) / z
    return rho, deviation, still
