"""Triangulation of equation (3): the point nearest to all the rays that saw it.

The N-view midpoint (Hartley and Sturm, "Triangulation", 1997, for two views; its least-squares form
for more): the X that minimises ``sum_i |(I - d_i d_i') (X - c_i)|²``, with c_i the camera centres and
d_i the unit rays. Linear, so one 3x3 solve a point.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from belie.geometry.compiled import compiled
from belie.geometry.se3 import FloatArray

_SINGULAR = 1e-12


@compiled()
def _solve_symmetric_3(A: FloatArray, b: FloatArray, x: FloatArray) -> bool:
    c00 = A[1, 1] * A[2, 2] - A[1, 2] * A[1, 2]
    c01 = A[0, 2] * A[1, 2] - A[0, 1] * A[2, 2]
    c02 = A[0, 1] * A[1, 2] - A[0, 2] * A[1, 1]
    determinant = A[0, 0] * c00 + A[0, 1] * c01 + A[0, 2] * c02
    if abs(determinant) < _SINGULAR:
        return False
    c11 = A[0, 0] * A[2, 2] - A[0, 2] * A[0, 2]
    c12 = A[0, 1] * A[0, 2] - A[0, 0] * A[1, 2]
    c22 = A[0, 0] * A[1, 1] - A[0, 1] * A[0, 1]
    x[0] = (c00 * b[0] + c01 * b[1] + c02 * b[2]) / determinant
    x[1] = (c01 * b[0] + c11 * b[1] + c12 * b[2]) / determinant
    x[2] = (c02 * b[0] + c12 * b[1] + c22 * b[2]) / determinant
    return True


@compiled()
def triangulate_rays(
    centres: FloatArray,
    rays: FloatArray,
    starts: npt.NDArray[np.int64],
    min_parallax_rad: float,
    max_angle_rad: FloatArray,
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Points nearest to their rays, and which of them can be trusted.

    Parameters
    ----------
    centres : array (M, 3)
        Camera centre of every observation, world coordinates.
    rays : array (M, 3)
        Unit direction of every observation, world coordinates.
    starts : array (N + 1,)
        Point i owns the observations ``starts[i]`` to ``starts[i + 1] - 1``.
    min_parallax_rad : float
        A point is refused unless two of its rays meet at this angle or more.
    max_angle_rad : array (M,)
        A point is refused if it lies off one of its rays by more than this (the reprojection gate as
        an angle: pixels over focal length).

    Returns
    -------
    points : array (N, 3)
        World coordinates; meaningless where refused.
    accepted : array (N,), bool
        In front of every camera, with enough parallax, near every ray.

    Examples
    --------
    >>> centres = np.array([[0.0, 0, 0], [1, 0, 0]])
    >>> rays = np.array([[0.0, 0, 1], [-1, 0, 4]])
    >>> rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    >>> points, accepted = triangulate_rays(centres, rays, np.array([0, 2]), 0.01, np.full(2, 0.01))
    >>> points.round(6).tolist(), accepted.tolist()
    ([[0.0, 0.0, 4.0]], [True])
    """
    count = len(starts) - 1
    points = np.zeros((count, 3))
    accepted = np.zeros(count, dtype=np.bool_)
    A = np.empty((3, 3))
    b = np.empty(3)
    cos_min_parallax = np.cos(min_parallax_rad)
    for i in range(count):
        first, last = starts[i], starts[i + 1]
        if last - first < 2:
            continue
        smallest_cosine = 1.0
        for m in range(first, last):
            for n in range(m + 1, last):
                cosine = rays[m, 0] * rays[n, 0] + rays[m, 1] * rays[n, 1] + rays[m, 2] * rays[n, 2]
                smallest_cosine = min(smallest_cosine, cosine)
        if smallest_cosine > cos_min_parallax:
            continue
        A[:] = 0.0
        b[:] = 0.0
        for m in range(first, last):
            along = 0.0
            for r in range(3):
                along += rays[m, r] * centres[m, r]
            for r in range(3):
                A[r, r] += 1.0
                b[r] += centres[m, r] - rays[m, r] * along
                for c in range(3):
                    A[r, c] -= rays[m, r] * rays[m, c]
        if not _solve_symmetric_3(A, b, points[i]):
            continue
        good = True
        for m in range(first, last):
            depth = length2 = 0.0
            for r in range(3):
                step = points[i, r] - centres[m, r]
                depth += rays[m, r] * step
                length2 += step * step
            # Cheirality and the gate in one: the angle between the ray and the way to the point.
            if depth <= 0.0 or length2 - depth * depth > (np.tan(max_angle_rad[m]) * depth) ** 2:
                good = False
                break
        accepted[i] = good
    return points, accepted
