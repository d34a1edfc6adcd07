"""Equations (4) and (5): where the map points should appear in the next image.

The motion ``T_t`` is taken equal to the last one, ``T_t-1`` (constant velocity, as the odometry claims it),
the points move by it, ``M_t+1 = T_t M_t``, and are projected, ``ẑ = I_C (X/Z, Y/Z, 1)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel, FloatArray, flat_camera
from belie.geometry.compiled import compiled
from belie.geometry.projection import project_normalized
from belie.types import MapPoints

_NEAREST_M = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prediction:
    """Map points that should be in view.

    Parameters
    ----------
    T_odom_cam : SE3
        Predicted pose of the camera.
    index : array (N,), int64
        Which map points are in view.
    px : array (N, 2)
        ẑ, where they should appear, full-resolution pixels.
    level : array (N,)
        The pyramid level at which they should appear; a fraction, since distances change smoothly.
    """

    T_odom_cam: SE3
    index: npt.NDArray[np.int64]
    px: FloatArray
    level: FloatArray

    def __len__(self) -> int:
        return len(self.index)


def constant_velocity(T_odom_before: SE3, T_odom_last: SE3, time_ratio: float) -> SE3:
    """Pose after `time_ratio` times the last interval, the velocity kept: ``T_t ≈ T_t-1``, equation (4).

    Parameters
    ----------
    T_odom_before, T_odom_last : SE3
        Claimed camera poses of the last two frames.
    time_ratio : float
        The coming interval over the last one: 1 at a steady rate, 2 after a dropped frame.

    Examples
    --------
    >>> constant_velocity(SE3.identity(), SE3.from_translation([0.0, 0, 1]), 2.0).t.tolist()
    [0.0, 0.0, 3.0]
    """
    motion = T_odom_before.inverse() @ T_odom_last
    return T_odom_last @ (motion if time_ratio == 1.0 else SE3.exp(time_ratio * motion.log()))


@compiled()
def _project_points(
    flat: FloatArray,
    T_cam_odom: FloatArray,
    points: FloatArray,
    width: int,
    height: int,
) -> tuple[npt.NDArray[np.int64], FloatArray, FloatArray]:
    """Indices, pixels and distances of the points in view."""
    index = np.empty(len(points), dtype=np.int64)
    px, distance = np.empty((len(points), 2)), np.empty(len(points))
    count = 0
    T = T_cam_odom
    for i in range(len(points)):
        p0, p1, p2 = points[i, 0], points[i, 1], points[i, 2]
        Z = T[2, 0] * p0 + T[2, 1] * p1 + T[2, 2] * p2 + T[2, 3]
        if Z < _NEAREST_M:
            continue
        X = T[0, 0] * p0 + T[0, 1] * p1 + T[0, 2] * p2 + T[0, 3]
        Y = T[1, 0] * p0 + T[1, 1] * p1 + T[1, 2] * p2 + T[1, 3]
        u, v, _, _, _, _ = project_normalized(flat, X / Z, Y / Z)
        if not (0.0 <= u <= width - 1.0 and 0.0 <= v <= height - 1.0):
            continue
        index[count] = i
        px[count, 0], px[count, 1] = u, v
        distance[count] = np.sqrt(X * X + Y * Y + Z * Z)
        count += 1
    return index[:count].copy(), px[:count].copy(), distance[:count].copy()


def predict(camera: CameraModel, T_odom_cam: SE3, points: MapPoints, scale_factor: float) -> Prediction:
    """Move the map into the predicted camera and project it: equations (4) and (5).

    Parameters
    ----------
    camera : CameraModel
        With its distortion: the pixels are those of the image as it is.
    T_odom_cam : SE3
        Predicted pose, from `constant_velocity`.
    points : MapPoints
    scale_factor : float
        Of the pyramid: a point half as far away appears ``log(2) / log(scale_factor)`` levels coarser.

    Returns
    -------
    Prediction
        Without the points that are behind the camera or out of the image.

    Examples
    --------
    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> points = MapPoints(position_m=[[0.0, 0, 10], [0, 0, -1]], level=[0, 0], distance_m=[20.0, 1.0])
    >>> predicted = predict(camera, SE3.identity(), points, 2.0)
    >>> predicted.index.tolist(), predicted.px.tolist(), predicted.level.tolist()
    ([0], [[319.5, 239.5]], [1.0])
    """
    index, px, distance_m = _project_points(
        flat_camera(camera),
        np.ascontiguousarray(T_odom_cam.inverse().matrix()),
        points.position_m,
        camera.width,
        camera.height,
    )
    coarser = np.log(points.distance_m[index] / distance_m) / np.log(scale_factor)
    return Prediction(T_odom_cam=T_odom_cam, index=index, px=px, level=points.level[index] + coarser)
