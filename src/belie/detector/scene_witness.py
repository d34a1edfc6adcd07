"""The still scene around the objects: where the ground is, and what stands in a box, by the camera's own motion."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from belie.checks.objects import background_evidence, passing_evidence
from belie.detector.object_track import ObjectTrack, places_in
from belie.geometry import SE3, CameraModel, FloatArray
from belie.odometry.scene_depth import InverseDepthPlane, fit_plane, ground_plane, static_inverse_depth
from belie.types import VisualEstimate

Scene = tuple[FloatArray, FloatArray, FloatArray]  # undistorted (N, 2), 1/Z and its deviation

_SIGMA_PX = 0.7  # of a local corner: patches of small objects, enlarged, and the rotation's share
_MEMORY = 40  # frames
_RING = 1.0  # of the box's side: how far around it its wall is looked for
_FLOATS = 1.4  # wall nearer than the foot by this factor: the box ends in mid-air
_LEAST_SIDE_PX = 40.0  # of a box: smaller ones are so far that slopes decide where they stand
_MIDDLE = 0.3  # of the box's sides, either way: there, an object lets nothing through
_RIDES = (
    0.2  # of the box's sides: a corner that strays less keeps its place; 5 sigma of a box with 3 % jitter
)
_NEAREST = 0.1  # of its depth: a point that was not before the camera then
_TILT = 0.015  # rad: slope of the road against the fitted ground, and the camera's nodding
_LEAST_GROUNDS = 3  # fits: a plane through parked cars passes for the road once, and no majority outvotes it
_GROUND_LASTS = 30  # frames: a camera keeps its height and tilt over the road


@dataclass(slots=True)
class SceneWitness:
    """Keeps the camera's own path in map units, and the ground."""

    camera: CameraModel
    frame: int = 0
    why: str = "the camera's motion is not known"
    _poses: deque[tuple[int, SE3]] = field(default_factory=lambda: deque(maxlen=_MEMORY))
    _map_id: int = -1
    _scene: Scene | None = None
    _ground: InverseDepthPlane | None = None
    _grounds: deque[FloatArray] = field(default_factory=lambda: deque(maxlen=15))  # the latest fits
    _ground_frame: int = 0
    _parallax_px: float = 0.0  # of the scene, since it last told something new
    _has_moved: bool = False

    def move(self, estimate: VisualEstimate | None, scene: Scene | None) -> None:
        """Take over the camera's motion to a new frame, and the depths of its corners there."""
        self.frame += 1
        self._scene = scene
        if self.frame - self._ground_frame > _GROUND_LASTS:
            self._ground = None
        known = estimate is not None and estimate.reason is None and estimate.inliers > 0
        if estimate is None or not known or scene is None:
            self._poses.clear()
            self._ground = None
            self._grounds.clear()
            self.why = (
                estimate.reason if estimate is not None else None
            ) or "the camera's motion is not known"
            return
        if estimate.map_id != self._map_id or not self._poses:
            self._poses.clear()
            self._ground = None
            self._grounds.clear()
            self._map_id = estimate.map_id
            self._poses.append((self.frame - 1, SE3.identity()))
        self._poses.append((self.frame, self._poses[-1][1] @ estimate.T_prev_cur))
        # The same picture seen twice is no second witness, neither of the ground nor of what stands on it.
        self._parallax_px += self._parallax_of(estimate, scene)
        self._has_moved = self._parallax_px >= _SIGMA_PX
        if self._has_moved:
            self._parallax_px = 0.0
            seen = ground_plane(*scene)
            if seen is not None:
                self._grounds.append(seen.coefficients)
                self._ground_frame = self.frame
                if len(self._grounds) >= _LEAST_GROUNDS:
                    self._ground = InverseDepthPlane(np.median(np.array(self._grounds), axis=0))
        self.why = "" if self._ground is not None else "no ground is seen"

    def evidence(self, track: ObjectTrack) -> tuple[float | None, float | None]:
        """Log-likelihood ratios, nats, for a box with the background in it; None where it cannot be told.

        That the scene passes through the box, and that its corners lie on the ground or the wall.
        """
        return (self._passing(track), self._lying(track)) if self._has_moved else (None, None)

    def _parallax_of(self, estimate: VisualEstimate, scene: Scene) -> float:
        rho = scene[1]
        typical = float(np.median(np.abs(rho))) if len(rho) else 0.0
        return float(np.linalg.norm(estimate.T_prev_cur.t)) * typical * self.camera.fx

    def _passing(self, track: ObjectTrack) -> float | None:
        """Whether the still scene passes through the box."""
        told = track.told_px
        if told is None or len(self._poses) < 2 or float((told[2:] - told[:2]).max()) < _LEAST_SIDE_PX:
            return None
        now, before = places_in(told, track.corners_px), track.born_places
        _, _, still = self._depths(track)
        older = track.births < self.frame
        scene_now, scene_before = self._scene_places(track)
        now, before = np.concatenate([now[older], scene_now]), np.concatenate([before[older], scene_before])
        still = np.concatenate([still[older], np.ones(len(scene_now), dtype=bool)])
        middle = np.asarray((np.abs(now - 0.5) < _MIDDLE).all(axis=1))
        rides = np.asarray((np.abs(now - before) < _RIDES).all(axis=1))
        return passing_evidence(rides[middle], still[middle])

    def _scene_places(self, track: ObjectTrack) -> tuple[FloatArray, FloatArray]:
        """Where the corners of the still scene lie in the told box, and lay in the one that was told before."""
        poses, none = dict(self._poses), np.empty((0, 2))
        if self._scene is None or track.told_px is None or track.told_before is None:
            return none, none
        then, box_then = track.told_before
        if then not in poses or then == self.frame:
            return none, none
        xy, rho, _ = self._scene_within(track.told_px)
        xy, rho = xy[rho > 0.0], rho[rho > 0.0]
        points = np.column_stack([xy, np.ones(len(xy))]) / rho[:, None]
        points_then = (poses[then].inverse() @ poses[self.frame]).apply(points)
        ahead = points_then[:, 2] > _NEAREST * points[:, 2]
        now_px, then_px = self.camera.project(points[ahead]), self.camera.project(points_then[ahead])
        return places_in(track.told_px, now_px), places_in(box_then, then_px)

    def _scene_within(self, box_px: FloatArray) -> Scene:
        """The still scene's corners inside a box."""
        assert self._scene is not None
        xy, rho, deviation = self._scene
        low, high = self._undistorted(box_px.reshape(2, 2) - 0.5)
        inside = np.asarray(((xy > low) & (xy < high)).all(axis=1))
        return xy[inside], rho[inside], deviation[inside]

    def _lying(self, track: ObjectTrack) -> float | None:
        """Whether its corners lie on the ground or the wall."""
        if self._ground is None or self._scene is None:
            return None
        left, top, right, bottom = track.box_px
        if bottom > self.camera.height - 2.0 or max(right - left, bottom - top) < _LEAST_SIDE_PX:
            return None  # its foot is out of view, or it is too far away
        depth, deviation, still = self._depths(track)
        known = np.isfinite(deviation)
        # Its own corners are many and young; those of the scene are few and have been triangulated for long.
        scene_xy, scene_depth, scene_deviation = self._scene_within(track.box_px)
        depth = np.concatenate([np.where(still, depth, np.nan)[known], scene_depth])
        deviation = np.concatenate([deviation[known], scene_deviation])
        xy = np.concatenate([self._undistorted(track.corners_px)[known], scene_xy])
        if len(xy) == 0:
            return None
        foot_xy = self._undistorted(np.array([[0.5 * (left + right), bottom]]) - 0.5)
        foot = float(self._ground.at(foot_xy)[0])
        error = _TILT * float(self._ground.coefficients[1])
        found: list[float] = []
        if foot > 0.0:
            # At the horizon the ground is as far as what drives along with the camera, or the sky.
            ground = self._ground.at(xy)
            below = np.asarray(ground > error)
            on_ground = background_evidence(depth[below], deviation[below], ground[below], foot)
            if on_ground is not None:
                found.append(on_ground)
        wall = self._wall(track.box_px)
        if wall is not None and (wall.at(xy) > _FLOATS * max(foot, 1e-6)).all():
            on_wall = background_evidence(depth, deviation, wall.at(xy), max(foot, 0.0), error)
            if on_wall is not None:
                found.append(on_wall)
        return max(found, default=None)

    def _undistorted(self, px: FloatArray) -> FloatArray:
        return np.asarray(self.camera.normalize(px)).reshape(-1, 2)

    def _depths(self, track: ObjectTrack) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
        """Inverse depth and deviation of its corners, as parts of a still scene, and whether they are; NaN: unknown."""
        poses = dict(self._poses)
        now = poses[self.frame]
        depth = np.full(len(track.births), np.nan)
        deviation = np.full(len(track.births), np.nan)
        keeps_still = np.zeros(len(track.births), dtype=bool)
        xy = self._undistorted(track.corners_px)
        sigma = _SIGMA_PX / self.camera.fx
        for born in np.unique(track.births):
            if int(born) not in poses or born == self.frame:
                continue
            which = track.births == born
            motion = now.inverse() @ poses[int(born)]
            rho, sd, still = static_inverse_depth(
                self._undistorted(track.born_px[which]), xy[which], motion, sigma
            )
            depth[which], deviation[which], keeps_still[which] = rho, sd, still
        return depth, deviation, keeps_still

    def _wall(self, box_px: FloatArray) -> InverseDepthPlane | None:
        """The plane around a box that is not the ground."""
        assert self._scene is not None
        assert self._ground is not None
        xy, rho, sd = self._scene
        low, high = self._undistorted(box_px.reshape(2, 2) - 0.5)
        side = high - low
        near = ((xy > low - _RING * side) & (xy < high + _RING * side)).all(axis=1)
        inside = ((xy > low) & (xy < high)).all(axis=1)
        ground = np.abs(rho - self._ground.at(xy)) < 2.0 * sd + 0.1 * np.abs(rho)
        chosen = near & ~inside & ~ground
        return fit_plane(xy[chosen], rho[chosen], sd[chosen], least=8, share=0.6)
