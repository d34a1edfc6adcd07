"""The claims that a robot would make on a drive whose poses are known: made from these, with the noise of real streams.

The body is x forward, y left, z up (ROS). Odometry and localisation share the frame ``odom``; GNSS is in ENU, turned by
an angle that nobody tells, with its noise stated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from belie.evaluation.bench.memory import MemoryRecording
from belie.geometry import SE3, FloatArray
from belie.types import Claim, Frame, MotionClaim, MountedCamera, PoseClaim, PositionClaim

Variant = Literal["given", "noisy", "noisy50"]
VARIANTS: dict[Variant, str] = {
    "given": "poses as given, at the frame rate",
    "noisy": "odometry noise (1 % white, 0.5 % slow scale bias, 0.01 deg a frame), at the frame rate",
    "noisy50": "the same noise at 50 Hz, off the image stamps, with twist",
}
CAMERA = "/camera/image_raw"
ODOMETRY, IMU, LOCALISATION, GNSS = "/odom", "/imu", "/localization", "/gnss"

_GRAVITY_M_S2 = 9.81
_GYRO_NOISE_DEG = 0.014  # per sqrt(s): Bosch BMI055
_GYRO_BIAS_DEG_S = (0.2, -0.2, 0.2)
_ENU_YAW_DEG = 35.0
_ENU_ORIGIN_M = (120.0, -45.0, 8.0)
_GNSS_SIGMA_M = 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """Frames of one camera, and the reference poses ``T_odom_body`` at their stamps."""

    name: str
    camera: MountedCamera
    frames: tuple[Frame, ...]
    poses: tuple[SE3, ...]


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
