"""Cameras: projection of equation (5), with the distortion models that robots use.

Pixel centres are integers (OpenCV). ``pinhole`` has no distortion; ``radial_tangential`` is ROS's
``plumb_bob`` (k1 k2 p1 p2 [k3]); ``rational`` is ``rational_polynomial`` (k1 k2 p1 p2 k3 k4 k5 k6);
``equidistant`` is the fisheye of Kannala and Brandt (2006), k1 k2 k3 k4.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from belie.geometry.se3 import FloatArray

DistortionModel = Literal["pinhole", "radial_tangential", "rational", "equidistant"]
_COEFFICIENTS: dict[str, tuple[int, ...]] = {
    "pinhole": (0,),
    "radial_tangential": (4, 5),
    "rational": (8, 12, 14),
    "equidistant": (4,),
}
_STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 1e-9)


def _undistort(px: FloatArray, K: FloatArray, distortion: FloatArray) -> FloatArray:
    # OpenCV 5 folded undistortPointsIter into undistortPoints; the default of 5 iterations is too few.
    if hasattr(cv2, "undistortPointsIter"):
        return np.asarray(cv2.undistortPointsIter(px, K, distortion, None, None, _STOP))
    return np.asarray(cv2.undistortPoints(px, K, distortion, criteria=_STOP))


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraModel:
    """Intrinsics of one camera.

    Parameters
    ----------
    width, height : int
        Image size in pixels.
    fx, fy, cx, cy : float
        Focal lengths and principal point in pixels.
    model : DistortionModel
        Which distortion; see the module's text.
    distortion : tuple of float
        Coefficients in OpenCV's order. A wrong count raises `ValueError`.

    Examples
    --------
    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> camera.project(np.array([[0.1, 0.0, 1.0]]))
    array([[369.5, 239.5]])
    >>> camera.normalize(np.array([[369.5, 239.5]])).round(6)
    array([[0.1, 0. ]])
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    model: DistortionModel = "pinhole"
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.model not in _COEFFICIENTS:
            raise ValueError(f"unknown distortion model {self.model!r}; known: {sorted(_COEFFICIENTS)}")
        if len(self.distortion) not in _COEFFICIENTS[self.model]:
            expected = " or ".join(map(str, _COEFFICIENTS[self.model]))
            raise ValueError(f"{self.model} takes {expected} coefficients, got {len(self.distortion)}")
        numbers = np.array([self.fx, self.fy, self.cx, self.cy, *self.distortion], dtype=np.float64)
        if not np.isfinite(numbers).all() or self.fx <= 0 or self.fy <= 0:
            raise ValueError(f"intrinsics must be finite with positive focal lengths, got {numbers.tolist()}")
        if self.width < 1 or self.height < 1:
            raise ValueError(f"image size must be positive, got {self.width}x{self.height}")

    @property
    def K(self) -> FloatArray:
        """The intrinsic matrix I_C of equation (5), shape (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def is_distorted(self) -> bool:
        """Whether any distortion coefficient is not zero."""
        return any(self.distortion) or self.model == "equidistant"

    def scaled(self, factor: float) -> CameraModel:
        """The camera of the image resized by `factor` (0.5 halves it).

        >>> CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5).scaled(0.5).cx
        159.5
        """
        return replace(
            self,
            width=max(1, round(self.width * factor)),
            height=max(1, round(self.height * factor)),
            fx=self.fx * factor,
            fy=self.fy * factor,
            cx=(self.cx + 0.5) * factor - 0.5,
            cy=(self.cy + 0.5) * factor - 0.5,
        )

    def normalize(self, points_px: npt.NDArray[np.floating]) -> FloatArray:
        """Pixels, shape (N, 2), to undistorted coordinates (X/Z, Y/Z), shape (N, 2)."""
        px = np.asarray(points_px, dtype=np.float64).reshape(-1, 2)
        if not self.is_distorted or len(px) == 0:
            return (px - (self.cx, self.cy)) / (self.fx, self.fy)
        if self.model == "equidistant":
            out = cv2.fisheye.undistortPoints(px[:, None], self.K, np.array(self.distortion))
        else:
            out = _undistort(px[:, None], self.K, np.array(self.distortion))
        return np.asarray(out, dtype=np.float64).reshape(-1, 2)

    def project(self, points: FloatArray) -> FloatArray:
        """Points in the camera frame, shape (N, 3), Z > 0, to pixels, shape (N, 2) (equation 5)."""
        normalized = points[:, :2] / points[:, 2:3]
        if not self.is_distorted or len(points) == 0:
            return np.asarray(normalized * (self.fx, self.fy) + (self.cx, self.cy))
        if self.model == "equidistant":
            out = cv2.fisheye.distortPoints(normalized[:, None], self.K, np.array(self.distortion))
        else:
            rays = np.column_stack([normalized, np.ones(len(normalized))])
            out, _ = cv2.projectPoints(
                rays[:, None], np.zeros(3), np.zeros(3), self.K, np.array(self.distortion)
            )
        return np.asarray(out, dtype=np.float64).reshape(-1, 2)
