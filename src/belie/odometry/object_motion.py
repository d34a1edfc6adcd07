"""``T^L`` of section III-C: how an object moved relative to the camera between two frames.

``X_cur = T_cur_prev X_prev`` for a point X of the object in camera axes. Metric where the detections tell where the
object is; else up to scale: its matched corners move by a similarity, ``n_cur = s R n_prev + t`` in normalised
coordinates, which is the motion of a fronto-parallel plane from depth 1 to depth 1/s.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel, FloatArray

_AGREE_PX = 3.0
_LEAST_INLIERS = 3  # two pairs fix a similarity; the third agrees
_MOST_SCALE = 1.5  # from one frame to the next


def motion_over(T_cur_prev: SE3, time_ratio: float) -> SE3:
    """The same velocity over `time_ratio` times the interval: ``T_t ≈ T_t-1``, equation (4).

    >>> motion_over(SE3.from_translation([0.0, 0, 1]), 2.0).t.tolist()
    [0.0, 0.0, 2.0]
    """
    return T_cur_prev if time_ratio == 1.0 else SE3.exp(time_ratio * T_cur_prev.log())


def similarity_motion(
    camera: CameraModel, px_prev: npt.NDArray[np.floating], px_cur: npt.NDArray[np.floating]
) -> tuple[SE3, float, npt.NDArray[np.bool_]] | None:
    """Motion of a fronto-parallel plane at depth 1 that explains most of the matched corners.

    Parameters
    ----------
    camera : CameraModel
    px_prev, px_cur : array (N, 2)
        The same corners in the two images.

    Returns
    -------
    T_cur_prev : SE3
        In units of the depth at the previous frame.
    depth : float
        Of the plane now, in the same units.
    agrees : array (N,), bool
        Corners that move with it to 3 px.

    Examples
    --------
    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> corners = np.random.default_rng(0).uniform(250, 350, (20, 2))
    >>> grown = (corners - [319.5, 239.5]) * 1.25 + [324.5, 239.5]
    >>> T, depth, agrees = similarity_motion(camera, corners, grown)
    >>> T.t.round(3)[[0, 2]].tolist(), round(depth, 3), int(agrees.sum())
    ([0.008, -0.2], 0.8, 20)
    """
    if len(px_prev) < _LEAST_INLIERS:
        return None
    f = camera.fx
    before = (f * camera.normalize(np.asarray(px_prev, dtype=np.float64))[:, :2]).astype(np.float32)
    now = (f * camera.normalize(np.asarray(px_cur, dtype=np.float64))[:, :2]).astype(np.float32)
    found, mask = cv2.estimateAffinePartial2D(before, now, ransacReprojThreshold=_AGREE_PX)
    if found is None:
        return None
    agrees = np.asarray(mask).ravel().astype(bool)
    scale = float(np.hypot(found[0, 0], found[1, 0]))
    if agrees.sum() < _LEAST_INLIERS or not 1.0 / _MOST_SCALE < scale < _MOST_SCALE:
        return None
    angle = float(np.arctan2(found[1, 0], found[0, 0]))
    depth = 1.0 / scale
    tx, ty = found[:, 2] / f * depth
    T_cur_prev = SE3(SE3.exp([0.0, 0.0, 0.0, 0.0, 0.0, angle]).R, np.array([tx, ty, depth - 1.0]))
    return T_cur_prev, depth, agrees


def moved_box_px(camera: CameraModel, box_px: FloatArray, depth: float, T_next_cur: SE3) -> FloatArray | None:
    """Where ``T^L`` takes a box whose content lies at `depth`; None for behind the camera.

    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> moved_box_px(camera, np.array([300.0, 220, 340, 260]), 2.0, SE3.from_translation([0.0, 0, -1]))
    array([280., 200., 360., 280.])
    """
    middle_px = 0.5 * (box_px[:2] + box_px[2:]) - 0.5
    middle = depth * np.append(camera.normalize(middle_px[None])[0, :2], 1.0)
    after = T_next_cur.apply(middle[None])
    if after[0, 2] <= 1e-3 * depth:
        return None
    half = 0.5 * (box_px[2:] - box_px[:2]) * depth / after[0, 2]
    centre = camera.project(after)[0] + 0.5
    return np.concatenate([centre - half, centre + half])
