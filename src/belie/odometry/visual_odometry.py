"""The conductor of the default profile: images in, camera motion out; no claim comes near it."""

from __future__ import annotations

import math
from concurrent.futures import Future
from copy import deepcopy

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from belie.geometry import SE3, CameraModel, FloatArray
from belie.odometry.agreement import (
    KNOWN_RAD,
    MAJORITY,
    agreement,
    direction_error,
    extent,
    stretched,
    sureness_of,
)
from belie.odometry.depth_filter import TrackedCorners
from belie.odometry.features import Candidates, FeatureSettings, extract_features, find_candidates
from belie.odometry.first_baseline import UNKNOWN_DEPTH, FirstBaseline, depths_after, first_baseline
from belie.odometry.image_quality import sensor_noise, why_nothing_is_seen
from belie.odometry.plane_ambiguity import OtherMotion, evidence_between
from belie.odometry.pose_covariance import LEAST_CORNERS, PoseCovariance
from belie.odometry.relative_pose import RelativePose, estimate_relative_pose, robust_cost, straightened
from belie.odometry.tracking import Pyramid, TrackingSettings, build_pyramid, second_thread, track
from belie.odometry.two_view import hidden_rotation, relative_pose_from_scratch, rotation_between
from belie.types import Frame, GrayImage, Settings, VisualEstimate
from belie.types.features import Features

_ENOUGH = 3 * LEAST_CORNERS  # followed corners: traffic may take two thirds of them
# Least eigenvalue of a weak corner, in variances of the image's noise, which by itself makes half of one: of the
# structure an eighth is noise, and pulls a corner by no more than that share of its way from where it was expected.
_WEAK = 4.0
_LEAST_TRACKS = 15  # five unknowns, robustly: three points for each
_MOST_UNVOUCHED = 3  # frames in which no majority is found; then the map has lost its hold
_LEAST_AGREEING = 0.3  # share of the corners; fewer, and the map is no map of this scene
_HARRIS = 0.04  # Harris and Stephens, 1988: along an edge a patch slides
_BREAKDOWN = 0.5  # share of the corners; with fewer no map can tell what stands from what moves
_LEAST_EXTENT = 0.15  # of the image: half the corners of a car in the next lane, 10 m ahead, lie within it
_UNKNOWN_RAD = 0.5  # of a direction, where corners move: depths that follow from such a motion are none
_CONFIRMED = (
    3  # images in which its direction is known well, before a new map is believed: traffic makes maps, too
)
_WILD_CHI2 = 16.0  # of a corner that is no longer followed
_NEW_MAP = "a new map, not yet confirmed: another image must agree with its direction"
_UNOBSERVED = 1e6  # variance of a translation that was not seen, map units²


class VisualOdometrySettings(Settings):
    """Motion from images, default profile."""

    corners: int = Field(400, ge=50, le=5000, description="corners followed at a time [count]")
    working_width_px: int = Field(
        1300, ge=160,
        description="images wider than this are halved until they fit [px]; 0.1 px of 1000 is 0.006 deg, finer "
        "than any claim we judge",
    )  # fmt: skip
    baseline_px: float = Field(
        2.0, gt=0.0,
        description="median parallax, rotation removed, before a first pair of frames is trusted to show a "
        "direction of motion [px at working size]; ten times the error of a tracked corner",
    )  # fmt: skip
    depth_drift: float = Field(
        0.02, ge=0.0, le=1.0,
        description="relative error that a point's depth gains a frame [1]: what errors shared by neighbours add, "
        "which no averaging removes",
    )  # fmt: skip
    calibration_error: float = Field(
        0.01, ge=0.0,
        description="error of a corner's displacement that is the calibration's fault [px per px]: of the focal "
        "length and of the distortion's slope",
    )  # fmt: skip
    tracking_bias_px: float = Field(
        0.1, ge=0.0,
        description="what near corners may seem to move against far ones where nothing moves: rain, noise, flicker "
        "[px a frame, at working size]; at 10 m and f = 700 px it is 1.4 mm a frame",
    )  # fmt: skip
    spread_frames: int = Field(
        10, ge=1,
        description="frames over which the disagreement of the image's parts is averaged, which widens the stated "
        "error of the motion [count]: that of one frame is known to 40 %",
    )  # fmt: skip


