"""Recordings in memory, with the claims that a robot would make on them: from reference poses, noise added.

The body is x forward, y left, z up (ROS), at the camera. Odometry and localisation share the frame ``odom``;
GNSS is in ENU, turned by an angle that nobody tells, with its noise stated.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from belie.geometry import SE3, CameraModel, FloatArray
from belie.recordings import JoinCounts, JoinSettings, open_recording
from belie.recordings.join import DecodedFrame, join
from belie.types import Claim, Frame, MotionClaim, MountedCamera, PoseClaim, PositionClaim, Step

Variant = Literal["given", "noisy", "noisy50"]
VARIANTS: dict[Variant, str] = {
    "given": "poses as given, at the frame rate",
    "noisy": "odometry noise (1 % white, 0.5 % slow scale bias, 0.01 deg a frame), at the frame rate",
    "noisy50": "the same noise at 50 Hz, off the image stamps, with twist",
}
RECORDINGS = ("kitti00", "kitti06", "handheld")
CAMERA = "/camera/image_raw"
ODOMETRY, IMU, LOCALISATION, GNSS = "/odom", "/imu", "/localization", "/gnss"

# Camera axes (x right, y down, z forward) in the body's.
R_BODY_CAM = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_GRAVITY_M_S2 = 9.81
_GYRO_NOISE_DEG = 0.014  # per sqrt(s): Bosch BMI055
_GYRO_BIAS_DEG_S = (0.2, -0.2, 0.2)
_ENU_YAW_DEG = 35.0
_ENU_ORIGIN_M = (120.0, -45.0, 8.0)
_GNSS_SIGMA_M = 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MemoryRecording:
    """A recording whose images are in memory; what `belie.attacks.attack` takes."""

    name: str
    cameras: dict[str, MountedCamera]
    frames: tuple[Frame, ...]
    claims: tuple[Claim, ...]
    joined: tuple[Step, ...]
    body_axes: Literal["flu", "rdf"] = "flu"

    @classmethod
    def of(
        cls, name: str, camera: MountedCamera, frames: Sequence[Frame], claims: Sequence[Claim]
    ) -> MemoryRecording:
        """Join frames and claims as a recording's reader would, each received when it is stamped."""
        arrivals: list[Claim | DecodedFrame] = [
            *claims,
            *(DecodedFrame(frame=f, index=i) for i, f in enumerate(frames)),
        ]
        arrivals.sort(key=lambda a: a.frame.received_ns if isinstance(a, DecodedFrame) else a.received_ns)
        steps = tuple(join(arrivals, settings=JoinSettings(), counts=JoinCounts()))
        return cls(
            name=name, cameras={CAMERA: camera}, frames=tuple(frames), claims=tuple(claims), joined=steps
        )

    def until(self, frame: int) -> MemoryRecording:
        """The first frames only."""
        return replace(self, joined=self.joined[:frame])

    def frame_stamps_ns(self) -> npt.NDArray[np.int64]:
        """Stamps of all frames, shape (N,)."""
        return np.array([step.frame.stamp_ns for step in self.joined], dtype=np.int64)

    def steps(self) -> Iterator[Step]:
        """The frames with their claims."""
        return iter(self.joined)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """Frames of one camera, and the reference poses ``T_odom_body`` at their stamps."""

    name: str
    camera: MountedCamera
    frames: tuple[Frame, ...]
    poses: tuple[SE3, ...]


