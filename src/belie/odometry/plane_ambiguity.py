"""The other motion: two images of a plane are explained by two motions, and only a third image tells which is true.

A plane ``n' X = 1`` carries corners from image to image by ``H = R + t n'``. The same H, up to its scale, is that of a
second plane and a second motion, whose translation lies along the first plane's normal and whose normal lies along the
first translation (Longuet-Higgins, "The reconstruction of a plane surface from two perspective projections", 1986).
Where the scene stands out from its plane, two images already fit one of the two better. Where it does not, both maps
are followed: a plane that stands still keeps its normal in the world, and of the two only the true one does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from belie.geometry import SE3, FloatArray
from belie.odometry.depth_filter import TrackedCorners
from belie.odometry.relative_pose import RelativePose, direction_cost

_SAME = 9.0  # chi2 of two motions that are told apart no better than by three sigma
_SHARED = (
    4.0  # corners are no independent witnesses: of their evidence a fourth counts, see `pose_covariance`
)
_WRONG = 1e-6  # chance that the motion that is given up was the true one
_REFUTED = 2.0 * _SHARED * math.log(1.0 / _WRONG)  # Wald's sequential test, as a difference of chi2
_USUAL_CHI2 = 0.7  # median of a corner's chi2, between one degree of freedom and two
# In differences of the two motions, along which nothing is known while both stand. A claim of the other motion is then
# a quarter of a sigma off, of which no CUSUM for half a sigma or more gathers anything.
_BETWEEN = 4.0
_FITS = 10  # of the plane, reweighted


@dataclass(slots=True, eq=False)
class OtherMotion:
    """A map beside the map: what the corners would be like if the other motion were the true one.

    corners : the same corners with the other depths; pose : its latest motion; evidence : against it, chi2.
    """

    corners: TrackedCorners
    pose: RelativePose
    evidence: float

    def weigh(self, pose: RelativePose) -> None:
        """Add what a further image tells between `pose` and the other one."""
        self.evidence += evidence_between(pose, self.pose)

    @property
    def refuted(self) -> bool:
        """Whether the images speak against it."""
        return self.evidence > _REFUTED

    @property
    def proven(self) -> bool:
        """Whether the images speak against the one that was preferred to it."""
        return self.evidence < -_REFUTED

    def doubt(self, pose: RelativePose) -> FloatArray:
        """Covariance, shape (6, 6), that the other motion adds to that of `pose`: along their difference."""
        apart = _BETWEEN * (self.pose.T_cur_prev @ pose.T_cur_prev.inverse()).log()
        return np.outer(apart, apart)


def evidence_between(better: RelativePose, other: RelativePose) -> float:
    """How much worse the same corners fit the other motion, chi2 in units of the noise that the better one leaves."""
    left = float(np.median(better.chi2)) / _USUAL_CHI2
    return (direction_cost(other) - direction_cost(better)) / max(1.0, left)


def is_refuted(better: RelativePose, other: RelativePose) -> bool:
    """Whether two images alone refute the other motion."""
    return evidence_between(better, other) > _REFUTED


def is_another(pose: RelativePose, other: RelativePose) -> bool:
    """Whether two motions of the same length are told apart at all."""
    apart = (other.T_cur_prev @ pose.T_cur_prev.inverse()).log()
    return bool(apart @ np.linalg.solve(pose.covariance, apart) > _SAME)


def motions_of_plane(previous: FloatArray, pose: RelativePose) -> list[SE3]:
    """Where to look for the other motion: those that the plane nearest to the corners allows, lengths as in `pose`.

    Parameters
    ----------
    previous : array (N, 2)
        Undistorted coordinates (X/Z, Y/Z) of the corners.
    pose : RelativePose
        One motion, with the inverse depths that follow from it.

    Examples
    --------
    >>> grid = np.stack(np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9)), axis=-1).reshape(-1, 2)
    >>> T = SE3.exp([0.1, 0.0, -0.1, 0.0, 0.0, 0.0])
    >>> wall = RelativePose(T_cur_prev=T, covariance=np.eye(6), inverse_depth=np.full(81, 0.5),
    ...     inverse_depth_variance=np.full(81, 1e-6), chi2=np.zeros(81), across2=np.zeros(81))
    >>> sorted((motion.t.round(2) + 0.0).tolist() for motion in motions_of_plane(grid, wall))
    [[0.0, 0.0, -0.14], [0.1, 0.0, -0.1]]
    """
    rays = np.column_stack([previous, np.ones(len(previous))])
    told = pose.weight / pose.inverse_depth_variance
    weight = told
    normal: FloatArray = np.zeros(3)
    for _ in range(_FITS):
        A = rays * weight[:, None]
        normal = np.asarray(np.linalg.lstsq(A.T @ rays, A.T @ pose.inverse_depth, rcond=None)[0])
        off2 = (pose.inverse_depth - rays @ normal) ** 2
        # Geman and McClure's weights: at three sigma of the depths, or of how far the scene stands out from the plane.
        scale2 = np.maximum(9.0 * pose.inverse_depth_variance, float(np.median(off2)))
        weight = (scale2 / (scale2 + off2)) ** 2 * told
    T = pose.T_cur_prev
    _, rotations, translations, normals = cv2.decomposeHomographyMat(T.R + np.outer(T.t, normal), np.eye(3))
    length = float(np.linalg.norm(T.t))
    motions = []
    for R, t, n in zip(rotations, translations, normals, strict=True):
        size = float(np.linalg.norm(t))
        # Of the two signs the one with the corners in front of the camera.
        if size > 0.0 and float(np.mean(rays @ n.ravel() > 0.0)) > 0.5:
            motions.append(SE3(R, t.ravel() * (length / size)))
    return motions
