"""A suite: which recordings, attacks and detectors are measured, read from a TOML file that a user can copy."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, Self, get_args, get_origin

from pydantic import Field, model_validator

from belie.evaluation.config_toml import toml_value
from belie.simulation.scenario import WeatherName
from belie.types import ConfigError, Settings

# What the paper's table has a column for: odometry and position spoofing, obstacle hiding, object misclassification.
Goal = Literal["OS", "PS", "OH", "OM", "other"]


class Drives(Settings):
    """Simulated drives: every scenario in every weather with every seed."""

    scenarios: tuple[str, ...] = Field(description="names of `belie simulate`, or paths to scenario files")
    weathers: tuple[WeatherName, ...] = Field(("sunny",), description="light, rain and fog")
    seeds: tuple[int, ...] = Field(
        (1,), description="of the world: where the robot starts, what stands around"
    )
    sensor_seeds: tuple[int, ...] = Field(
        (), description="of every sensor's errors, on the same pictures; the world's seed if left out"
    )
    duration_s: float = Field(13.0, description="length [s]", gt=0.0, le=3600.0)
    width: int = Field(640, description="image width [px]", ge=64, le=3840)
    height: int = Field(480, description="image height [px]", ge=48, le=2160)
    frame_rate_hz: float = Field(10.0, description="images [Hz]", ge=1.0, le=60.0)
    field_of_view_deg: float | None = Field(
        None, description="horizontal [deg]; the scenario's own (80) if left out", gt=10.0, lt=150.0
    )
    patch: Literal["none", "hide", "relabel"] | None = Field(
        None,
        description="what a printed patch in view does to the simulated detector; the scenario's own if "
        "left out",
    )


# Of `[[real]]`, the streams that it may name.
STREAMS = ("image", "camera_info", "odometry", "position", "imu", "detections")


class Real(Settings):
    """Recordings: with their own claims, or as images with reference poses from which claims are made."""

    paths: tuple[str, ...] = Field(
        description="recordings, as `belie check` reads them; relative ones are sought here, then in BELIE_DATA"
    )
    claims: Literal["recorded", "given", "noisy", "noisy50"] = Field(
        "noisy",
        description="recorded: every stream as it is, detections too. The others make odometry, IMU, localisation and "
        "GNSS from the recording's poses: given: exact odometry; noisy: 1 % off, at "
        "the frame rate; noisy50: at 50 Hz",
    )
    seeds: tuple[int, ...] = Field((0,), description="of the made claims' noise")
    image: str | None = Field(
        None, description="topic, as `belie check --image`; this and all below: recorded only"
    )
    camera_info: str | None = Field(None, description="topic or file, as `belie check --camera-info`")
    odometry: str | None = Field(None, description='topic, or "none"')
    position: str | None = Field(None, description='topic, "none", or "poses" (of a folder)')
    imu: str | None = Field(None, description='topic, or "none"')
    detections: str | None = Field(
        None, description='topic, "none", or a file of detections: sought here, then beside the recording'
    )

    @model_validator(mode="after")
    def _streams_are_recorded(self) -> Self:
        named = [name for name in STREAMS if getattr(self, name) is not None]
        if named and self.claims != "recorded":
            raise ValueError(f'{named[0]} is of a recording\'s own streams: set claims = "recorded"')
        return self


class Attacks(Settings):
    """One family of attacks: each specification at each onset and magnitude."""

    family: str = Field(description="its name in the tables")
    goal: Goal = Field(
        "other",
        description="the paper's goal: odometry or position spoofing, obstacle hiding, object misclassification",
    )
    specs: tuple[str, ...] = Field(
        description="as `belie attack` takes them, without start; {x} stands for the magnitude, {minus_x} "
        "and "
        "{inverse_x} for what is made of it"
    )
    magnitudes: tuple[float, ...] = Field(
        (), description="largest first; a sweep gives the smallest lie found"
    )
    unit: str = Field("", description="of the magnitude")
    ramp: bool = Field(
        False,
        description="whether the magnitude is a growth a second: the table then tells how far it got "
        "unnoticed",
    )
    onsets: tuple[int, ...] = Field((100,), description="first attacked frames")
    lasts: int | None = Field(
        None,
        description="attacked frames; the attack's own if left out (the paper's: 10; others: to the end)",
        ge=1,
    )
    within: int | None = Field(
        None,
        description="frames within which an alert is a hit; to a second after the attack if left out",
        ge=1,
    )
    target: Literal["any", "staying"] = Field(
        "any",
        description="of attacks on objects: as the attack chooses (the largest), or the largest that stays in view "
        "throughout: hiding what leaves anyway is no attack",
    )
    where: tuple[str, ...] = Field((), description="scenarios or recordings it is tried on; all if left out")


class ClosedLoop(Settings):
    """Drives that are steered by the attacked claims, without belie and with it."""

    scenario: str = Field("closed-loop", description="name of `belie simulate`, or path to a scenario file")
    attacks: tuple[str, ...] = Field(("paper-odometry:start=60",), description="on the claims it steers by")
    seeds: tuple[int, ...] = Field((1,), description="of the world")
    duration_s: float = Field(10.0, description="length [s]", gt=0.0)
    width: int = Field(320, description="image width [px]", ge=64)
    height: int = Field(240, description="image height [px]", ge=48)


class Suite(Settings):
    """What `belie bench` runs."""

    title: str = Field(description="one line")
    description: str = Field("", description="what it answers, and how long it takes")
    rivals: tuple[str, ...] = Field(
        ("default", "paper"), description="detectors: names, or module:Class of your own"
    )
    honest: bool = Field(True, description="whether every recording is run unattacked, too")
    objects: bool = Field(
        True, description="whether detections are judged; a suite on motion alone runs faster"
    )
    alone: bool = Field(False, description="whether to use one process only, so that timings mean something")
    drives: tuple[Drives, ...] = ()
    real: tuple[Real, ...] = ()
    attacks: tuple[Attacks, ...] = ()
    closed_loop: ClosedLoop | None = None


_TABLES: dict[str, type[Settings]] = {
    "at the top": Suite, "[[drives]]": Drives, "[[real]]": Real, "[[attacks]]": Attacks, "[closed_loop]": ClosedLoop,
}  # fmt: skip


def shipped_suites() -> tuple[str, ...]:
    """Names of the suites in the package, sorted.

    >>> "quick" in shipped_suites()
    True
    """
    folder = files("belie.evaluation.bench") / "suites"
    return tuple(sorted(e.name.removesuffix(".toml") for e in folder.iterdir() if e.name.endswith(".toml")))


def suite_text(name: str) -> str:
    """The TOML of a shipped suite, to be copied and edited.

    >>> suite_text("quick").startswith("title")
    True
    """
    return (files("belie.evaluation.bench") / "suites" / f"{name}.toml").read_text(encoding="utf-8")


def suite_keys() -> Iterator[tuple[str, list[tuple[str, str, str]]]]:
    """Of every table of a suite its keys: name, value if left out, meaning.

    >>> next(suite_keys())[1][0]
    ('title', 'needed', 'one line')
    """
    for table, model in _TABLES.items():
        keys = [
            (
                name,
                "needed" if field.is_required() else _default(field.default),
                f"{field.description}{_choices(field.annotation)}",
            )
            for name, field in model.model_fields.items()
            if field.description
        ]
        yield table, keys


def commented_keys() -> str:
    """All keys of a suite as comments, to stand below one that is printed.

    >>> commented_keys().splitlines()[:3]
    ['# What a suite may say: key, value if left out, meaning.', '#', '# at the top']
    """
    lines = ["What a suite may say: key, value if left out, meaning."]
    for table, keys in suite_keys():
        lines += ["", table, *(f"  {name} ({default}): {meaning}" for name, default, meaning in keys)]
    return "".join(f"# {line}".rstrip() + "\n" for line in lines)


def _choices(annotation: object) -> str:
    """The words that a key takes, if it takes certain ones only."""
    if get_origin(annotation) is Literal:
        return f"; {', '.join(get_args(annotation))}"
    return "".join(dict.fromkeys(_choices(part) for part in get_args(annotation)))


def _default(value: object) -> str:
    if value is None or value in ("", ()):
        return "–"
    return toml_value(list(value) if isinstance(value, tuple) else value)


def load_suite(path_or_name: str | Path) -> Suite:
    """Read a suite from a file, or one of the package by its name.

    Raises
    ------
    ConfigError
        If there is no such suite, or it holds an unknown key or a value out of range.

    Examples
    --------
    >>> load_suite("quick").rivals[0]
    'default'
    >>> load_suite("quik")
    Traceback (most recent call last):
        ...
    belie.types.errors.ConfigError: no suite quik: did you mean quick? ...
    """
    name = str(path_or_name)
    if name in shipped_suites():
        return parse_suite(tomllib.loads(suite_text(name)), f"suite {name}")
    path = Path(path_or_name)
    if not path.is_file():
        raise ConfigError(_unknown(name))
    try:
        return parse_suite(tomllib.loads(path.read_text(encoding="utf-8")), name)
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"cannot read the suite {path}: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path} is no TOML: {error}") from None


def parse_suite(values: dict[str, Any], origin: str = "suite") -> Suite:
    """Check a suite that came as plain values.

    >>> parse_suite({"title": "mine", "rivalz": []})
    Traceback (most recent call last):
        ...
    belie.types.errors.ConfigError: suite: rivalz: Extra inputs are not permitted
    """
    suite = Suite.checked(values, origin)
    if not suite.drives and not suite.real and suite.closed_loop is None:
        raise ConfigError(f"{origin}: nothing to run: it needs [[drives]], [[real]] or [closed_loop]")
    return suite


def _unknown(name: str) -> str:
    from difflib import get_close_matches

    known = shipped_suites()
    near = get_close_matches(name, known, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"no suite {name}: {hint}known are {', '.join(known)}, or a path to a TOML file"
