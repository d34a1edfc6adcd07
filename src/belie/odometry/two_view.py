"""The first baseline: motion from two frames of which nothing is known yet.

Essential matrix by RANSAC (Nistér's five points, in OpenCV) and the one of its four decompositions that
puts the points in front of both cameras.
"""

from __future__ import annotations

import cv2
import numpy as np

from belie.geometry import SE3, FloatArray, so3_log

_LEAST_POINTS = 12
_FARTHEST = 1e5  # baselines; OpenCV's own limit of 50 refuses a plain road scene
_SMALL = 0.01  # flow for which the plane's hidden translation is tried, focal lengths
_LEAST_AGREEING = 0.5  # of the points; fewer, and the scene is not one rigid thing


def relative_pose_from_scratch(previous: FloatArray, current: FloatArray, sigma: float) -> SE3 | None:
    """``T_cur_prev`` with a translation of length one, or None where no motion explains the points.

    Parameters
    ----------
    previous, current : arrays (N, 2)
        Undistorted coordinates (X/Z, Y/Z) of the same corners.
    sigma : float
        Their standard deviation; agreement is within three of it.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> points = np.column_stack([rng.uniform(-4, 4, (60, 2)), rng.uniform(5, 20, 60)])
    >>> moved = points - (0.0, 0.0, 1.0)
    >>> T = relative_pose_from_scratch(points[:, :2] / points[:, 2:], moved[:, :2] / moved[:, 2:], 1e-3)
    >>> (T.t + 0.0).round(3)
    array([ 0.,  0., -1.])
    """
    if len(previous) < _LEAST_POINTS:
        return None
    cv2.setRNGSeed(0)  # RANSAC draws from OpenCV's own generator: the same images give the same answer
    E, _ = cv2.findEssentialMat(previous, current, np.eye(3), cv2.RANSAC, 0.999, 3.0 * sigma)
    if E is None or E.shape[0] < 3:
        return None
    agreeing, R, t, _, _ = cv2.recoverPose(E[:3], previous, current, np.eye(3), distanceThresh=_FARTHEST)
    if agreeing < _LEAST_AGREEING * len(previous):
        return None
    return SE3.from_matrix(np.column_stack([R, t.ravel()]))


def rotation_between(
    previous: FloatArray, current: FloatArray, sigma: float
) -> tuple[FloatArray, FloatArray]:
    """Robust rotation ``R_cur_prev`` of points at infinity, and what it leaves of each point's motion.

    Kabsch's solution on the viewing rays, reweighted three times (Geman-McClure, three sigma).

    Returns
    -------
    R : array (3, 3)
    parallax : array (N,)
        Angle between each rotated ray and the observed one, rad.

    Examples
    --------
    >>> R, parallax = rotation_between(np.zeros((3, 2)), np.zeros((3, 2)), 1e-3)
    >>> R.round(6).diagonal(), parallax
    (array([1., 1., 1.]), array([0., 0., 0.]))
    """
    rays_prev = np.column_stack([previous, np.ones(len(previous))])
    rays_cur = np.column_stack([current, np.ones(len(current))])
    rays_prev /= np.linalg.norm(rays_prev, axis=1, keepdims=True)
    rays_cur /= np.linalg.norm(rays_cur, axis=1, keepdims=True)
    weight = np.ones(len(previous))
    R = np.eye(3)
    parallax = np.zeros(len(previous))
    for _ in range(4):
        U, _, Vt = np.linalg.svd((rays_cur * weight[:, None]).T @ rays_prev)
        R = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt
        parallax = np.linalg.norm(rays_cur - rays_prev @ R.T, axis=1)
        scale2 = max(9.0 * sigma * sigma, float(np.median(parallax)) ** 2)
        weight = (scale2 / (scale2 + parallax**2)) ** 2
    return R, parallax


def hidden_rotation(px: FloatArray) -> float:
    """Rotation that a sideways translation is taken for, in units of the parallax that it leaves.

    Of a wall seen face on: there all corners flow alike, and what tells the two apart is only that a rotation bends the
    flow away from the middle of the image. The narrower the view, the less.

    Parameters
    ----------
    px : array (N, 2)
        Undistorted coordinates (X/Z, Y/Z) of the corners.

    Examples
    --------
    >>> grid = np.stack(np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9)), axis=-1).reshape(-1, 2)
    >>> [round(hidden_rotation(half_width * grid)) for half_width in (1.0, 0.5, 0.25)]
    [4, 11, 39]
    """
    ratios = []
    for axis in np.eye(2):
        R, parallax = rotation_between(px, px + _SMALL * axis, 1.0)
        ratios.append(float(np.linalg.norm(so3_log(R))) / max(float(np.median(parallax)), 1e-3 * _SMALL))
    return max(ratios)
