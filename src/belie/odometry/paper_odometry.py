"""Section III-B of the paper, stage by stage: the conductor of the `paper` profile.

Faithful to the letter, weaknesses included: the claimed poses build the map and predict its motion, the
nearest corner is the match, and the error is read after the optimiser. It is the baseline that the
`default` profile is measured against.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field

from belie.geometry import SE3, FloatArray
from belie.odometry.features import FeatureSettings, extract_features, image_pyramid
from belie.odometry.local_map import LocalMap, LocalMapSettings
from belie.odometry.matching import MatchingSettings, match_nearest
from belie.odometry.optimization import OptimizationSettings, OptimizedPose, optimize_pose
from belie.odometry.prediction import constant_velocity, predict
from belie.types import Features, Frame, GrayImage, MapPoints, MountedCamera, Settings, VisualEstimate

_UNKNOWN = 1e6 * np.eye(6)


class PaperOdometrySettings(Settings):
    """All stages of the paper's global consistency model.

    >>> PaperOdometrySettings().matching.window_px
    15.0
    """

    features: FeatureSettings = FeatureSettings()
    local_map: LocalMapSettings = LocalMapSettings()
    matching: MatchingSettings = MatchingSettings()
    optimization: OptimizationSettings = OptimizationSettings()
    min_corners: int = Field(
        50, ge=3, description="Corners below which the image is too poor to judge by [count]."
    )
    min_pairs: int = Field(30, ge=3, description="Pairs below which the mean error says nothing [count].")
    min_local_pairs: int = Field(
        5, ge=4, description="The same for one object: a pose absorbs all that three pairs can tell [count]."
    )


class PaperOdometry:
    """Frames and claimed poses in, the mean error ``e^G`` of equation (6) out.

    Parameters
    ----------
    camera : MountedCamera
    settings : PaperOdometrySettings or None

    Examples
    --------
    >>> from belie.geometry import CameraModel
    >>> model = CameraModel(width=320, height=240, fx=200, fy=200, cx=159.5, cy=119.5)
    >>> odometry = PaperOdometry(MountedCamera(model=model, T_body_cam=SE3.identity()))
    >>> frame = Frame(camera="/image", stamp_ns=0, received_ns=0, image=np.zeros((240, 320), np.uint8))
    >>> odometry.update(frame, SE3.identity()).reason
    '0 corners in the image, 50 needed: too dark, blank, blurred or foggy'
    """

    def __init__(self, camera: MountedCamera, settings: PaperOdometrySettings | None = None) -> None:
        self._camera = camera.model
        self._settings = settings or PaperOdometrySettings()
        self._scale_factor = self._settings.features.scale_factor
        self._map = LocalMap(self._camera, self._settings.local_map, self._scale_factor)
        self._claims: list[tuple[int, SE3]] = []  # the last two frames', oldest first
        self.pyramid: tuple[GrayImage, ...] = ()  # of the last frame: the local check shares them
        self.features: Features | None = None
        self._previous_stamp_ns: int | None = None

    def update(self, frame: Frame, T_odom_cam_claimed: SE3 | None) -> VisualEstimate:
        """Equations (2) to (6) for one frame.

        Parameters
        ----------
        frame : Frame
            Its stamp must be later than the last one's.
        T_odom_cam_claimed : SE3 or None
            The pose that the odometry claims at the frame's stamp; None if it claims none.

        Returns
        -------
        VisualEstimate
            With `error_px2` and the pairs; or with `reason`. ``T_prev_cur`` leads from the *claimed*
            pose of the frame before to the pose that fits this image best.

        Raises
        ------
        ValueError
            If the stamp is not later than the last one, or the image is not of the camera's size.
        """
        self._check(frame)
        pyramid = image_pyramid(frame.image, self._settings.features)
        features = extract_features(pyramid, self._settings.features, previous=self.features)  # (2)
        estimate = self._estimate(frame.stamp_ns, features, self._map.points)  # (4) to (6)
        if T_odom_cam_claimed is None:
            self._claims.clear()
        else:
            self._map.observe(frame.stamp_ns, pyramid, features, T_odom_cam_claimed)  # (3), for the next
            self._claims = [*self._claims[-1:], (frame.stamp_ns, T_odom_cam_claimed)]
        self.pyramid, self.features, self._previous_stamp_ns = pyramid, features, frame.stamp_ns
        return estimate

    def warm_up(self) -> None:
        """Compile every kernel, so that no live frame waits for the compiler."""
        model = self._camera
        rng = np.random.default_rng(0)
        noise = np.kron(
            rng.integers(0, 256, (model.height // 12 + 1, model.width // 12 + 1)), np.ones((12, 12))
        )
        image = noise[: model.height, : model.width].astype(np.uint8)
        camera = MountedCamera(model=model, T_body_cam=SE3.identity())
        rehearsal = PaperOdometry(camera, self._settings)
        for i in range(4):
            frame = Frame(camera="", stamp_ns=i, received_ns=i, image=np.roll(image, 6 * i, axis=1))
            # A fronto-parallel wall 6 m away, passed sideways.
            T_odom_cam = SE3.from_translation([-36.0 * i / model.fx, 0.0, 0.0])
            rehearsal.update(frame, T_odom_cam)
        pose = SE3.identity()
        points = rng.uniform([-1, -1, 4], [1, 1, 6], (8, 3))
        optimize_pose(model, pose, points, model.project(points), np.ones(8), self._settings.optimization)

    def _check(self, frame: Frame) -> None:
        height, width = frame.image.shape
        if (width, height) != (self._camera.width, self._camera.height):
            raise ValueError(
                f"image is {width}x{height}, the camera {self._camera.width}x{self._camera.height}"
            )
        if self._previous_stamp_ns is not None and frame.stamp_ns <= self._previous_stamp_ns:
            raise ValueError(f"stamp {frame.stamp_ns} is not later than {self._previous_stamp_ns}")

    def _estimate(self, stamp_ns: int, features: Features, points: MapPoints) -> VisualEstimate:
        need, pairs_needed = self._settings.min_corners, self._settings.min_pairs
        if len(features) < need:
            reason = f"{len(features)} corners in the image, {need} needed: too dark, blank, blurred or foggy"
            return self._silent(stamp_ns, features, 0, reason)
        if len(self._claims) < 2:
            return self._silent(stamp_ns, features, 0, "no motion claimed yet: two claimed poses are needed")
        (before_ns, T_odom_before), (last_ns, T_odom_prev) = self._claims
        ratio = (stamp_ns - last_ns) / (last_ns - before_ns)
        T_odom_predicted = constant_velocity(T_odom_before, T_odom_prev, ratio)  # (4)
        prediction = predict(self._camera, T_odom_predicted, points, self._scale_factor)  # (5)
        pairs = match_nearest(prediction, features, self._settings.matching, self._scale_factor)  # (6), Ψ
        if len(pairs) < pairs_needed:
            reason = (
                f"{len(pairs)} of {len(points)} map points found, {pairs_needed} needed: no baseline or lost"
            )
            return self._silent(stamp_ns, features, len(pairs), reason)
        points_m = points.position_m[prediction.index[pairs.predicted]]
        observed_px = features.px[pairs.observed]
        sigma_px = self._scale_factor ** features.level[pairs.observed].astype(np.float64)
        optimum = optimize_pose(  # (6), Θ
            self._camera, T_odom_predicted, points_m, observed_px, sigma_px, self._settings.optimization
        )
        inlier = optimum.chi2 <= self._settings.optimization.inlier_chi2
        return VisualEstimate(
            stamp_ns=stamp_ns,
            previous_stamp_ns=last_ns,
            T_prev_cur=T_odom_prev.inverse() @ optimum.T_odom_cam,
            covariance=optimum.covariance,
            corners=len(features),
            matches=len(pairs),
            inliers=int(inlier.sum()),
            parallax_px=self._parallax_px(
                optimum, T_odom_prev, points_m[inlier], optimum.predicted_px[inlier]
            ),
            error_px2=optimum.error_px2,
            predicted_px=optimum.predicted_px,
            observed_px=observed_px.astype(np.float64),
        )

    def _parallax_px(
        self, optimum: OptimizedPose, T_odom_prev: SE3, points_m: FloatArray, predicted_px: FloatArray
    ) -> float:
        # Seen from where the camera was, but turned as it is now: what differs is parallax.
        T_cam_odom = SE3(optimum.T_odom_cam.R, T_odom_prev.t).inverse()
        points = T_cam_odom.apply(points_m)
        ahead = points[:, 2] > 0.0
        if not ahead.any():
            return 0.0
        moved = self._camera.project(points[ahead]) - predicted_px[ahead]
        return float(np.median(np.hypot(moved[:, 0], moved[:, 1])))

    def _silent(self, stamp_ns: int, features: Features, pairs: int, reason: str) -> VisualEstimate:
        return VisualEstimate(
            stamp_ns=stamp_ns,
            previous_stamp_ns=stamp_ns if self._previous_stamp_ns is None else self._previous_stamp_ns,
            T_prev_cur=SE3.identity(),
            covariance=_UNKNOWN,
            corners=len(features),
            matches=pairs,
            inliers=0,
            parallax_px=0.0,
            reason=reason,
        )
