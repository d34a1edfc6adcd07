"""Where the corners of an image would have to be if the claim was true: equation (5) at the claimed pose.

The corners are followed back to an earlier frame, triangulated with the motion that the images show, and
projected where the claimed motion since that frame would put them. What the claim adds to the motion is then
to be seen, corner by corner: nothing is compared after an optimiser has had its say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from belie.geometry import SE3, CameraModel, FloatArray, triangulate_rays
from belie.types import Frame

_LEAST_PARALLAX_RAD = 0.003
_REPROJECTION_PX = 3.0
_FAR_M = 1e4  # a corner without parallax: only the turn of the camera moves it
_WINDOW_PX = (15, 15)
_LEVELS = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """A frame, its number, and where the camera was claimed and seen to be (None: not known)."""

    number: int
    frame: Frame
    T_odom_cam_claimed: SE3 | None
    T_odom_cam_seen: SE3 | None

    @property
    def has_poses(self) -> bool:
        """Whether both poses are known."""
        return self.T_odom_cam_claimed is not None and self.T_odom_cam_seen is not None


def corners_under_claim(
    views: Sequence[View], camera: CameraModel, observed_px: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Corners of the last view, and where the motion claimed since the first view would have put them.

    Parameters
    ----------
    views : sequence of View
        Consecutive frames, the last one being the one to be drawn.
    camera : CameraModel
        Of all views.
    observed_px : array (N, 2)
        Corners of the last view, pixels.

    Returns
    -------
    (observed, expected) or None
        Both (M, 2), M <= N; None where poses or corners are missing.

    Examples
    --------
    >>> camera = CameraModel(width=64, height=48, fx=60, fy=60, cx=31.5, cy=23.5)
    >>> frame = Frame(camera="/image", stamp_ns=0, received_ns=0, image=np.zeros((48, 64), np.uint8))
    >>> view = View(number=0, frame=frame, T_odom_cam_claimed=None, T_odom_cam_seen=None)
    >>> corners_under_claim([view, view], camera, np.empty((0, 2))) is None
    True
    """
    if len(views) < 2 or len(observed_px) == 0 or not (views[0].has_poses and views[-1].has_poses):
        return None
    earlier_px, found = _follow_back([view.frame for view in views], observed_px)
    observed, earlier = observed_px[found], earlier_px[found]
    if len(observed) == 0:
        return None
    points_now = _triangulate(camera, earlier, observed, _since(views, "T_odom_cam_seen"))
    T_seen, T_claimed = _since(views, "T_odom_cam_seen"), _since(views, "T_odom_cam_claimed")
    expected_points = (T_claimed.inverse() @ T_seen).apply(points_now)
    ahead = expected_points[:, 2] > 0.1
    return observed[ahead], camera.project(expected_points[ahead])


def _since(views: Sequence[View], name: str) -> SE3:
    """``T_first_last`` by one kind of pose."""
    first, last = getattr(views[0], name), getattr(views[-1], name)
    motion: SE3 = first.inverse() @ last
    return motion


def _follow_back(frames: Sequence[Frame], observed_px: FloatArray) -> tuple[FloatArray, np.ndarray]:
    px = np.asarray(observed_px, dtype=np.float32).reshape(-1, 1, 2)
    found = np.ones(len(px), dtype=bool)
    for later, earlier in zip(reversed(frames[1:]), reversed(frames[:-1]), strict=True):
        px, status, _ = cv2.calcOpticalFlowPyrLK(
            later.image, earlier.image, px, None, winSize=_WINDOW_PX, maxLevel=_LEVELS
        )
        found &= np.asarray(status).reshape(-1) == 1
    return np.asarray(px, dtype=np.float64).reshape(-1, 2), found


def _triangulate(camera: CameraModel, earlier: FloatArray, now: FloatArray, T_first_last: SE3) -> FloatArray:
    """Points in the last camera's coordinates, metres; far away where there is no parallax."""
    T_last_first = T_first_last.inverse()
    rays_now, rays_earlier = _rays(camera, now), _rays(camera, earlier) @ T_last_first.R.T
    centres = np.tile(np.stack([T_last_first.t, np.zeros(3)]), (len(now), 1))
    rays = np.stack([rays_earlier, rays_now], axis=1).reshape(-1, 3)
    gate = np.full(len(rays), _REPROJECTION_PX / camera.fx)
    starts = np.arange(0, 2 * len(now) + 1, 2, dtype=np.int64)
    points, accepted = triangulate_rays(
        centres, np.ascontiguousarray(rays), starts, _LEAST_PARALLAX_RAD, gate
    )
    return np.where(accepted[:, None], points, _FAR_M * rays_now)


def _rays(camera: CameraModel, px: FloatArray) -> FloatArray:
    rays = np.column_stack([camera.normalize(px), np.ones(len(px))])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))
