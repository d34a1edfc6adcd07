"""SE(3), cameras, epipolar geometry, triangulation, robust kernels. Depends on nothing else in belie."""

from belie.geometry.camera import CameraModel, DistortionModel
from belie.geometry.se3 import SE3, FloatArray, skew, so3_exp, so3_log

__all__ = ["SE3", "CameraModel", "DistortionModel", "FloatArray", "skew", "so3_exp", "so3_log"]
