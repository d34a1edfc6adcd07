"""The one public entry: frames and claims in, a verdict for every frame out."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping

import numpy as np

from belie.detector.alerts import AlertBook, Judgement
from belie.detector.config import Config
from belie.detector.default_profile import DefaultProfile
from belie.detector.eyes import Eyes
from belie.detector.object_habits import ObjectHabits
from belie.detector.object_view import ObjectView
from belie.detector.paper_profile import PaperProfile
from belie.geometry import SE3, CameraModel, DistortionModel
from belie.types import (
    CalibrationError,
    Claim,
    Frame,
    MotionClaim,
    MountedCamera,
    PoseClaim,
    PositionClaim,
    Status,
    Verdict,
    VisualEstimate,
)


class Detector:
    """Checks what a robot claims against what its camera sees.

    Parameters
    ----------
    cameras : mapping of str to MountedCamera
        The camera to judge by, keyed by the name that its frames carry.
    config : Config
        All settings.
    eyes : Eyes, optional
        Sees the camera's motion instead of a fresh `VisualOdometry`: for whoever checks many claims against the same
        images, and need not look at them again. The `paper` profile sees by the claims, and takes none.

    Raises
    ------
    ValueError
        If there is not exactly one camera, or eyes are given to the `paper` profile.

    Examples
    --------
    >>> model = CameraModel(width=160, height=120, fx=100, fy=100, cx=79.5, cy=59.5)
    >>> detector = Detector({"/image": MountedCamera(model=model, T_body_cam=SE3.identity())})
    >>> frame = Frame(camera="/image", stamp_ns=0, received_ns=0, image=np.full((120, 160), 90, np.uint8))
    >>> detector.update(frame, []).status.value
    'undecided'
    """

    def __init__(
        self,
        cameras: Mapping[str, MountedCamera],
        config: Config | None = None,
        *,
        eyes: Eyes | None = None,
    ) -> None:
        if len(cameras) != 1:
            raise ValueError(f"one camera is judged by, got {len(cameras)}: {sorted(cameras)}")
        self.config = config or Config()
        ((self._name, self._camera),) = cameras.items()
        _warm_up(self.config)
        self._profile = _profile(self._name, self._camera, self.config, eyes)
        self._alerts = AlertBook()
        self._frames = 0
        self._last_ns: int | None = None
        self._looked_at: tuple[Frame, float] | None = None

    @property
    def estimate(self) -> VisualEstimate | None:
        """What the images said at the last frame; None where the image was not usable."""
        return self._profile.estimate

    @property
    def T_odom_cam_claimed(self) -> SE3 | None:
        """Claimed pose of the camera at the last frame."""
        return self._profile.T_odom_cam_claimed

    @property
    def T_odom_cam_seen(self) -> SE3 | None:
        """Pose of the camera as the images tell it, from the first claimed pose on, in the claim's scale."""
        return self._profile.T_odom_cam_seen

    @property
    def objects(self) -> tuple[ObjectView, ...]:
        """The objects that detectors told of, as they stand after the last frame; made when asked for."""
        return self._profile.objects

    def object_habits(self) -> dict[str, ObjectHabits]:
        """How each object detector was seen to err, by source; empty in the `paper` profile."""
        return self._profile.object_habits()

    def noise_scales(self) -> dict[str, dict[str, float]]:
        """How many times noisier than its model each component of each stream is, keyed ``check:source``."""
        return self._profile.noise_scales()

    def look(self, frame: Frame) -> None:
        """Look at a frame before its claims are there: the greater part of the work, of which no claim is needed.

        `update` must follow with the same frame, and answers as without this; nothing is done when it is asked for
        again, nor in the `paper` profile, which sees by the claims.

        Raises
        ------
        CalibrationError, ValueError
            As `update`.

        Examples
        --------
        >>> model = CameraModel(width=160, height=120, fx=100, fy=100, cx=79.5, cy=59.5)
        >>> detector = Detector({"/image": MountedCamera(model=model, T_body_cam=SE3.identity())})
        >>> frame = Frame(camera="/image", stamp_ns=0, received_ns=0, image=np.full((120, 160), 90, np.uint8))
        >>> detector.look(frame)
        >>> detector.update(frame, []).frame
        0
        """
        self._check(frame)
        if self._looked_at is None and isinstance(self._profile, DefaultProfile):
            began = time.perf_counter()
            self._profile.look(frame)
            self._looked_at = frame, (time.perf_counter() - began) * 1e3

    def update(self, frame: Frame, claims: Iterable[Claim]) -> Verdict:
        """Judge every claim at one frame.

        Where this raises (an iterator of claims may, too), the frame can be judged again, or left for a later one.

        Parameters
        ----------
        frame : Frame
            Its stamp must be later than the last one's.
        claims : iterable of Claim
            Those that came since the last frame, in any order; see `Step`.

        Raises
        ------
        CalibrationError
            If the image is not of the camera's size.
        ValueError
            If the frame is another camera's, not later than the last one, or not the one that was looked at.
        """
        began = time.perf_counter()
        self._check(frame)
        looked_ms = 0.0
        if self._looked_at is not None:
            _, looked_ms = self._looked_at
            self._looked_at = None
        judgements = self._profile.update(frame, claims)
        alerts = self._alerts.raise_new(judgements, frame.stamp_ns)
        verdict = Verdict(
            frame=self._frames,
            stamp_ns=frame.stamp_ns,
            status=_overall(judgements),
            latency_ms=looked_ms + (time.perf_counter() - began) * 1e3,
            checks=tuple(judgement.result for judgement in judgements),
            alerts=alerts,
        )
        self._frames += 1
        self._last_ns = frame.stamp_ns
        return verdict

    def _check(self, frame: Frame) -> None:
        model = self._camera.model
        if self._looked_at is not None and self._looked_at[0] is not frame:
            raise ValueError(
                f"the frame that was looked at, {self._looked_at[0].stamp_ns} ns, must be judged first"
            )
        if frame.camera != self._name:
            raise ValueError(f"a frame of {frame.camera!r}, but the camera is {self._name!r}")
        if frame.image.shape != (model.height, model.width):
            height, width = frame.image.shape
            raise CalibrationError(
                f"{frame.camera}: the image is {width}x{height}, its calibration is for {model.width}x{model.height}"
            )
        if self._last_ns is not None and frame.stamp_ns <= self._last_ns:
            raise ValueError(
                f"frame stamped {frame.stamp_ns} ns is not later than the last, {self._last_ns} ns"
            )


