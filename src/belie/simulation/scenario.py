"""A scenario: everything that a simulated recording follows from, read from a TOML file that a user can copy."""

from __future__ import annotations

import math
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

from belie.geometry import CameraModel
from belie.simulation.sensors import (
    Arrival,
    GnssSettings,
    ImuSettings,
    LocalisationSettings,
    ObjectDetectorSettings,
    WheelOdometrySettings,
)
from belie.types import ConfigError, Settings

SceneName = Literal["street", "corridor", "flight", "patch"]
WeatherName = Literal["sunny", "light-rain", "night", "rainy-night", "light-fog", "heavy-fog", "low-sun"]

# k1 k2 p1 p2 of a wide lens for machine vision: about 4 % barrel at the corners of a 90 deg image.
_DISTORTION = (-0.12, 0.03, 0.0005, -0.0003)


class SensorSettings(Settings):
    """The sensors on board; a rate of 0 leaves one out.

    GNSS and localisation both claim a position, and ``belie check`` takes one of them: with both on board it asks for
    ``--position``.

    >>> SensorSettings().imu.rate_hz
    200.0
    """

    camera_arrival: Arrival = Arrival(delay_ms=30.0, jitter_ms=4.0)
    imu: ImuSettings = ImuSettings()
    wheel_odometry: WheelOdometrySettings = WheelOdometrySettings()
    gnss: GnssSettings = GnssSettings()
    localisation: LocalisationSettings = LocalisationSettings(rate_hz=0.0)
    object_detector: ObjectDetectorSettings = ObjectDetectorSettings()


class Scenario(Settings):
    """One simulated drive.

    Examples
    --------
    >>> scenario = load_scenario("street-straight")
    >>> scenario.scene, scenario.camera_model().cx
    ('street', 639.5)
    """

    scene: SceneName = Field("street", description="the world: street, corridor, flight or patch")
    manoeuvre: str = Field(
        "straight",
        description="how the robot moves: straight, curve, lane-change, stop-and-go, narrow or highway on a "
        "street; others have their own",
    )
    weather: WeatherName = Field("sunny", description="light, rain and fog")
    seed: int = Field(1, description="of the world and of every error: the same seed, the same bytes", ge=0)
    duration_s: float = Field(15.0, description="length of the recording [s]", gt=0.0, le=3600.0)
    width: int = Field(1280, description="image width [px]", ge=64, le=3840)
    height: int = Field(720, description="image height [px]", ge=48, le=2160)
    frame_rate_hz: float = Field(20.0, description="images [Hz]", ge=1.0, le=60.0)
    field_of_view_deg: float = Field(
        80.0, description="horizontal; 80 deg is a common wide front camera [deg]", gt=10.0, lt=150.0
    )
    distortion: bool = Field(False, description="whether the lens bends straight lines")
    rolling_shutter: bool = Field(False, description="whether rows are exposed one after another")
    sensors: SensorSettings = SensorSettings()

    @property
    def frame_count(self) -> int:
        """Number of images: the first at 0 s, the last before the end.

        >>> Scenario(duration_s=1.0, frame_rate_hz=10).frame_count
        10
        """
        return max(1, math.floor(self.duration_s * self.frame_rate_hz + 1e-6))

    def camera_model(self) -> CameraModel:
        """The camera, with square pixels and its principal point in the middle."""
        focal_px = 0.5 * self.width / math.tan(math.radians(0.5 * self.field_of_view_deg))
        return CameraModel(
            width=self.width,
            height=self.height,
            fx=focal_px,
            fy=focal_px,
            cx=0.5 * self.width - 0.5,
            cy=0.5 * self.height - 0.5,
            model="radial_tangential" if self.distortion else "pinhole",
            distortion=_DISTORTION if self.distortion else (),
        )


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the scenarios in the package, sorted.

    >>> "street-straight" in shipped_scenarios()
    True
    """
    folder = files("belie.simulation") / "scenarios"
    return tuple(sorted(e.name.removesuffix(".toml") for e in folder.iterdir() if e.name.endswith(".toml")))


def load_scenario(path_or_name: str | Path, **overrides: Any) -> Scenario:
    """Read a scenario from a file, or one of the package by its name.

    Parameters
    ----------
    path_or_name : path or str
        A TOML file, or one of `shipped_scenarios`.
    **overrides
        Fields of `Scenario` to replace; None leaves the file's.

    Raises
    ------
    ConfigError
        If there is no such scenario, or it holds an unknown key or a value out of range.

    Examples
    --------
    >>> load_scenario("street-straight", seed=7).seed
    7
    >>> load_scenario("street-straigt")
    Traceback (most recent call last):
        ...
    belie.types.errors.ConfigError: no scenario street-straigt: did you mean street-straight? ...
    """
    values = _values(path_or_name)
    values.update({name: value for name, value in overrides.items() if value is not None})
    try:
        return Scenario.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        what = "no such setting; --print lists all" if first["type"] == "extra_forbidden" else first["msg"]
        raise ConfigError(f"scenario {path_or_name}: {where}: {what}") from None


def scenario_text(name: str) -> str:
    """The TOML of a shipped scenario, to be copied and edited.

    >>> scenario_text("street-straight").splitlines()[-1]
    'manoeuvre = "straight"'
    """
    return (files("belie.simulation") / "scenarios" / f"{name}.toml").read_text(encoding="utf-8")


def _values(path_or_name: str | Path) -> dict[str, Any]:
    path = Path(path_or_name)
    if str(path_or_name) in shipped_scenarios():
        return tomllib.loads(scenario_text(str(path_or_name)))
    if not path.is_file():
        raise ConfigError(_unknown(str(path_or_name)))
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"cannot read the scenario {path}: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path} is no TOML: {error}") from None


def _unknown(name: str) -> str:
    from difflib import get_close_matches

    known = shipped_scenarios()
    near = get_close_matches(name, known, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"no scenario {name}: {hint}known are {', '.join(known)}, or a path to a TOML file"
