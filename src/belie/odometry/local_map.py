"""Equation (3), ``M_t = Γ(x_0..t-1, k_0..t-1, k_t)``: map points from a short window of keyframes.

Corners of the last keyframe are followed through the frames (`correspondence`); where a frame becomes a
keyframe, every scene point that two or more keyframes of the window saw is triangulated with the poses
that came with them. In the `paper` profile these are the *claimed* poses: a lie bends the map, and the
bent map does not fit the next image.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pydantic import Field

from belie.geometry import SE3, CameraModel, FloatArray, triangulate_rays
from belie.odometry.correspondence import CorrespondenceSettings, Patches, correspond, describe
from belie.odometry.keyframes import KeyframeSettings, keyframe_reason
from belie.types import Features, GrayImage, Keyframe, MapPoints, Settings


class LocalMapSettings(Settings):
    """Map of equation (3).

    >>> LocalMapSettings().keyframes.window
    5
    """

    keyframes: KeyframeSettings = KeyframeSettings()
    correspondence: CorrespondenceSettings = CorrespondenceSettings()
    min_parallax_rad: float = Field(
        0.005, gt=0.0, description="Least angle between two rays of a map point [rad]; 0.3 deg."
    )
    gate_px: float = Field(
        15.0,
        gt=0.0,
        description="Most distance between a map point and the corners it was made from [px of their"
        " level]. As wide as the window of the matching: a tight gate would drop the very points that"
        " contradict the claimed poses.",
    )


def triangulate_window(
    keyframes: Sequence[Keyframe],
    rays: Sequence[FloatArray],
    sigma_rad: Sequence[FloatArray],
    settings: LocalMapSettings,
) -> MapPoints:
    """All points that two or more keyframes saw: Γ of equation (3).

    Parameters
    ----------
    keyframes : sequence of Keyframe
        Oldest first.
    rays : sequence of array (N_i, 3)
        Unit directions of their corners, odom coordinates.
    sigma_rad : sequence of array (N_i,)
        One pixel of each corner's level as an angle.
    settings : LocalMapSettings

    Returns
    -------
    MapPoints
        Those with enough parallax, in front of every camera, and inside the gate.

    Examples
    --------
    >>> views = [Keyframe(stamp_ns=i, T_odom_cam=SE3.from_translation([i, 0, 0]), px=[[0, 0]], level=[0],
    ...                   track=[4]) for i in (0, 1)]
    >>> rays = [np.array([[0.0, 0, 1]]), np.array([[-1.0, 0, 4]]) / np.sqrt(17)]
    >>> triangulate_window(views, rays, [np.array([0.002])] * 2, LocalMapSettings()).position_m.round(6)
    array([[0., 0., 4.]])
    """
    view = np.repeat(np.arange(len(keyframes)), [len(k.track) for k in keyframes])
    track = np.concatenate([k.track for k in keyframes])
    order = np.argsort(track, kind="stable")  # stable: within a track, oldest keyframe first
    starts = np.flatnonzero(np.diff(track[order], prepend=-1))
    sizes = np.diff(starts, append=len(order))
    order = order[np.repeat(sizes >= 2, sizes)]
    starts = np.concatenate([[0], np.cumsum(sizes[sizes >= 2])])
    centres = np.array([k.T_odom_cam.t for k in keyframes])
    points, accepted = triangulate_rays(
        centres[view[order]],
        np.concatenate(rays)[order],
        starts,
        settings.min_parallax_rad,
        settings.gate_px * np.concatenate(sigma_rad)[order],
    )
    last = order[starts[1:] - 1][accepted]
    position_m = points[accepted]
    return MapPoints(
        position_m=position_m,
        level=np.concatenate([k.level for k in keyframes])[last],
        distance_m=np.linalg.norm(position_m - centres[view[last]], axis=1),
    )


class LocalMap:
    """The keyframes of the window, the corners that are followed, and the points they make.

    Parameters
    ----------
    camera : CameraModel
    settings : LocalMapSettings
    scale_factor : float
        Of the pyramid that the corners come from.

    Attributes
    ----------
    points : MapPoints
        ``M_t``, as of the last keyframe.

    Examples
    --------
    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> local_map = LocalMap(camera, LocalMapSettings(), 1.5)
    >>> len(local_map.points)
    0
    """

    def __init__(self, camera: CameraModel, settings: LocalMapSettings, scale_factor: float) -> None:
        self._camera = camera
        self._settings = settings
        self._scale_factor = scale_factor
        self._focal_px = 0.5 * (camera.fx + camera.fy)
        self.clear()

    def clear(self) -> None:
        """Forget everything: keyframes, followed corners, points."""
        window = self._settings.keyframes.window
        self._keyframes: deque[tuple[Keyframe, FloatArray, FloatArray]] = deque(maxlen=window)
        self._next_track = 0
        self._track = np.empty(0, dtype=np.int64)
        nothing = np.empty(0)
        self._features = Features(  # where last seen
            px=nothing.reshape(0, 2).astype(np.float32),
            level=nothing.astype(np.int8),
            score=nothing.astype(np.float32),
        )
        self._patches: Patches = np.empty((0, 64), dtype=np.float32)
        self._px_in_keyframe = np.empty((0, 2), dtype=np.float32)
        self.points = MapPoints(
            position_m=np.empty((0, 3)), level=nothing.astype(np.int8), distance_m=nothing
        )

    def observe(
        self, stamp_ns: int, pyramid: Sequence[GrayImage], features: Features, T_odom_cam: SE3
    ) -> str | None:
        """Follow the corners into a new frame, and keep it as a keyframe if there is reason to.

        Parameters
        ----------
        stamp_ns : int
        pyramid, features
            Of the new frame.
        T_odom_cam : SE3
            Its pose, as claimed.

        Returns
        -------
        str or None
            Why it was kept; None if it was not.
        """
        patches = describe(pyramid, features, self._scale_factor)
        partner = correspond(
            self._features.px,
            self._features.level,
            self._patches,
            features,
            patches,
            self._settings.correspondence.search_share * self._camera.width,
            self._settings.correspondence,
        )
        found = np.flatnonzero(partner >= 0)
        moved = features.px[partner[found]] - self._px_in_keyframe[found]
        reason = keyframe_reason(
            np.hypot(moved[:, 0], moved[:, 1]),
            len(self._track),
            self._focal_px,
            self._settings.keyframes,
        )
        if reason is not None:
            self._keep(stamp_ns, features, patches, T_odom_cam, found, partner[found])
        else:
            self._follow(features, patches, found, partner[found])
        return reason

    def _follow(
        self,
        features: Features,
        patches: Patches,
        found: npt.NDArray[np.int64],
        partner: npt.NDArray[np.int64],
    ) -> None:
        # Corners that FAST missed this time keep their last place, and may be found next time.
        px, level = self._features.px.copy(), self._features.level.copy()
        px[found], level[found] = features.px[partner], features.level[partner]
        self._patches[found] = patches[partner]
        self._features = Features(px=px, level=level, score=self._features.score)

    def _keep(
        self,
        stamp_ns: int,
        features: Features,
        patches: Patches,
        T_odom_cam: SE3,
        found: npt.NDArray[np.int64],
        partner: npt.NDArray[np.int64],
    ) -> None:
        track = np.arange(self._next_track, self._next_track + len(features), dtype=np.int64)
        self._next_track += len(features)
        track[partner] = self._track[found]
        self._track, self._features, self._patches = track, features, patches
        self._px_in_keyframe = features.px
        keyframe = Keyframe(
            stamp_ns=stamp_ns, T_odom_cam=T_odom_cam, px=features.px, level=features.level, track=track
        )
        rays = np.column_stack([self._camera.normalize(features.px), np.ones(len(features))])
        rays = (rays / np.linalg.norm(rays, axis=1, keepdims=True)) @ T_odom_cam.R.T
        sigma_rad = self._scale_factor ** features.level.astype(np.float64) / self._focal_px
        self._keyframes.append((keyframe, rays, sigma_rad))
        kept, all_rays, all_sigmas = zip(*self._keyframes, strict=True)
        self.points = triangulate_window(kept, all_rays, all_sigmas, self._settings)