class VisualOdometry:
    """Frame by frame motion of one camera.

    Parameters
    ----------
    camera : CameraModel
        Of the images as they come, full resolution.
    settings, features, tracking
        See the classes.

    Examples
    --------
    >>> camera = CameraModel(width=160, height=120, fx=100, fy=100, cx=79.5, cy=59.5)
    >>> odometry = VisualOdometry(camera)
    >>> gray = np.zeros((120, 160), np.uint8)
    >>> odometry.update(Frame(camera="/image", stamp_ns=0, received_ns=0, image=gray)).reason
    'dark: mean gray value 0'
    """

    def __init__(
        self,
        camera: CameraModel,
        settings: VisualOdometrySettings | None = None,
        tracking: TrackingSettings | None = None,
        features: FeatureSettings | None = None,
    ) -> None:
        self.settings = settings or VisualOdometrySettings()
        self.tracking = tracking or TrackingSettings()
        self.features = features or FeatureSettings(levels=2, scale_factor=2.0, distinct_levels=True)
        self._shrink = 1
        while camera.width / self._shrink > self.settings.working_width_px:
            self._shrink *= 2
        self._camera = camera.scaled(1.0 / self._shrink)
        self._focal_px = math.sqrt(self._camera.fx * self._camera.fy)
        self._pyramid: Pyramid = ()
        self._map_id = 0
        self._corners = TrackedCorners()
        self._pose_covariance = PoseCovariance(self.settings.spread_frames)
        self._last_features: Features | None = None
        self._search: Future[Candidates] | None = None
        self._unit = 1.0
        self._sigma_px = 0.2
        self._forget_motion()

    def _begin_anew(self) -> None:
        """Forget motion and map: what comes has another scale."""
        self._forget_motion()
        self._map_id += 1
        self._corners = TrackedCorners()

    def _forget_motion(self) -> None:
        self._unvouched = 0
        self._pose_covariance.forget()
        self._T_cur_prev = SE3.identity()
        self._interval_ns = 0
        self._stamp_ns: int | None = None
        self._has_scale = False
        self._anchor = np.empty((0, 2))
        self._strong = np.empty(0, dtype=bool)
        self._other: OtherMotion | None = None
        self._confirmed = 0

    def update(self, frame: Frame) -> VisualEstimate:
        """The camera's motion since the previous frame; `reason` is set where the images do not tell."""
        pyramid = build_pyramid(self._working_image(frame.image), self.tracking.levels)  # F_t
        previous_ns, self._search = self._stamp_ns, None
        if previous_ns is None:
            return self._start(frame, pyramid)
        interval_ns = frame.stamp_ns - previous_ns
        rays = self._rays(self._corners.px)
        predicted = self._predict(rays, interval_ns)  # (4), (5)
        found, verified = self._track(pyramid, predicted)  # Ψ, (6)
        tried = len(found)
        self._keep(verified)
        rays, found, predicted = rays[verified], found[verified], predicted[verified]
        had_scale = self._has_scale
        if cv2.getNumThreads() > 1 and self._needs_corners(len(found)):  # meanwhile
            self._search = second_thread().submit(
                find_candidates, pyramid[: self.features.levels], self.features, self._last_features
            )
        self._fits_anchor = np.ones(len(rays), dtype=bool)
        current = self._camera.normalize(found)
        pose = self._optimize(rays, current, interval_ns)  # Θ, (6)
        agreeing = float(pose.inliers.mean()) if pose is not None else 0.0
        if pose is None or agreeing < _LEAST_AGREEING:
            return self._lost(frame, pyramid, tried, len(found))
        confirmed = self._confirmed
        estimate = self._answer(frame, previous_ns, tried, rays, found, current, predicted, pose, had_scale)
        self._learn_noise(pose)
        kept = self._corners.advance(rays, pose, found, self.settings.depth_drift)  # Γ, (3)
        kept &= (pose.chi2 < _WILD_CHI2) & self._fits_anchor
        if self._other is not None:
            other = self._other
            kept |= other.corners.advance(rays, other.pose, found, self.settings.depth_drift) & (
                other.pose.chi2 < _WILD_CHI2
            )
        self._keep(kept)
        self._T_cur_prev, self._interval_ns = pose.T_cur_prev, interval_ns
        if estimate.inliers:
            self._unvouched = 0
            if had_scale and self._other is None and not estimate.is_still:
                self._unit = float(np.linalg.norm(self._T_cur_prev.t)) or self._unit
        elif self._confirmed == confirmed:  # nor does a map that its images do not confirm get better
            self._unvouched += 1
        settled = had_scale and self._other is None and self._moves(estimate.parallax_px / self._shrink)
        astray = settled and direction_error(pose, estimate.covariance) > _UNKNOWN_RAD
        if self._unvouched >= _MOST_UNVOUCHED or agreeing < _BREAKDOWN or astray:
            self._begin_anew()
        self._take(frame, pyramid)
        return estimate

    def scene(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Corners of the latest image whose depth is known to a fifth: undistorted (N, 2), 1/Z and its deviation.

        None while two motions stand, and with them two depths for each; nor of weak corners, whose depths creep.
        """
        deviation = np.sqrt(self._corners.variance)
        known = deviation < (0.2 if self._other is None else 0.0) * self._corners.inverse_depth
        known &= self._strong
        xy = self._camera.normalize(self._corners.px[known])
        return np.asarray(xy).reshape(-1, 2), self._corners.inverse_depth[known], deviation[known]

    def half(self) -> GrayImage | None:
        """The latest image at half its size, where that is what was looked at."""
        return self._pyramid[0] if self._shrink == 2 and self._pyramid else None

    def _keep(self, chosen: npt.NDArray[np.bool_]) -> None:
        self._corners.keep(chosen)
        self._anchor = self._anchor[chosen]
        self._strong = self._strong[chosen]
        if self._other is not None:
            self._other.corners.keep(chosen)

    # -- stages ------------------------------------------------------------------------------------

    def _working_image(self, image: GrayImage) -> GrayImage:
        if self._shrink == 1:
            return image
        size = (self._camera.width, self._camera.height)
        return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)

    def _rays(self, px: FloatArray) -> FloatArray:
        return np.column_stack([self._camera.normalize(px), np.ones(len(px))])

    def _predict(self, rays: FloatArray, interval_ns: int) -> FloatArray:
        motion = self._T_cur_prev
        if self._interval_ns > 0 and interval_ns != self._interval_ns:
            motion = SE3.exp(motion.log() * (interval_ns / self._interval_ns))
        points = self._corners.predict(rays, motion)
        points[:, 2] = np.maximum(points[:, 2], 1e-3)
        return self._camera.project(points)

    def _track(self, pyramid: Pyramid, predicted: FloatArray) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Follow strong corners; weak ones too in an image that leaves too few of them, as fog does."""

        def follow(least: float) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
            return track(self._pyramid, pyramid, self._corners.px, predicted, self.tracking, _HARRIS, least)

        found, self._strong = follow(self.tracking.min_eigenvalue)
        if np.count_nonzero(self._strong) >= _ENOUGH:
            return found, self._strong
        weak = _WEAK * sensor_noise(pyramid[0]) ** 2
        return follow(weak) if weak < self.tracking.min_eigenvalue else (found, self._strong)

    def _optimize(self, rays: FloatArray, current: FloatArray, interval_ns: int) -> RelativePose | None:
        if len(current) < _LEAST_TRACKS:
            return None
        sigma = self._sigma_px / self._focal_px
        if not self._has_scale:
            return self._first_baseline(rays, current, sigma)
        ratio = interval_ns / self._interval_ns if self._interval_ns > 0 else 1.0
        pose = self._refine(rays, current, self._corners, self._T_cur_prev, ratio)
        if self._other is None:
            return pose
        other = self._other
        other.pose = self._refine(rays, current, other.corners, other.pose.T_cur_prev, ratio)
        # Where traffic outvotes the scene, neither is told from the other by it.
        if max(float(pose.inliers.mean()), float(other.pose.inliers.mean())) >= MAJORITY:
            other.weigh(pose)
        if other.proven:
            self._corners, pose = other.corners, other.pose
        if other.proven or other.refuted:
            self._other = None
        return pose

    def _refine(
        self, rays: FloatArray, current: FloatArray, corners: TrackedCorners, last: SE3, ratio: float
    ) -> RelativePose:
        """The motion that fits a map best, looked for from the last one, and from rest and scratch where that fails."""
        sigma = self._sigma_px / self._focal_px
        guesses = [SE3.exp(last.log() * ratio)]
        best: RelativePose | None = None
        for attempt in range(2):
            for guess in guesses:
                pose = estimate_relative_pose(
                    rays[:, :2],
                    current,
                    corners.inverse_depth,
                    corners.variance,
                    guess,
                    sigma=sigma,
                    calibration_error=self.settings.calibration_error,
                )
                if best is None or robust_cost(pose) < robust_cost(best):
                    best = pose
            if attempt == 0 and best is not None and float(best.inliers.mean()) > 0.6:
                break
            # The motion changed more than the optimiser could follow: begin from rest and from scratch.
            R, _ = rotation_between(rays[:, :2], current, sigma)
            guesses = [SE3(R, np.zeros(3))]
            scratch = relative_pose_from_scratch(rays[:, :2], current, sigma)
            if scratch is not None:
                guesses.append(SE3(scratch.R, scratch.t * float(np.linalg.norm(last.t))))
        assert best is not None
        if int(best.inliers.sum()) < LEAST_CORNERS:  # too few to tell by themselves
            return best
        return straightened(
            best,
            rays[:, :2],
            current,
            corners.inverse_depth,
            corners.variance,
            sigma=sigma,
            calibration_error=self.settings.calibration_error,
        )

    def _first_baseline(self, rays: FloatArray, current: FloatArray, sigma: float) -> RelativePose:
        """Rotation alone, until the corners have moved enough since the anchor frame to show their depths."""
        corners = self._corners
        R, parallax = rotation_between(rays[:, :2], current, sigma)
        # Two images: those corners that were first seen in the same one, most of them in the first.
        together = corners.age == np.bincount(corners.age).argmax()
        anchor = self._anchor[together]
        _, since_anchor = rotation_between(anchor, current[together], sigma)
        first: FirstBaseline | None = None
        if float(np.median(since_anchor)) * self._focal_px >= self.settings.baseline_px:
            parallax_since = float(np.median(since_anchor))
            first = first_baseline(anchor, current[together], sigma, parallax_since, self._unit)
            if first is not None and not first.makes_a_map:
                self._fits_anchor[together] = first.pose.across2 < _WILD_CHI2
                first = None
        spread = float(np.median(parallax)) ** 2 + sigma * sigma
        # A translation looks like a rotation where depths are alike: it leaves a fraction of itself as parallax.
        hidden = hidden_rotation(rays[:, :2]) * float(np.median(parallax))
        mistaken = hidden**2 + sigma * sigma / len(rays)
        residual = current - _project(rays @ R.T)

        def turned(inverse_depth: FloatArray, variance: FloatArray) -> RelativePose:
            return RelativePose(
                T_cur_prev=SE3(R, np.zeros(3)),
                covariance=np.diag([_UNOBSERVED] * 3 + [mistaken] * 3),
                inverse_depth=inverse_depth,
                inverse_depth_variance=variance,
                chi2=np.where(inverse_depth < 0.0, np.inf, 0.5 * (residual**2).sum(axis=1) / spread),
                across2=np.full(len(rays), np.inf),
            )

        def with_depths(since_anchor: RelativePose) -> RelativePose:
            near, variance = depths_after(since_anchor, anchor, rays[together], R)
            typical = float(np.median(np.maximum(near, 0.0)))
            inverse_depth = np.full(len(rays), typical)
            unknown = np.full(len(rays), (UNKNOWN_DEPTH * typical) ** 2 + 1e-18)
            inverse_depth[together], unknown[together] = near, variance
            return turned(inverse_depth, unknown)

        if first is None:
            return turned(corners.inverse_depth, corners.variance)
        self._has_scale = True
        if first.other is not None:
            evidence = evidence_between(first.pose, first.other)
            self._other = OtherMotion(deepcopy(corners), with_depths(first.other), evidence)
        return with_depths(first.pose)

    def _answer(
        self, frame: Frame, previous_ns: int, tried: int, rays: FloatArray, found: FloatArray,
        current: FloatArray, predicted: FloatArray, pose: RelativePose, had_scale: bool,
    ) -> VisualEstimate:  # fmt: skip
        inliers = pose.inliers
        rotated = _project(rays @ pose.T_cur_prev.R.T)
        parallax = np.linalg.norm(current - rotated, axis=1)[inliers] * self._focal_px
        typical_px = float(np.median(parallax)) if len(parallax) else 0.0
        # Errors of calibration grow with the way that a corner went, and neighbours share them.
        way = float(np.median(np.linalg.norm(found - self._corners.px, axis=1)))
        shared = 1.0 + (self.settings.calibration_error * way / self._sigma_px) ** 2
        agreed = agreement(pose)
        sureness = sureness_of(agreed)
        covariance = pose.covariance
        if had_scale:
            sigma = self._sigma_px / self._focal_px
            covariance = self._pose_covariance.update(rays[:, :2], current, pose, sigma)
            depth = 1.0 / max(float(np.median(pose.inverse_depth)), 1e-9)
            bias = self.settings.tracking_bias_px / self._focal_px * depth
            covariance[:3, :3] += bias**2 * np.eye(3)
            covariance = stretched(covariance, pose, sureness)
            if self._other is not None:
                covariance += self._other.doubt(pose)
        covariance = covariance * shared / sureness**2
        reason = None if had_scale else "no baseline yet: the camera has not moved enough to show a direction"
        if had_scale and self._other is not None:
            reason = "two motions explain the images: all corners lie in one plane; only rotation is checked"
        agreeing = int(inliers.sum())
        if agreed < MAJORITY:
            reason = (
                f"no majority: {agreeing} of {len(found)} corners move as one (traffic, repeated texture)"
            )
            agreeing = 0
        elif had_scale and agreeing < LEAST_CORNERS:
            reason = f"too few corners: {agreeing} agree, {LEAST_CORNERS} are needed to tell how far they may be off"
            agreeing = 0
        elif had_scale and extent(found[inliers], self._camera) < _LEAST_EXTENT:
            reason = f"all {agreeing} corners that agree lie close together: a passing vehicle, or the scene?"
            agreeing = 0
        elif had_scale and self._other is None and self._confirmed < _CONFIRMED:
            self._confirmed += direction_error(pose, covariance) < KNOWN_RAD
            if self._moves(typical_px):
                reason, agreeing = _NEW_MAP, 0
        return VisualEstimate(
            stamp_ns=frame.stamp_ns,
            previous_stamp_ns=previous_ns,
            T_prev_cur=pose.T_cur_prev.inverse(),
            covariance=covariance,
            corners=tried,
            matches=len(found),
            inliers=agreeing,
            parallax_px=typical_px * self._shrink,
            map_id=self._map_id,
            error_px2=float(np.mean(pose.chi2[inliers])) * self._sigma_px**2 * self._shrink**2,
            reason=reason,
            predicted_px=self._full(predicted),
            observed_px=self._full(found),
        )

    def _moves(self, parallax_px: float) -> bool:
        """Whether an image shows a direction by itself; where corners creep it is stated to be hardly known anyway."""
        return parallax_px >= self.settings.baseline_px

    def _full(self, px: FloatArray) -> FloatArray:
        return (px + 0.5) * self._shrink - 0.5

    def _learn_noise(self, pose: RelativePose) -> None:
        # The median of chi2 lies between 0.45 (one degree of freedom) and 1.39 (two): 0.7 is half-way in ratio.
        median = float(np.median(pose.chi2[pose.inliers])) if pose.inliers.any() else 0.7
        if self._has_scale:
            self._sigma_px = min(max(self._sigma_px * math.sqrt(0.9 + 0.1 * median / 0.7), 0.05), 1.0)

    def _take(self, frame: Frame, pyramid: Pyramid) -> None:
        """Keep the image, and follow new corners where the old ones have left."""
        corners = self._corners
        if self._needs_corners(len(corners)):
            self._last_features = extract_features(
                pyramid[: self.features.levels], self.features, previous=self._last_features,
                occupied_px=corners.px, max_corners=self.settings.corners - len(corners),
                candidates=None if self._search is None else self._search.result(),
            )  # fmt: skip
            fresh = self._last_features.px.astype(np.float64)
            # Beyond, the last step shows no parallax: who is there might as well be at infinity.
            farthest = (
                self._sigma_px / self._focal_px / max(float(np.linalg.norm(self._T_cur_prev.t)), self._unit)
            )
            for followed in (corners, *(() if self._other is None else (self._other.corners,))):
                followed.add(fresh, max(followed.typical_inverse_depth(), farthest))
            self._anchor = np.concatenate([self._anchor, self._camera.normalize(fresh)])
            self._strong = np.concatenate([self._strong, np.zeros(len(fresh), dtype=bool)])
        self._search = None
        self._pyramid = pyramid
        self._stamp_ns = frame.stamp_ns

    def _needs_corners(self, followed: int) -> bool:
        return self.settings.corners - followed > self.settings.corners // 10

    def _start(self, frame: Frame, pyramid: Pyramid, reason: str = "first frame") -> VisualEstimate:
        self._corners = TrackedCorners()
        self._anchor = np.empty((0, 2))
        self._strong = np.empty(0, dtype=bool)
        self._take(frame, pyramid)
        nothing = why_nothing_is_seen(pyramid[0], len(self._corners))
        return self._nothing(frame, nothing or reason, len(self._corners), 0)

    def _lost(self, frame: Frame, pyramid: Pyramid, tried: int, matches: int) -> VisualEstimate:
        previous_ns = self._stamp_ns
        self._begin_anew()
        self._take(frame, pyramid)
        reason = why_nothing_is_seen(pyramid[0], len(self._corners)) or (
            f"lost: {matches} of {tried} corners found again (motion blur, dropped frames, or another scene)"
        )
        return self._nothing(frame, reason, tried, matches, previous_ns)

    def _nothing(
        self, frame: Frame, reason: str, corners: int, matches: int, previous_ns: int | None = None
    ) -> VisualEstimate:
        return VisualEstimate(
            stamp_ns=frame.stamp_ns,
            previous_stamp_ns=frame.stamp_ns if previous_ns is None else previous_ns,
            T_prev_cur=SE3.identity(),
            covariance=np.eye(6) * _UNOBSERVED,
            corners=corners,
            matches=matches,
            inliers=0,
            parallax_px=0.0,
            reason=reason,
        )


def _project(points: FloatArray) -> FloatArray:
    return np.asarray(points[:, :2] / np.maximum(points[:, 2:3], 1e-6))
