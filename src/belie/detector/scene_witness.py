"""The still scene around the objects: where the ground is, and what stands in a box, by the camera's own motion."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from belie.checks.objects import background_evidence, passing_evidence
from belie.detector.edge_noise import EdgeNoise
from belie.detector.object_track import ObjectTrack
from belie.detector.places import places_in, sides_of
from belie.geometry import SE3, CameraModel, FloatArray
from belie.odometry.scene_depth import InverseDepthPlane, fit_plane, ground_plane, static_inverse_depth
from belie.types import VisualEstimate

Scene = tuple[FloatArray, FloatArray, FloatArray]  # undistorted (N, 2), 1/Z and its deviation
_SeenSince = tuple[FloatArray, FloatArray, FloatArray, FloatArray]  # px now and then (N, 2), 1/Z now and then
_Depths = tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]  # 1/Z, its deviation, whether it keeps still

_SIGMA_PX = 0.7  # of a local corner: patches of small objects, enlarged, and the rotation's share
_MEMORY = 40  # frames
_RING = 1.0  # of the box's side: how far around it its wall is looked for
_FLOATS = 1.4  # wall nearer than the foot by this factor: the box ends in mid-air
_LEAST_SIDE_PX = 40.0  # of a box: smaller ones are so far that slopes decide where they stand
_MIDDLE = 0.3  # of the box's sides, either way: there, an object lets nothing through
_RIDES = 0.2  # of the box's sides: a corner that strays less keeps its place
_SIGMAS = 5.0  # of the error of told edges: no corner strays by less
_UNDER_WAY = 0.5  # of the way that corners stray which pass: nearer to passing than to riding
_FARTHER = 1.5  # in time to stray also by this factor: then what rides is no part of the scene
_STEEPEST = 0.15  # tangent: of roads, as a mean over the way to an object
# Tangent: between the camera's way and the ground that it drives on. Its way is known to some 0.02, as is the slope of
# a road 10 m on against that under the wheels; planes through parked cars and kerbs lie at 0.08 and more.
_STEEPEST_STEP = 0.05
_NEAREST = 0.1  # of its depth: a point that was not before the camera then
_TILT = 0.015  # rad: slope of the road against the fitted ground, and the camera's nodding
_LEAST_REACH_PX = 3.0  # within which a scene corner is found again by its depth
_SAME_DEPTH = 0.2  # of 1/Z: depths of scene corners are known to a fifth
_LEAST_GROUNDS = 3  # fits: a plane through parked cars passes for the road once, and no majority outvotes it
_GROUND_LASTS = 30  # frames: a camera keeps its height and tilt over the road


@dataclass(frozen=True, slots=True)
class _Corners:
    """Corners (N,) in and around a box, now and then.

    `places` (N, 2) in the box, 0 to 1; `strays` (N, 2), their change since then, 0 along axes where the image's border
    cuts it; `moves_px` (N, 2) in the image; `frames` since then; inverse depth, and whether they keep `still`.
    """

    places: FloatArray
    strays: FloatArray
    moves_px: FloatArray
    frames: npt.NDArray[np.int64]
    inverse_depth: FloatArray
    still: npt.NDArray[np.bool_]

    def joined(self, others: _Corners) -> _Corners:
        """These and others."""
        return _Corners(*(np.concatenate([getattr(self, n), getattr(others, n)]) for n in self.__slots__))


@dataclass(slots=True)
class SceneWitness:
    """Keeps the camera's own path in map units, and the ground."""

    camera: CameraModel
    frame: int = 0
    why: str = "the camera's motion is not known"
    _poses: deque[tuple[int, SE3]] = field(default_factory=lambda: deque(maxlen=_MEMORY))
    _map_id: int = -1
    _scene: Scene | None = None
    _scenes: deque[tuple[int, Scene]] = field(default_factory=lambda: deque(maxlen=_MEMORY))
    _ground: InverseDepthPlane | None = None
    _grounds: deque[FloatArray] = field(default_factory=lambda: deque(maxlen=15))  # the latest fits
    _ground_frame: int = 0
    _parallax_px: float = 0.0  # of the scene, since it last told something new
    _has_moved: bool = False
    _scene_px: dict[int, _SeenSince | None] = field(default_factory=dict)

    def move(self, estimate: VisualEstimate | None, scene: Scene | None) -> None:
        """Take over the camera's motion to a new frame, and the depths of its corners there."""
        self.frame += 1
        self._scene_px.clear()
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
        self._scenes.append((self.frame, scene))
        # The same picture seen twice is no second witness, neither of the ground nor of what stands on it.
        self._parallax_px += self._parallax_of(estimate, scene)
        self._has_moved = self._parallax_px >= _SIGMA_PX
        if self._has_moved:
            self._parallax_px = 0.0
            seen = ground_plane(*scene)
            if seen is not None and _runs_along(seen, estimate.T_prev_cur.t):
                self._grounds.append(seen.coefficients)
                self._ground_frame = self.frame
                if len(self._grounds) >= _LEAST_GROUNDS:
                    self._ground = InverseDepthPlane(np.median(np.array(self._grounds), axis=0))
        self.why = "" if self._ground is not None else "no ground is seen"

    def evidence(self, track: ObjectTrack, *, sees_foot: bool = True) -> tuple[float | None, float | None]:
        """Log-likelihood ratios, nats, for a box with the background in it; None where it cannot be told.

        That the scene passes through the box, and that its corners lie on the ground or the wall. `sees_foot`: no other
        box may hide where it ends.
        """
        steady_px = self._without_jump(track)
        if not sees_foot or not self._has_moved or len(self._poses) < 2:
            return None, None
        depths = self._depths(track)
        return self._passing(track, steady_px, depths), self._lying(track, depths)

    def _without_jump(self, track: ObjectTrack) -> FloatArray | None:
        """Its told box, but for a jump against its pixels; its corners are held against the box without from then on.

        A jump shifts all of them in the box at once, as a scene would that passes through it; but that goes on.
        """
        told, motion = track.carried_px, track.motion
        if told is None or track.told_before is None or motion is None or motion.error_px2 is None:
            return told  # where its pixels went is not known
        then, before = track.told_before
        frames = self.frame - then
        if not 0 < frames < len(track.history):
            return told
        moved = motion.box_px - track.history[-1 - frames][1]
        size = sides_of(told)
        excess = track.steps.excess((told - before - moved) / size)
        free = ~self._cut(told, track.edges)
        jumps = (np.abs(excess) > _SIGMAS * track.edges.deviation) & free
        if track.steps.noise is not None and not track.phantom.accused:
            # How steadily a scene passes through a box that shows it is no error of the box.
            track.edges.learn(track.steps.noise[free])
        if not jumps.any():
            return told
        older = (track.corners.births < self.frame) & np.isfinite(track.corners.born_places).all(axis=1)
        if not older.any():
            return told
        steady = told - np.where(jumps, excess, 0.0) * size
        places = places_in(told, track.corners.px)
        off = places - places_in(steady, track.corners.px)
        strays = places - track.corners.born_places
        with_jump, without = (np.median(np.abs(each[older]).max(axis=1)) for each in (strays, strays - off))
        if without >= with_jump:
            return told  # it is the pixels that were lost
        track.corners.born_places[older] += off[older]
        return np.asarray(steady)

    def _cut(self, box_px: FloatArray, edges: EdgeNoise) -> npt.NDArray[np.bool_]:
        """Which edges, left, top, right, bottom, may be the image's border instead of the object's."""
        left, top, right, bottom = box_px.tolist()
        to_border = np.array([left, top, self.camera.width - right, self.camera.height - bottom])
        return np.asarray(to_border < 2.0 * edges.deviation * sides_of(box_px))

    def _is_whole(self, box_px: FloatArray, edges: EdgeNoise) -> npt.NDArray[np.bool_]:
        """Along which axes places in a box tell what keeps its place.

        Not where the border cuts it, for an object that leaves or comes near moves on behind its edge; but no object
        is cut on all sides.
        """
        cut = self._cut(box_px, edges)
        return np.asarray(~(cut[:2] | cut[2:]) | cut.all())

    def _parallax_of(self, estimate: VisualEstimate, scene: Scene) -> float:
        rho = scene[1]
        typical = float(np.median(np.abs(rho))) if len(rho) else 0.0
        return float(np.linalg.norm(estimate.T_prev_cur.t)) * typical * self.camera.fx

    def _passing(self, track: ObjectTrack, steady_px: FloatArray | None, depths: _Depths) -> float | None:
        """Whether the still scene passes through the box; `steady_px`: the told one, but for a jump."""
        told = track.carried_px
        if told is None or float((told[2:] - told[:2]).max()) < _LEAST_SIDE_PX:
            return None
        corners = self._own_corners(track, told, depths)
        if track.told_before is not None and steady_px is not None:
            of_scene = self._scene_corners(steady_px, *track.told_before, track.edges)
            corners = corners if of_scene is None else corners.joined(of_scene)
        least = max(_RIDES, _SIGMAS * track.edges.deviation)
        strays = np.abs(corners.strays * self._is_whole(told, track.edges)).max(axis=1, initial=0.0)
        rides, still = strays < least, corners.still
        # An object lets nothing through its middle: neither what is there now, nor what was there then.
        tells = _in_the_middle(corners.places) | _in_the_middle(corners.places - corners.strays)
        goes_along = (
            np.abs(corners.moves_px / (told[2:] - told[:2])).max(axis=1, initial=0.0) > _FARTHER * least
        )
        passes = tells & still & ~rides
        if passes.any():
            track.phantom.aloft = self._is_aloft(told, corners.inverse_depth[passes], track.edges)
            # What passes as well, but has not had the time to, is no part of the object.
            expected = float(np.median(strays[passes] / corners.frames[passes])) * corners.frames
            tells &= ~rides | goes_along | (expected > _FARTHER * least) | (strays < _UNDER_WAY * expected)
        if not (tells & ~rides).any():
            track.phantom.take_back(int(np.count_nonzero(tells & goes_along)))
        return passing_evidence(rides[tells], still[tells])

    def _is_aloft(self, box_px: FloatArray, inverse_depth: FloatArray, edges: EdgeNoise) -> bool:
        """Whether an object before what passes through its box would stand on no road.

        The ground under it would have to rise, on the way from the camera to there, by more than roads do.
        """
        if self._ground is None or self._cut(box_px, edges)[3]:
            return False
        rise = (float(np.median(inverse_depth)) - self._foot(box_px)) / float(self._ground.coefficients[1])
        return rise > _STEEPEST + _TILT

    def _own_corners(self, track: ObjectTrack, told: FloatArray, depths: _Depths) -> _Corners:
        """The object's corners since they were found."""
        older = (track.corners.births < self.frame) & np.isfinite(track.corners.born_places).all(axis=1)
        rho, _, still = depths
        frames = self.frame - track.corners.births
        places = places_in(told, track.corners.px)
        strays = places - track.corners.born_places
        for age in np.unique(frames[older]).tolist():
            which = frames == age
            then_px = track.history[max(len(track.history) - 1 - age, 0)][1]
            strays[which] *= self._is_whole(then_px, track.edges)
        return _Corners(
            places[older], strays[older], (track.corners.px - track.corners.born_px)[older], frames[older],
            rho[older], still[older],
        )  # fmt: skip

    def _scene_corners(
        self, told: FloatArray, then: int, told_then: FloatArray, edges: EdgeNoise
    ) -> _Corners | None:
        """The still scene's corners since another box of the object was told."""
        if then not in self._scene_px:
            self._scene_px[then] = self._scene_since(then)
        seen = self._scene_px[then]
        if seen is None:
            return None
        now_px, then_px, rho, rho_then = seen
        places, places_then = places_in(told, now_px), places_in(told_then, then_px)
        near = _in_the_middle(places)
        # What an object hid then, and is seen beside it now, did not pass through it.
        left = np.flatnonzero(_in_the_middle(places_then) & ~near)
        reach_px = np.maximum(_LEAST_REACH_PX, _SAME_DEPTH * np.abs(now_px - then_px).max(axis=1))
        near[left] = self._was_seen(then, told_then, then_px[left], rho_then[left], reach_px[left])
        strays = (places - places_then)[near] * self._is_whole(told_then, edges)
        n = len(strays)
        return _Corners(
            places[near], strays, (now_px - then_px)[near], np.full(n, self.frame - then),
            rho[near], np.ones(n, dtype=bool),
        )  # fmt: skip

    def _was_seen(
        self,
        then: int,
        told_then: FloatArray,
        then_px: FloatArray,
        rho_then: FloatArray,
        reach_px: FloatArray,
    ) -> npt.NDArray[np.bool_]:
        """Of scene points (N, 2), whether a corner so far away was known there then, in the middle of the box."""
        scene = dict(self._scenes).get(then)
        if scene is None or not len(then_px):
            return np.zeros(len(then_px), dtype=bool)
        seen_px = self.camera.project(np.column_stack([scene[0], np.ones(len(scene[0]))]))
        within = _in_the_middle(places_in(told_then, seen_px))
        off_px = np.abs(then_px[:, None] - seen_px[within]).max(axis=2)
        off = np.abs(rho_then[:, None] - scene[1][within])
        same = (off_px < reach_px[:, None]) & (off < _SAME_DEPTH * rho_then[:, None])
        return np.asarray(same.any(axis=1))

    def _scene_since(self, then: int) -> _SeenSince | None:
        """The still scene's corners, now and in an earlier frame."""
        poses = dict(self._poses)
        if self._scene is None or then not in poses or then == self.frame:
            return None
        xy, rho, _ = (values[self._scene[1] > 0.0] for values in self._scene)
        points = np.column_stack([xy, np.ones(len(xy))]) / rho[:, None]
        points_then = (poses[then].inverse() @ poses[self.frame]).apply(points)
        ahead = points_then[:, 2] > _NEAREST * points[:, 2]
        return (
            self.camera.project(points[ahead]), self.camera.project(points_then[ahead]),
            rho[ahead], 1.0 / points_then[ahead, 2],
        )  # fmt: skip

    def _scene_within(self, box_px: FloatArray) -> Scene:
        """The still scene's corners inside a box."""
        assert self._scene is not None
        xy, rho, deviation = self._scene
        low, high = self._undistorted(box_px.reshape(2, 2) - 0.5)
        inside = np.asarray(((xy > low) & (xy < high)).all(axis=1))
        return xy[inside], rho[inside], deviation[inside]

    def _lying(self, track: ObjectTrack, depths: _Depths) -> float | None:
        """Whether its corners lie on the ground or the wall."""
        if self._ground is None or self._scene is None:
            return None
        left, top, right, bottom = track.box_px
        if bottom > self.camera.height - 2.0 or max(right - left, bottom - top) < _LEAST_SIDE_PX:
            return None  # its foot is out of view, or it is too far away
        depth, deviation, still = depths
        known = np.isfinite(deviation)
        # Its own corners are many and young; those of the scene are few and have been triangulated for long.
        scene_xy, scene_depth, scene_deviation = self._scene_within(track.box_px)
        depth = np.concatenate([np.where(still, depth, np.nan)[known], scene_depth])
        deviation = np.concatenate([deviation[known], scene_deviation])
        xy = np.concatenate([self._undistorted(track.corners.px)[known], scene_xy])
        if len(xy) == 0:
            return None
        foot = self._foot(track.box_px)
        error = _TILT * float(self._ground.coefficients[1])
        found: list[float] = []
        if foot > 0.0:
            # At the horizon the ground is as far as what drives along with the camera, or the sky.
            ground = self._ground.at(xy)
            below = np.asarray(ground > error)
            on_ground = background_evidence(depth[below], deviation[below], ground[below], foot, tilt=error)
            if on_ground is not None:
                found.append(on_ground)
        wall = self._wall(track.box_px)
        if wall is not None and (wall.at(xy) > _FLOATS * max(foot, 1e-6)).all():
            on_wall = background_evidence(depth, deviation, wall.at(xy), max(foot, 0.0), error)
            if on_wall is not None:
                found.append(on_wall)
        return max(found, default=None)

    def _foot(self, box_px: FloatArray) -> float:
        """Inverse depth of the ground where a box ends below; negative above the horizon."""
        assert self._ground is not None
        left, _, right, bottom = box_px.tolist()
        return float(self._ground.at(self._undistorted(np.array([[0.5 * (left + right), bottom]]) - 0.5))[0])

    def _undistorted(self, px: FloatArray) -> FloatArray:
        return np.asarray(self.camera.normalize(px)).reshape(-1, 2)

    def _depths(self, track: ObjectTrack) -> _Depths:
        """Inverse depth and deviation of its corners, as parts of a still scene, and whether they are; NaN: unknown."""
        poses = dict(self._poses)
        now = poses[self.frame]
        depth = np.full(len(track.corners.births), np.nan)
        deviation = np.full(len(track.corners.births), np.nan)
        keeps_still = np.zeros(len(track.corners.births), dtype=bool)
        xy = self._undistorted(track.corners.px)
        sigma = _SIGMA_PX / self.camera.fx
        for born in np.unique(track.corners.births):
            if int(born) not in poses or born == self.frame:
                continue
            which = track.corners.births == born
            motion = now.inverse() @ poses[int(born)]
            rho, sd, still = static_inverse_depth(
                self._undistorted(track.corners.born_px[which]), xy[which], motion, sigma
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


def _runs_along(ground: InverseDepthPlane, t: FloatArray) -> bool:
    """Whether a camera that moves by `t` keeps its height over a plane: else it is no ground, or the slope beyond it.

    >>> road, banked = (InverseDepthPlane(np.array([0.0, 0.6, c])) for c in (0.0, 0.06))
    >>> [_runs_along(plane, np.array([0.0, 0.0, -1.2])) for plane in (road, banked)]
    [True, False]
    """
    n = ground.coefficients
    return abs(float(n @ t)) <= _STEEPEST_STEP * float(np.linalg.norm(n) * np.linalg.norm(t))


def _in_the_middle(places: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether places in a box, shape (N, 2), lie where an object lets nothing through."""
    return np.asarray((np.abs(places - 0.5) < _MIDDLE).all(axis=1))
