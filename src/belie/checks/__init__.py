"""A claim and an estimate to a `CheckResult`; `sequential` adds results up over time."""

from belie.checks.camera import CameraCheck
from belie.checks.camera_settings import CameraSettings
from belie.checks.imu import ImuCheck, ImuSettings
from belie.checks.noise_scale import NoiseScaleSettings
from belie.checks.odometry import OdometryCheck, OdometrySettings
from belie.checks.paper import PaperThresholds
from belie.checks.paper import odometry_check as paper_odometry_check
from belie.checks.paper import position_check as paper_position_check
from belie.checks.position import PositionCheck, PositionSettings
from belie.checks.sequential import SequentialSettings

__all__ = [
    "CameraCheck",
    "CameraSettings",
    "ImuCheck",
    "ImuSettings",
    "NoiseScaleSettings",
    "OdometryCheck",
    "OdometrySettings",
    "PaperThresholds",
    "PositionCheck",
    "PositionSettings",
    "SequentialSettings",
    "paper_odometry_check",
    "paper_position_check",
]
