"""Local consistency, section III-C of the paper: ``k^L``, ``M^L`` and ``e^L`` of one object at a time.

- ``k^L = {k in k_t : k inside the box}``, equation (7);
- ``M^L = Γ(k^L_t-1, k^L_t)`` from two consecutive frames, in the camera axes of the later one;
- ``M^L_t+1 = T^L M^L_t``, projected (5), matched to the nearest corner in the predicted box (6), ``e^L`` after LM.

What the paper leaves open is read in docs/decisions/0011-objects-of-the-paper.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel, FloatArray
from belie.geometry.triangulation import triangulate_rays
from belie.odometry.correspondence import Patches, correspond, describe
from belie.odometry.matching import match_nearest
from belie.odometry.object_motion import similarity_motion
from belie.odometry.optimization import optimize_pose
from belie.odometry.paper_odometry import PaperOdometrySettings
from belie.odometry.prediction import predict
from belie.types import Features, GrayImage, MapPoints

_SEARCH = 0.25  # of the box: how far a corner may stray from its place in the box


def corners_inside(features: Features, box_px: FloatArray) -> npt.NDArray[np.int64]:
    """Which corners lie in a box: ``k^L`` of equation (7).

    >>> features = Features(px=[[5, 5], [20, 5]], level=[0, 0], score=[1, 1])
    >>> corners_inside(features, np.array([0.0, 0.0, 10.0, 10.0])).tolist()
    [0]
    """
    px = features.px + np.float32(0.5)
    return np.flatnonzero(((px >= box_px[:2]) & (px < box_px[2:])).all(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocalMapPoints:
    """``M^L`` of one object in camera axes, the ``T^L`` that brought it there, and its depth now (m, or in the
    depth that it had when its motion was first seen, where nothing tells its scale).
    """  # noqa: D205

    points: MapPoints
    T_cur_prev: SE3
    depth: float

    def moved(self, T_next_cur: SE3) -> LocalMapPoints:
        """``M^L_t+1 = T^L M^L_t``, equation (4); the depth is that of their middle.

        >>> points = MapPoints(position_m=[[0.0, 0, 2]], level=[0], distance_m=[2.0])
        >>> local = LocalMapPoints(points=points, T_cur_prev=SE3.identity(), depth=2.0)
        >>> local.moved(SE3.from_translation([0.0, 0, 1])).depth
        3.0
        """
        moved = T_next_cur.apply(self.points.position_m)
        depth = self.depth * float(moved[:, 2].mean() / self.points.position_m[:, 2].mean())
        points = MapPoints(
            position_m=moved,
            level=self.points.level,
            distance_m=self.points.distance_m,  # at which the corner had its level
        )
        return LocalMapPoints(points=points, T_cur_prev=T_next_cur, depth=depth)


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalError:
    """``e^L`` over one predicted box; None with the reason."""

    error_px2: float | None = None
    pairs: int = 0
    reason: str = ""


class LocalConsistency:
    """Corners of two consecutive frames, and what they say of an object.

    Examples
    --------
    >>> camera = CameraModel(width=320, height=240, fx=200, fy=200, cx=159.5, cy=119.5)
    >>> local = LocalConsistency(camera, PaperOdometrySettings())
    >>> image = np.kron(np.random.default_rng(0).integers(0, 255, (24, 32)), np.ones((10, 10))).astype(np.uint8)
    >>> from belie.odometry.features import FeatureSettings, extract_features, image_pyramid
    >>> for shift in (0, 2):
    ...     pyramid = image_pyramid(np.roll(image, shift, axis=1), FeatureSettings())
    ...     local.observe(pyramid, extract_features(pyramid, FeatureSettings()))
    >>> before, now = np.array([100.0, 60, 200, 160]), np.array([102.0, 60, 202, 160])
    >>> found = local.map_points(before, now)
    >>> float(found.T_cur_prev.t[0].round(2)), local.error(found, found.T_cur_prev, now + 2).error_px2 < 20
    (0.01, True)
    """

    def __init__(self, camera: CameraModel, settings: PaperOdometrySettings) -> None:
        self._camera, self._settings = camera, settings
        self._scale_factor = settings.features.scale_factor
        self._previous: tuple[Features, Patches] | None = None
        self._current: tuple[Features, Patches] | None = None

    def observe(self, pyramid: Sequence[GrayImage], features: Features) -> None:
        """Take the corners of the next frame, which the global check extracted."""
        self._previous = self._current
        self._current = features, describe(pyramid, features, self._scale_factor)

    def map_points(
        self,
        box_prev_px: FloatArray,
        box_cur_px: FloatArray,
        *,
        told: tuple[SE3, float] | None = None,
        kept: tuple[SE3, float] | None = None,
        held: bool = False,
    ) -> LocalMapPoints | None:
        """``M^L`` from the last two frames.

        Parameters
        ----------
        box_prev_px, box_cur_px : array (4,)
            Where the object was in the previous frame and is in the current one.
        told : tuple of SE3 and float or None
            Its motion between the two frames and its depth now, as the detections give them, m.
        kept : tuple of SE3 and float or None
            The same at constant velocity, where the corners show no motion.
        held : bool
            The object is missing: its velocity is kept, whatever the corners show.

        Returns
        -------
        LocalMapPoints or None
            None where there is no motion to be had, or no corner.
        """
        if self._previous is None or self._current is None:
            return None
        features, prev_px, cur = self._same_corners(box_prev_px, box_cur_px)
        cur_px = features.px[cur]
        agrees = np.ones(len(cur), dtype=np.bool_)
        if told is not None:
            T_cur_prev, depth = told
        elif not held and (seen := similarity_motion(self._camera, prev_px, cur_px)) is not None:
            T_cur_prev, depth, agrees = seen
        elif kept is not None:
            T_cur_prev, depth = kept
        else:
            return None
        if not agrees.any():
            return None
        rays = np.column_stack([self._camera.normalize(cur_px[agrees])[:, :2], np.ones(int(agrees.sum()))])
        points = depth * rays
        level = features.level[cur[agrees]]
        if told is not None:
            points = self._triangulated(points, prev_px[agrees], level, T_cur_prev)
        distance = np.linalg.norm(points, axis=1)
        placed = MapPoints(position_m=points, level=level, distance_m=distance)
        return LocalMapPoints(points=placed, T_cur_prev=T_cur_prev, depth=depth)

    def error(self, local: LocalMapPoints, T_next_cur: SE3, box_px: FloatArray) -> LocalError:
        """``e^L``: ``M^L`` moved by ``T^L`` (4), projected (5), matched in the predicted box, after LM (6).

        Parameters
        ----------
        local : LocalMapPoints
            Made at the frame before the one that was last observed.
        T_next_cur : SE3
            ``T^L`` from that frame to this one.
        box_px : array (4,)
            The box as ``T^L`` predicts it.
        """
        assert self._current is not None
        features = self._current[0]
        k = corners_inside(features, box_px)
        corners = Features(px=features.px[k], level=features.level[k], score=features.score[k])
        T_cur_next = T_next_cur.inverse()  # the object stands still and the camera moves: the same pixels
        prediction = predict(self._camera, T_cur_next, local.points, self._scale_factor)
        pairs = match_nearest(prediction, corners, self._settings.matching, self._scale_factor)
        need = self._settings.min_local_pairs
        if len(pairs) < need:
            reason = f"{len(pairs)} of {len(local.points)} points found among {len(k)} corners, {need} needed"
            return LocalError(pairs=len(pairs), reason=reason)
        optimum = optimize_pose(
            self._camera,
            T_cur_next,
            local.points.position_m[prediction.index[pairs.predicted]],
            corners.px[pairs.observed],
            self._scale_factor ** corners.level[pairs.observed].astype(np.float64),
            self._settings.optimization,
        )
        return LocalError(error_px2=optimum.error_px2, pairs=len(pairs))

    def _same_corners(
        self, box_prev_px: FloatArray, box_cur_px: FloatArray
    ) -> tuple[Features, npt.NDArray[np.float32], npt.NDArray[np.int64]]:
        """Current features; previous positions of the corners that both boxes hold; their current indices."""
        assert self._previous is not None
        assert self._current is not None
        (before, patches_before), (now, patches_now) = self._previous, self._current
        a, b = corners_inside(before, box_prev_px), corners_inside(now, box_cur_px)
        sides = box_cur_px[2:] - box_cur_px[:2]
        growth = sides / np.maximum(box_prev_px[2:] - box_prev_px[:2], 1.0)
        expected = (before.px[a] + 0.5 - box_prev_px[:2]) * growth + box_cur_px[:2] - 0.5
        partner = correspond(
            expected.astype(np.float32),
            before.level[a],
            patches_before[a],
            Features(px=now.px[b], level=now.level[b], score=now.score[b]),
            patches_now[b],
            max(self._settings.matching.window_px, _SEARCH * float(sides.max())),
            self._settings.local_map.correspondence,
        )
        found = np.flatnonzero(partner >= 0)
        return now, before.px[a[found]], b[partner[found]]

    def _triangulated(
        self, on_plane: FloatArray, prev_px: npt.NDArray[np.float32], level: npt.NDArray[np.int8],
        T_cur_prev: SE3,
    ) -> FloatArray:  # fmt: skip
        """Γ of equation (3) for two frames; a point without parallax stays at the depth that the detection tells."""
        n = len(on_plane)
        rays = np.empty((2 * n, 3))
        rays[0::2] = np.column_stack([self._camera.normalize(prev_px)[:, :2], np.ones(n)]) @ T_cur_prev.R.T
        rays[1::2] = on_plane
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        centres = np.zeros((2 * n, 3))
        centres[0::2] = T_cur_prev.t
        settings = self._settings.local_map
        gate = np.repeat(settings.gate_px / self._camera.fx * self._scale_factor ** level.astype(float), 2)
        starts = 2 * np.arange(n + 1)
        points, accepted = triangulate_rays(centres, rays, starts, settings.min_parallax_rad, gate)
        return np.where(accepted[:, None], points, on_plane)