def data_folder() -> Path:
    """Where the recordings lie: BELIE_DATA, or ``shared/data`` beside the checkout."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("BELIE_DATA", beside))
    if not folder.is_dir():
        raise SystemExit(f"no recordings at {folder}: set BELIE_DATA to the folder that holds kitti00")
    return folder


@cache
def drive(name: str) -> Drive:
    """One of `RECORDINGS`, read from the disk once."""
    folder = data_folder() / name
    T_body_cam = SE3(R_BODY_CAM, np.zeros(3))
    if name == "handheld":
        model, images, stamps_ns, T_world_cam = _handheld(folder)
        R_odom_world = np.diag([1.0, -1.0, -1.0])  # the board's z points into the desk
    else:
        recording = open_recording(folder)
        ((_, mounted),) = recording.cameras.items()
        model, T_world_cam, images, stamps_ns = mounted.model, [], [], []
        for step in recording.steps():
            images.append(step.frame.image)
            stamps_ns.append(step.frame.stamp_ns)
            T_world_cam += [c.T_odom_body for c in step.claims if isinstance(c, PoseClaim)]
        R_odom_world = R_BODY_CAM
    T_odom_world = SE3(R_odom_world, np.zeros(3))
    return Drive(
        name=name,
        camera=MountedCamera(model=model, T_body_cam=T_body_cam),
        frames=tuple(
            Frame(camera=CAMERA, stamp_ns=t, received_ns=t, image=image)
            for t, image in zip(stamps_ns, images, strict=True)
        ),
        poses=tuple(T_odom_world @ T @ T_body_cam.inverse() for T in T_world_cam),
    )


def _handheld(folder: Path) -> tuple[CameraModel, list[npt.NDArray[np.uint8]], list[int], list[SE3]]:
    K = np.loadtxt(folder / "K.txt")
    files = sorted((folder / "images").glob("*.jpg"))
    images = [np.asarray(cv2.imread(str(file), cv2.IMREAD_GRAYSCALE), dtype=np.uint8) for file in files]
    height, width = images[0].shape
    model = CameraModel(
        width=width, height=height, fx=K[0, 0], fy=K[1, 1], cx=K[0, 2], cy=K[1, 2],
        model="radial_tangential", distortion=(-0.29660776, 0.08081684, 0.0, 0.0),
    )  # fmt: skip
    rows = np.loadtxt(folder / "poses.txt")
    T_world_cam = [SE3(cv2.Rodrigues(row[:3])[0], row[3:]).inverse() for row in rows]
    stamps_ns = [round(i * 1e9 / 30.0) for i in range(len(files))]
    return model, images, stamps_ns, T_world_cam[: len(files)]


def made_recording(
    source: Drive, variant: Variant, seed: int = 0, *, reference: Drive | None = None
) -> MemoryRecording:
    """The drive with odometry as `variant` says, an IMU at 200 Hz, localisation and GNSS at 10 Hz.

    The claims are made from `reference` where it is given: frames may be missing that the odometry has.
    """
    truth = _Path(reference or source)
    rng = np.random.default_rng([seed, *source.name.encode()])
    claims: list[Claim] = [
        *_odometry(truth, variant, rng),
        *_imu(truth, rng),
        *_localisation(truth),
        *_gnss(truth, rng),
    ]
    return MemoryRecording.of(source.name, source.camera, source.frames, claims)


class _Path:
    """Reference poses at any time, by splines through those of the frames."""

    def __init__(self, source: Drive) -> None:
        self.source = source
        self.stamps_ns = np.array([frame.stamp_ns for frame in source.frames])
        seconds = (self.stamps_ns - self.stamps_ns[0]) * 1e-9
        self._t = CubicSpline(seconds, [T.t for T in source.poses])
        self._R = RotationSpline(seconds, Rotation.from_matrix([T.R for T in source.poses]))
        self._acceleration: Callable[[FloatArray], FloatArray] = self._t.derivative(2)
        self._velocity: Callable[[FloatArray], FloatArray] = self._t.derivative(1)

    def stamps(self, rate_hz: float, phase_ns: int) -> npt.NDArray[np.int64]:
        period_ns = 1e9 / rate_hz
        first, last = int(self.stamps_ns[0]) + phase_ns, int(self.stamps_ns[-1])
        return np.asarray(
            first + np.rint(np.arange(int((last - first) / period_ns) + 1) * period_ns), dtype=np.int64
        )

    def _seconds(self, stamps_ns: npt.NDArray[np.int64]) -> FloatArray:
        return np.asarray((stamps_ns - self.stamps_ns[0]) * 1e-9)

    def poses(self, stamps_ns: npt.NDArray[np.int64]) -> list[SE3]:
        s = self._seconds(stamps_ns)
        return [SE3(R, t) for R, t in zip(self._R(s).as_matrix(), self._t(s), strict=True)]

    def rates(self, stamps_ns: npt.NDArray[np.int64]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Angular rate, velocity and specific force in body axes, each (N, 3)."""
        s = self._seconds(stamps_ns)
        R = self._R(s)
        omega = self._R(s, 1)  # SciPy's spline gives it in body axes
        force = self._acceleration(s) + np.array([0.0, 0.0, _GRAVITY_M_S2])
        return (
            np.asarray(omega),
            np.asarray(R.inv().apply(self._velocity(s))),
            np.asarray(R.inv().apply(force)),
        )


