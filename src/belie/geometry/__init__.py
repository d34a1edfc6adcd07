"""SE(3), cameras, epipolar geometry, triangulation, robust kernels. Depends on nothing else in belie."""

from belie.geometry.boxes import Solid, box_iou, clipped_box_px, projected_box_px
from belie.geometry.camera import CameraModel, DistortionModel
from belie.geometry.compiled import compiled
from belie.geometry.projection import flat_camera, project_normalized
from belie.geometry.robust import huber_cost, huber_weight
from belie.geometry.se3 import SE3, FloatArray, skew, so3_exp, so3_log
from belie.geometry.triangulation import triangulate_rays

__all__ = [
    "SE3",
    "CameraModel",
    "DistortionModel",
    "FloatArray",
    "Solid",
    "box_iou",
    "clipped_box_px",
    "compiled",
    "flat_camera",
    "huber_cost",
    "huber_weight",
    "project_normalized",
    "projected_box_px",
    "skew",
    "so3_exp",
    "so3_log",
    "triangulate_rays",
]
