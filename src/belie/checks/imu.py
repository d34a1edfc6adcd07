"""IMU against the camera: the gyroscope's rate, integrated between two images, against the visual rotation.

    r = log(R_visual' R_gyro)

Systematic errors estimated beside: rotation of the mount and a gain of the visual rotation; a steady bias of the
gyroscope is the running offset of the residual, bounded by the noise settings. Rotation needs no baseline, so the
check works at standstill and for pure rotations too.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from belie.checks.noise_scale import NoiseScaleSettings
from belie.checks.residual_test import ResidualTest
from belie.checks.sequential import Evidence, SequentialSettings
from belie.checks.systematic import SystematicErrors, rotation_correction
from belie.geometry import FloatArray, so3_log
from belie.types import CheckResult, Settings, Status, VisualEstimate

_MOUNT, _GAIN, _BIAS, _CORRECTION = slice(0, 3), 3, slice(4, 7), slice(7, 10)
_PARAMETERS = 10
_AXES = ("pitch (about camera x)", "yaw (about camera y)", "roll (about camera z)")


class ImuSettings(Settings):
    """Noise and systematic errors of an honest gyroscope."""

    rotation_noise_deg: float = Field(
        0.03, gt=0.0,
        description="angle random walk [deg per sqrt(s)]: twice the 0.014 of a Bosch BMI055, for its vibration",
    )  # fmt: skip
    rotation_gain_noise: float = Field(
        0.01,
        ge=0.0,
        description="error of the rotation that grows with it: scale factor [deg per deg turned]",
    )
    clock_jitter_s: float = Field(
        0.0005, ge=0.0, description="standard deviation between the clocks of IMU and camera [s]"
    )
    bias_sigma_deg_s: float = Field(
        1.0, ge=0.0, description="bias at power-on [deg/s]; the BMI055's data sheet"
    )
    bias_walk_deg_s: float = Field(0.005, ge=0.0, description="how the bias wanders [deg/s per sqrt(s)]")
    correction_gain: float = Field(
        0.0125, ge=0.0,
        description="slow errors that a turn leaves behind, in the visual rotation or in an inertial unit that "
        "corrects itself, worked off in `correction_s` [deg/s per deg/s]",
    )  # fmt: skip
    correction_s: float = Field(3.0, gt=0.0, description="how long such an error lasts [s]")
    mount_sigma_deg: float = Field(
        3.0, ge=0.0, description="how askew the camera may sit against its stated mount [deg]"
    )
    gain_sigma: float = Field(
        0.02, ge=0.0, description="relative error of the visual rotation, from the focal length [1]"
    )


class ImuCheck:
    """Judges one gyroscope against the visual rotation.

    Parameters
    ----------
    source : str
        The stream's topic.
    tests : int
        How many residual tests share the stated false-alarm rate.

    Examples
    --------
    >>> from belie.geometry import SE3
    >>> check = ImuCheck("/imu", tests=1)
    >>> seen = VisualEstimate(stamp_ns=10**8, previous_stamp_ns=0, T_prev_cur=SE3.identity(), corners=400,
    ...     covariance=np.eye(6) * 1e-8, matches=400, inliers=400, parallax_px=0.0)
    >>> check.update(seen, np.eye(3)).reason
    'learning the noise of this stream: 19 more frames'
    """

    def __init__(
        self,
        source: str,
        *,
        tests: int,
        settings: ImuSettings | None = None,
        sequential: SequentialSettings | None = None,
        noise: NoiseScaleSettings | None = None,
    ) -> None:
        self.source = source
        self.settings = s = settings or ImuSettings()
        prior = np.radians(
            [s.mount_sigma_deg] * 3 + [np.degrees(s.gain_sigma)] + [s.bias_sigma_deg_s] * 3 + [0.0] * 3
        )
        walk = np.radians([0.0] * 4 + [s.bias_walk_deg_s] * 3 + [0.0] * 3)
        self.test = ResidualTest(
            3,
            SystematicErrors(prior, walk),
            sequential or SequentialSettings(),
            noise or NoiseScaleSettings(),
            tests,
        )
        self.evidence: Evidence | None = None

    def noise_scales(self) -> dict[str, float]:
        """How many times noisier than its model each axis is."""
        return dict(zip(("pitch", "yaw", "roll"), self.test.scales().tolist(), strict=True))

    def update(self, estimate: VisualEstimate, R_prev_cur: FloatArray | None) -> CheckResult:
        """Compare the integrated rotation of the camera ``R_prev_cur``, shape (3, 3), with the visual one."""
        self.evidence = None
        interval_s = (estimate.stamp_ns - estimate.previous_stamp_ns) * 1e-9
        s, R = self.settings, estimate.T_prev_cur.R
        if estimate.inliers > 0 and interval_s > 0.0:
            keep, drive = np.ones(_PARAMETERS), np.zeros(_PARAMETERS)
            keep[_CORRECTION], drive[_CORRECTION] = rotation_correction(
                R, estimate.covariance[3:, 3:], interval_s, s.correction_gain, s.correction_s
            )
            self.test.errors.predict(interval_s, keep, drive)
        if R_prev_cur is None or estimate.inliers == 0 or interval_s <= 0.0:
            reason = (
                estimate.reason if estimate.inliers == 0 and estimate.reason else "no samples for this frame"
            )
            return self._answer(Status.UNDECIDED, reason, None)
        omega = so3_log(R)  # the seen one: a lie must not widen its own margin
        H = np.zeros((3, _PARAMETERS))
        H[:, _MOUNT] = R.T - np.eye(3)
        H[:, _GAIN] = -omega
        H[:, _BIAS] = H[:, _CORRECTION] = np.eye(3) * interval_s
        noise = np.array(estimate.covariance[3:, 3:])
        noise += np.eye(3) * math.radians(s.rotation_noise_deg) ** 2 * interval_s
        noise += (s.rotation_gain_noise**2 + 2.0 * (s.clock_jitter_s / interval_s) ** 2) * np.outer(
            omega, omega
        )
        residual = so3_log(R.T @ R_prev_cur)
        self.evidence = evidence = self.test.update(
            residual, H, noise, estimate.stamp_ns, interval_s, still=estimate.is_still
        )
        floor = f"{math.degrees(float(self.test.floor().max()) / interval_s):.2g} deg/s"
        if evidence.contradicted:
            axis = _AXES[evidence.component]
            reason = f"the gyroscope's rotation differs from the visual one: {axis}"
            return self._answer(Status.CONTRADICTED, reason, floor)
        if self.test.missing_frames > 0:
            reason = f"learning the noise of this stream: {self.test.missing_frames} more frames"
            return self._answer(Status.UNDECIDED, reason, floor)
        return self._answer(Status.CONSISTENT, "gyroscope and visual rotation agree", floor)

    def _answer(self, status: Status, reason: str, floor: str | None) -> CheckResult:
        evidence = self.evidence
        return CheckResult(
            check="imu", source=self.source, status=status, reason=reason, floor=floor,
            unit=evidence.unit if evidence else "llr",
            statistic=evidence.statistic if evidence else None,
            threshold=evidence.threshold if evidence else None,
        )  # fmt: skip