def _odometry(truth: _Path, variant: Variant, rng: np.random.Generator) -> Iterator[Claim]:
    stamps_ns = truth.stamps(50.0, 3_700_000) if variant == "noisy50" else truth.stamps_ns
    poses = truth.poses(stamps_ns) if variant == "noisy50" else list(truth.source.poses)
    if variant == "given":
        for stamp_ns, T_odom_body in zip(stamps_ns.tolist(), poses, strict=True):
            yield _pose(stamp_ns, T_odom_body)
        return
    per_frame = (len(stamps_ns) - 1) / (len(truth.stamps_ns) - 1)
    omega, velocity, _ = truth.rates(stamps_ns)
    bias, T_odom_body = 0.005 * rng.standard_normal(), poses[0]
    yield _pose(int(stamps_ns[0]), T_odom_body)
    for i in range(1, len(stamps_ns)):
        interval_s = float(stamps_ns[i] - stamps_ns[i - 1]) * 1e-9
        step = poses[i - 1].inverse() @ poses[i]
        fade = np.exp(-interval_s / 30.0)
        bias = fade * bias + 0.005 * np.sqrt(1.0 - fade**2) * rng.standard_normal()
        # White over the distance of a frame, whatever the rate: the variance of a sample is its share of it.
        shift = 0.01 * float(np.linalg.norm(step.t)) * np.sqrt(per_frame) * rng.standard_normal(3)
        turn = np.radians(0.01) / np.sqrt(per_frame) * rng.standard_normal(3)
        noise = SE3.exp(np.concatenate([shift, turn]))
        T_odom_body = T_odom_body @ SE3(step.R, (1.0 + bias) * step.t) @ noise
        yield _pose(int(stamps_ns[i]), T_odom_body)
        if variant == "noisy50":
            yield MotionClaim(
                source=ODOMETRY, kind="twist", stamp_ns=int(stamps_ns[i]), received_ns=int(stamps_ns[i]),
                linear_m_s=(1.0 + bias) * velocity[i] + shift / interval_s,
                angular_rad_s=omega[i] + turn / interval_s,
            )  # fmt: skip


def _pose(stamp_ns: int, T_odom_body: SE3) -> PoseClaim:
    return PoseClaim(
        source=ODOMETRY, frame_id="odom", stamp_ns=stamp_ns, received_ns=stamp_ns, T_odom_body=T_odom_body
    )


def _imu(truth: _Path, rng: np.random.Generator) -> Iterator[Claim]:
    stamps_ns = truth.stamps(200.0, 1_300_000)
    omega, _, force = truth.rates(stamps_ns)
    sigma = np.radians(_GYRO_NOISE_DEG) * np.sqrt(200.0)
    omega = omega + np.radians(_GYRO_BIAS_DEG_S) + sigma * rng.standard_normal(omega.shape)
    force = force + 0.02 * rng.standard_normal(force.shape)
    for stamp_ns, rate, acceleration in zip(stamps_ns.tolist(), omega, force, strict=True):
        yield MotionClaim(
            source=IMU, kind="imu", stamp_ns=stamp_ns, received_ns=stamp_ns, angular_rad_s=rate,
            acceleration_m_s2=acceleration,
        )  # fmt: skip


def _localisation(truth: _Path) -> Iterator[Claim]:
    stamps_ns = truth.stamps(10.0, 37_000_000)
    for stamp_ns, T_odom_body in zip(stamps_ns.tolist(), truth.poses(stamps_ns), strict=True):
        yield PositionClaim(
            source=LOCALISATION, frame_id="odom", kind="localisation", stamp_ns=stamp_ns,
            received_ns=stamp_ns, position_m=T_odom_body.t,
        )  # fmt: skip


def _gnss(truth: _Path, rng: np.random.Generator) -> Iterator[Claim]:
    stamps_ns = truth.stamps(10.0, 61_000_000)
    R_enu_odom = Rotation.from_euler("z", _ENU_YAW_DEG, degrees=True).as_matrix()
    for stamp_ns, T_odom_body in zip(stamps_ns.tolist(), truth.poses(stamps_ns), strict=True):
        yield PositionClaim(
            source=GNSS, frame_id="enu", kind="gnss", stamp_ns=stamp_ns, received_ns=stamp_ns,
            position_m=R_enu_odom @ T_odom_body.t + _ENU_ORIGIN_M + _GNSS_SIGMA_M * rng.standard_normal(3),
            covariance=_GNSS_SIGMA_M**2 * np.eye(3),
        )  # fmt: skip
