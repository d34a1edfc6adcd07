"""Every setting of the detector in one tree; each default stands beside the stage that it belongs to."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from belie.checks import (
    CameraSettings,
    ImuSettings,
    NoiseScaleSettings,
    OdometrySettings,
    PaperThresholds,
    PositionSettings,
    SequentialSettings,
)
from belie.checks.objects import ObjectSettings
from belie.detector.streams import StreamSettings
from belie.odometry import PaperOdometrySettings, TrackingSettings, VisualOdometrySettings
from belie.types import ConfigError, Settings


class Config(Settings):
    """Settings of `Detector`; ``belie config`` prints them with their meaning.

    Examples
    --------
    >>> Config().sequential.false_alarms_per_hour
    0.1
    """

    profile: Literal["default", "paper"] = Field(
        "default", description="`default` is what a robot should run; `paper` is the paper to the letter"
    )
    sequential: SequentialSettings = SequentialSettings()
    noise: NoiseScaleSettings = NoiseScaleSettings()
    visual_odometry: VisualOdometrySettings = VisualOdometrySettings()
    tracking: TrackingSettings = TrackingSettings()
    streams: StreamSettings = StreamSettings()
    odometry: OdometrySettings = OdometrySettings()
    imu: ImuSettings = ImuSettings()
    position: PositionSettings = PositionSettings()
    camera: CameraSettings = CameraSettings()
    objects: ObjectSettings = ObjectSettings()
    paper: PaperThresholds = PaperThresholds()
    paper_odometry: PaperOdometrySettings = PaperOdometrySettings()


def parse_config(values: dict[str, Any], origin: str = "configuration") -> Config:
    """Check settings that came as plain values.

    Raises
    ------
    ConfigError
        On an unknown key or a value out of range; the line names the key.

    Examples
    --------
    >>> parse_config({"sequential": {"false_alarm_per_hour": 1}})
    Traceback (most recent call last):
        ...
    belie.types.errors.ConfigError: configuration: sequential.false_alarm_per_hour: Extra inputs are not permitted
    """
    return Config.checked(values, origin)


def load_config(path: str | Path) -> Config:
    """Read settings from a TOML file; what it leaves out keeps its default.

    Raises
    ------
    ConfigError
        If the file is missing, no TOML, or holds an unknown key.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"cannot read the configuration {path}: {error}") from None
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path} is no TOML: {error}") from None
    return parse_config(values, str(path))
