"""Equation (5) for hot loops: projection through any `CameraModel`, with its Jacobian, compiled.

`CameraModel.project` goes through OpenCV and has no Jacobian in the point; here every model is one
compiled function of the normalised coordinates ``(x, y) = (X/Z, Y/Z)``, so that prediction and
optimisation work on the pixels of the image as it is, without undistorting it.
Formulas: OpenCV, "Camera Calibration and 3D Reconstruction"; fisheye: Kannala and Brandt (2006).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from belie.geometry.camera import CameraModel
from belie.geometry.compiled import compiled
from belie.geometry.se3 import FloatArray

# The flat camera: 0 kind, 1-4 fx fy cx cy, 5 largest radius², 6-11 k1..k6, 12-13 p1 p2, 14-17 s1..s4,
# 18-26 the homography of a tilted sensor, row by row.
_PINHOLE, _POLYNOMIAL, _TILTED, _EQUIDISTANT = 0.0, 1.0, 2.0, 3.0
_MARGIN = 1.1


def _tilt(tau_x: float, tau_y: float) -> FloatArray:
    cx, sx, cy, sy = math.cos(tau_x), math.sin(tau_x), math.cos(tau_y), math.sin(tau_y)
    R_x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    R_y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    R = R_y @ R_x
    return np.asarray(np.array([[R[2, 2], 0, -R[0, 2]], [0, R[2, 2], -R[1, 2]], [0, 0, 1]]) @ R)


def _largest_radius2(camera: CameraModel) -> float:
    u = np.linspace(0.0, camera.width - 1.0, 17)
    v = np.linspace(0.0, camera.height - 1.0, 17)
    border = [np.column_stack([u, np.full(17, e)]) for e in (v[0], v[-1])]
    border += [np.column_stack([np.full(17, e), v]) for e in (u[0], u[-1])]
    with np.errstate(all="ignore"):
        radius2 = (camera.normalize(np.concatenate(border)) ** 2).sum(axis=1)
    radius2 = radius2[np.isfinite(radius2)]
    return float(radius2.max() * _MARGIN**2) if len(radius2) else math.inf


@lru_cache(maxsize=64)
def flat_camera(camera: CameraModel) -> FloatArray:
    """The camera as one array that compiled code can take; shape (27,), read-only.

    >>> flat_camera(CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5))[1:5].tolist()
    [500.0, 500.0, 319.5, 239.5]
    """
    flat = np.zeros(27)
    flat[1:5] = camera.fx, camera.fy, camera.cx, camera.cy
    flat[5] = _largest_radius2(camera)
    flat[18:27] = np.eye(3).ravel()
    d = camera.distortion
    if camera.model == "equidistant":
        flat[0] = _EQUIDISTANT
        flat[6:10] = d
    elif camera.is_distorted:
        flat[0] = _POLYNOMIAL
        flat[6:8], flat[12:14] = d[:2], d[2:4]
        flat[8 : 8 + len(d[4:8])] = d[4:8]
        flat[14:18] = d[8:12] if len(d) >= 12 else 0.0
        if len(d) == 14 and any(d[12:14]):
            flat[0] = _TILTED
            flat[18:27] = _tilt(d[12], d[13]).ravel()
    flat.setflags(write=False)
    return flat


@compiled()
def project_normalized(
    flat: FloatArray, x: float, y: float
) -> tuple[float, float, float, float, float, float]:
    """Pixel of the normalised point (x, y), and its Jacobian ``(u, v, du/dx, du/dy, dv/dx, dv/dy)``.

    Parameters
    ----------
    flat : array (27,)
        From `flat_camera`.
    x, y : float
        X/Z and Y/Z in camera coordinates.

    Returns
    -------
    tuple of six floats
        All NaN beyond the field of view (by more than a tenth), where a polynomial folds back.

    Examples
    --------
    >>> camera = CameraModel(width=640, height=480, fx=500, fy=400, cx=319.5, cy=239.5)
    >>> project_normalized(flat_camera(camera), 0.1, 0.0)
    (369.5, 239.5, 500.0, 0.0, 0.0, 400.0)
    """
    fx, fy, cx, cy = flat[1], flat[2], flat[3], flat[4]
    r2 = x * x + y * y
    if r2 > flat[5]:
        return np.nan, np.nan, np.nan, np.nan, np.nan, np.nan
    if flat[0] == _PINHOLE:
        return fx * x + cx, fy * y + cy, fx, 0.0, 0.0, fy
    if flat[0] == _EQUIDISTANT:
        return _equidistant(flat, x, y, r2)
    k1, k2, k3, k4, k5, k6 = flat[6], flat[7], flat[8], flat[9], flat[10], flat[11]
    p1, p2, s1, s2, s3, s4 = flat[12], flat[13], flat[14], flat[15], flat[16], flat[17]
    above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
    radial = above / below
    # Derivatives by r²; x and y enter r² as 2x and 2y.
    slope = (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3) - radial * (k4 + r2 * (2.0 * k5 + 3.0 * r2 * k6))) / below
    thin_x, thin_y = s1 + 2.0 * s2 * r2, s3 + 2.0 * s4 * r2
    xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (s1 + s2 * r2)
    yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (s3 + s4 * r2)
    cross = 2.0 * x * y * slope
    xx = radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x + 2.0 * x * thin_x
    xy = cross + 2.0 * p1 * x + 2.0 * p2 * y + 2.0 * y * thin_x
    yx = cross + 2.0 * p1 * x + 2.0 * p2 * y + 2.0 * x * thin_y
    yy = radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x + 2.0 * y * thin_y
    if flat[0] == _TILTED:
        xd, yd, xx, xy, yx, yy = _through_homography(flat, xd, yd, xx, xy, yx, yy)
    return fx * xd + cx, fy * yd + cy, fx * xx, fx * xy, fy * yx, fy * yy


@compiled()
def _equidistant(
    flat: FloatArray, x: float, y: float, r2: float
) -> tuple[float, float, float, float, float, float]:
    fx, fy, cx, cy = flat[1], flat[2], flat[3], flat[4]
    r = np.sqrt(r2)
    if r < 1e-8:
        return fx * x + cx, fy * y + cy, fx, 0.0, 0.0, fy
    theta = np.arctan(r)
    t2 = theta * theta
    k1, k2, k3, k4 = flat[6], flat[7], flat[8], flat[9]
    theta_d = theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    by_theta = 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)))
    scale = theta_d / r
    slope = (by_theta / (1.0 + r2) - scale) / r2  # d(scale)/dr / r
    cross = x * y * slope
    return (
        fx * x * scale + cx,
        fy * y * scale + cy,
        fx * (scale + x * x * slope),
        fx * cross,
        fy * cross,
        fy * (scale + y * y * slope),
    )


@compiled()
def _through_homography(
    flat: FloatArray, xd: float, yd: float, xx: float, xy: float, yx: float, yy: float
) -> tuple[float, float, float, float, float, float]:
    H = flat[18:27]
    w = H[6] * xd + H[7] * yd + H[8]
    u = (H[0] * xd + H[1] * yd + H[2]) / w
    v = (H[3] * xd + H[4] * yd + H[5]) / w
    ux, uy = (H[0] - u * H[6]) / w, (H[1] - u * H[7]) / w
    vx, vy = (H[3] - v * H[6]) / w, (H[4] - v * H[7]) / w
    return u, v, ux * xx + uy * yx, ux * xy + uy * yy, vx * xx + vy * yx, vx * xy + vy * yy