def _profile(
    name: str, camera: MountedCamera, config: Config, eyes: Eyes | None = None
) -> DefaultProfile | PaperProfile:
    if config.profile == "default":
        return DefaultProfile(name, camera, config, eyes=eyes)
    if eyes is not None:
        raise ValueError("the paper profile sees by the claims: it takes no eyes")
    return PaperProfile(name, camera, config)


def _overall(judgements: list[Judgement]) -> Status:
    """Contradicted if any check is; undecided if any is, or if nothing was judged; else consistent.

    Where boxes cannot be looked behind (the camera stands, no ground in view), their check says so, but this takes
    nothing from what the others have found: it is the rule for a robot at rest, and no doubt about any claim.
    """
    statuses = {
        judgement.result.status
        for judgement in judgements
        if judgement.result.check != "injection" or judgement.result.status is not Status.UNDECIDED
    }
    if Status.CONTRADICTED in statuses:
        return Status.CONTRADICTED
    judged = [j for j in judgements if j.result.check not in ("camera", "injection")]
    return Status.UNDECIDED if Status.UNDECIDED in statuses or not judged else Status.CONSISTENT


def _warm_up(config: Config) -> None:
    """Run a short drive past a wall, so that every kernel is compiled before the first frame."""
    lenses: tuple[tuple[DistortionModel, tuple[float, ...]], ...] = (
        ("pinhole", ()),
        ("radial_tangential", (0.01, 0.0, 0.0, 0.0)),
    )
    rng = np.random.default_rng(0)
    wall = np.kron(rng.integers(0, 256, (40, 60)), np.ones((8, 8))).astype(np.uint8)
    for name, distortion in lenses:
        model = CameraModel(
            width=320, height=240, fx=200, fy=200, cx=159.5, cy=119.5, model=name, distortion=distortion
        )
        profile = _profile("", MountedCamera(model=model, T_body_cam=SE3.identity()), config)
        if isinstance(profile, PaperProfile):
            profile.odometry.warm_up()
        for i in range(6):
            ns = i * 10**8
            T_odom_body = SE3.from_translation([0.18 * i, 0.0, 0.0])
            claims: list[Claim] = [
                PoseClaim(
                    source="/odom", frame_id="odom", T_odom_body=T_odom_body, stamp_ns=ns, received_ns=ns
                ),
                MotionClaim(
                    source="/imu", kind="imu", angular_rad_s=np.zeros(3), stamp_ns=ns, received_ns=ns
                ),
                PositionClaim(
                    source="/fix",
                    frame_id="odom",
                    kind="gnss",
                    position_m=T_odom_body.t,
                    stamp_ns=ns,
                    received_ns=ns,
                ),
            ]
            image = np.ascontiguousarray(wall[:240, 6 * i : 6 * i + 320])
            profile.update(Frame(camera="", image=image, stamp_ns=ns, received_ns=ns), claims)
