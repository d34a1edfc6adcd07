"""Rigid motions: the group SE(3), its exponential and its logarithm.

Notation: ``T_a_b`` maps coordinates in frame b to frame a; adjacent names cancel,
``T_world_cam = T_world_body @ T_body_cam``. Twists are ordered translation first, then rotation.
Formulas: Barfoot, *State Estimation for Robotics*, 2nd ed., sections 8.1.2 to 8.1.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_SMALL_ANGLE_RAD = 1e-8


def skew(v: FloatArray) -> FloatArray:
    """Matrix of the cross product: ``skew(v) @ w == cross(v, w)``; shape (3, 3).

    >>> skew(np.array([1.0, 2.0, 3.0])) @ np.array([1.0, 0.0, 0.0])
    array([ 0.,  3., -2.])
    """
    x, y, z = float(v[0]), float(v[1]), float(v[2])
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def so3_exp(omega_rad: FloatArray) -> FloatArray:
    """Rotation matrix of a rotation vector (Rodrigues' formula).

    >>> so3_exp(np.array([0.0, 0.0, np.pi / 2])).round(3) @ np.array([1.0, 0.0, 0.0])
    array([0., 1., 0.])
    """
    # A vector of three is sooner done in numbers than in arrays; this runs some forty times a frame.
    x, y, z = omega_rad.tolist()
    theta = math.sqrt(x * x + y * y + z * z)
    if theta < _SMALL_ANGLE_RAD:
        return np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])
    half = math.sin(theta / 2.0) / (theta / 2.0)
    a, b = math.sin(theta) / theta, 0.5 * half * half
    return np.array(
        [
            [1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)],
        ]
    )


def so3_log(R: FloatArray) -> FloatArray:
    """Rotation vector of a rotation matrix, of length at most pi.

    >>> so3_log(so3_exp(np.array([0.1, -0.2, 0.3]))).round(6)
    array([ 0.1, -0.2,  0.3])
    """
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    x, y, z = h - f, c - g, d - b
    sine = 0.5 * math.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (a + e + i - 1.0)
    theta = math.atan2(sine, cosine)
    if sine > 1e-6 or cosine > 0.0:
        scale = theta / (2.0 * sine) if sine > 1e-6 else 0.5
        return np.array([scale * x, scale * y, scale * z])
    # Half a turn: the axis is the dominant eigenvector of R + I, its sign is free.
    outer = 0.5 * (R + np.eye(3))
    column = outer[:, int(np.argmax(np.diag(outer)))]
    return np.asarray(theta * column / np.linalg.norm(column))


def _left_jacobian(omega_rad: FloatArray) -> FloatArray:
    theta2 = float(omega_rad @ omega_rad)
    W = skew(omega_rad)
    if theta2 < 1e-12:
        return np.asarray(np.eye(3) + 0.5 * W + W @ W / 6.0)
    theta = math.sqrt(theta2)
    a = (1.0 - math.cos(theta)) / theta2
    b = (theta - math.sin(theta)) / (theta2 * theta)
    return np.asarray(np.eye(3) + a * W + b * (W @ W))


_EYE = np.eye(3)


def _determinant(R: FloatArray) -> float:
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    return float(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))


@dataclass(frozen=True, slots=True, eq=False)
class SE3:
    """A rigid motion ``x -> R x + t``.

    Parameters
    ----------
    R : array (3, 3)
        Rotation matrix; orthonormal to 1e-4 with determinant +1, else `ValueError`.
    t : array (3,)
        Translation in metres.

    Examples
    --------
    >>> T_a_b = SE3.from_translation([1.0, 0.0, 0.0])
    >>> (T_a_b @ T_a_b.inverse()).is_close(SE3.identity())
    True
    >>> T_a_b.apply(np.zeros((1, 3)))
    array([[1., 0., 0.]])
    """

    R: FloatArray
    t: FloatArray

    def __post_init__(self) -> None:
        R = np.array(self.R, dtype=np.float64)
        t = np.array(self.t, dtype=np.float64)
        if R.shape != (3, 3) or t.shape != (3,):
            raise ValueError(f"SE3 needs R (3, 3) and t (3,), got {R.shape} and {t.shape}")
        if not (math.isfinite(float(R.sum())) and math.isfinite(float(t.sum()))):
            raise ValueError("SE3 holds NaN or infinity")
        off = (R @ R.T - _EYE).ravel()
        if not float(off @ off) < 1e-8 or _determinant(R) < 0.0:
            raise ValueError("R is not a rotation matrix")
        R.setflags(write=False)
        t.setflags(write=False)
        object.__setattr__(self, "R", R)
        object.__setattr__(self, "t", t)

    @classmethod
    def _made(cls, R: FloatArray, t: FloatArray) -> SE3:
        """From the R and t of valid motions: nothing to check, nothing to copy."""
        R.setflags(write=False)
        t.setflags(write=False)
        made = object.__new__(cls)
        object.__setattr__(made, "R", R)
        object.__setattr__(made, "t", t)
        return made

    @classmethod
    def identity(cls) -> SE3:
        """The motion that changes nothing."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_translation(cls, t: npt.ArrayLike) -> SE3:
        """A pure translation by t, shape (3,), metres."""
        return cls(np.eye(3), np.asarray(t, dtype=np.float64))

    @classmethod
    def from_matrix(cls, T: npt.ArrayLike) -> SE3:
        """From a 3x4 or 4x4 matrix; the rotation is made exactly orthonormal."""
        M = np.asarray(T, dtype=np.float64)
        if M.shape not in ((3, 4), (4, 4)):
            raise ValueError(f"a transform is 3x4 or 4x4, got {M.shape}")
        if not np.isfinite(M).all():
            raise ValueError("transform holds NaN or infinity")
        U, _, Vt = np.linalg.svd(M[:3, :3])
        R = U @ Vt
        if np.abs(R - M[:3, :3]).max() > 1e-2:
            raise ValueError("the 3x3 block is not a rotation matrix")
        return cls(R, M[:3, 3])

    @classmethod
    def from_quat_xyzw(cls, quat_xyzw: npt.ArrayLike, t: npt.ArrayLike) -> SE3:
        """From a quaternion (x, y, z, w), normalised here, and a translation in metres."""
        q = np.asarray(quat_xyzw, dtype=np.float64)
        norm = float(np.linalg.norm(q)) if q.shape == (4,) else 0.0
        if not math.isfinite(norm) or norm < 1e-6:
            raise ValueError(f"not a quaternion: {q!r}")
        x, y, z, w = q / norm
        R = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        return cls(R, np.asarray(t, dtype=np.float64))

    @classmethod
    def exp(cls, xi: npt.ArrayLike) -> SE3:
        """Exponential of a twist (translation, rotation), shape (6,)."""
        v = np.asarray(xi, dtype=np.float64)
        return cls(so3_exp(v[3:]), _left_jacobian(v[3:]) @ v[:3])

    def log(self) -> FloatArray:
        """Twist (translation, rotation), shape (6,), with ``SE3.exp(T.log()) == T``.

        >>> SE3.exp([1, 2, 3, 0.1, 0.2, 0.3]).log().round(6)
        array([1. , 2. , 3. , 0.1, 0.2, 0.3])
        """
        omega = so3_log(self.R)
        return np.concatenate([np.linalg.solve(_left_jacobian(omega), self.t), omega])

    def matrix(self) -> FloatArray:
        """The homogeneous 4x4 matrix."""
        T = np.eye(4)
        T[:3, :3] = self.R
        T[:3, 3] = self.t
        return T

    def quat_xyzw(self) -> FloatArray:
        """Unit quaternion (x, y, z, w) with w >= 0.

        >>> SE3.from_quat_xyzw([0, 0, 1, 1], [0, 0, 0]).quat_xyzw().round(4)
        array([0.    , 0.    , 0.7071, 0.7071])
        """
        omega = so3_log(self.R)
        half = 0.5 * math.sqrt(float(omega @ omega))
        sinc = math.sin(half) / half if half > _SMALL_ANGLE_RAD else 1.0
        return np.array([*(0.5 * sinc * omega), math.cos(half)])

    def inverse(self) -> SE3:
        """``T_b_a`` of ``T_a_b``."""
        return SE3._made(self.R.T, -self.R.T @ self.t)

    def __matmul__(self, other: SE3) -> SE3:
        return SE3._made(self.R @ other.R, self.R @ other.t + self.t)

    def apply(self, points: FloatArray) -> FloatArray:
        """Map points, shape (N, 3), from b to a."""
        return np.asarray(points @ self.R.T + self.t)

    def interpolate(self, other: SE3, fraction: float) -> SE3:
        """Pose at `fraction` of the way to `other`: straight line in t, geodesic in R.

        >>> SE3.identity().interpolate(SE3.from_translation([2.0, 0, 0]), 0.25).t
        array([0.5, 0. , 0. ])
        """
        omega = so3_log(self.R.T @ other.R)
        return SE3._made(self.R @ so3_exp(fraction * omega), self.t + fraction * (other.t - self.t))

    def adjoint(self) -> FloatArray:
        """The 6x6 adjoint (translation first): ``T exp(xi) T^-1 == exp(adjoint @ xi)``."""
        A = np.zeros((6, 6))
        A[:3, :3] = self.R
        A[3:, 3:] = self.R
        A[:3, 3:] = skew(self.t) @ self.R
        return A

    def is_close(self, other: SE3, tolerance: float = 1e-9) -> bool:
        """Whether both agree to `tolerance` (metres and entries of R)."""
        return bool(
            np.abs(self.R - other.R).max() <= tolerance and np.abs(self.t - other.t).max() <= tolerance
        )
