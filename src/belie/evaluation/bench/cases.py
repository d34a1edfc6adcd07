"""The run matrix of a suite: what is recorded, how it is attacked, and the key by which a finished run is known."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from belie.evaluation.bench.cache import code_key, content_key
from belie.evaluation.bench.suite import STREAMS, Attacks, Drives, Goal, Real, Suite
from belie.simulation.scenario import Scenario, load_scenario
from belie.types import ConfigError

RECORDED = "recorded"  # claims as they are in a recording

# What a run's outcome follows from, besides the recording and the rival.
_RUN_CODE = (
    "geometry", "types", "odometry", "checks", "detector", "attacks", "evaluation/score.py", "evaluation/bench",
)  # fmt: skip
_NOT_RUN = ("evaluation/bench/suites",)


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveCase:
    """One simulated drive."""

    place: str
    scenario: Scenario
    sensor_seed: int
    objects: bool

    @property
    def weather(self) -> str:
        """Light, rain and fog."""
        return self.scenario.weather

    @property
    def name(self) -> str:
        """For tables and reports."""
        fresh = "" if self.sensor_seed == self.scenario.seed else f" sensors {self.sensor_seed}"
        return f"{self.place} {self.weather} {self.scenario.seed}{fresh}"

    @property
    def key(self) -> str:
        """Names everything that it follows from."""
        return content_key(
            [self.scenario.model_dump(mode="json"), self.sensor_seed, self.objects, code_key(("simulation",))]
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RealCase:
    """A recording with its own claims, or its images with claims made from its poses.

    Parameters
    ----------
    path : Path
        The recording.
    claims : str
        See `belie.evaluation.bench.suite.Real`.
    seed : int
        Of the made claims' noise.
    streams : tuple of (str, str)
        Of its own streams, those that are named: arguments of `belie.recordings.open_recording`.
    objects : bool
        Whether its own detections are judged.
    """

    path: Path
    claims: str
    seed: int = 0
    streams: tuple[tuple[str, str], ...] = ()
    objects: bool = True

    weather = "real"

    @property
    def place(self) -> str:
        """The recording's name."""
        return self.path.name

    @property
    def name(self) -> str:
        """For tables and reports."""
        return f"{self.place} {self.claims}{'' if self.claims == RECORDED else f' {self.seed}'}"

    @property
    def key(self) -> str:
        """Names everything that it follows from; the files are taken to stay as they are."""
        files = [self.path, *(Path(name) for _, name in self.streams)]
        stamps = [file.stat().st_mtime_ns if file.exists() else None for file in files]
        known = [str(self.path), self.streams, stamps, self.claims, self.seed, self.objects]
        return content_key([*known, code_key(("recordings",))])


RecordingCase = DriveCase | RealCase


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackCase:
    """One attack.

    Parameters
    ----------
    family, goal, unit, within, target
        See `belie.evaluation.bench.suite.Attacks`.
    spec : str
        As `belie.attacks.attack` takes it.
    magnitude : float or None
        Where the family is a sweep.
    onset : int
        First attacked frame.
    """

    family: str
    goal: Goal
    spec: str
    onset: int
    magnitude: float | None = None
    unit: str = ""
    within: int | None = None
    target: str = "any"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunCase:
    """One detector over one recording under one attack, or none."""

    recording: RecordingCase
    attack: AttackCase | None
    rival: str

    @property
    def name(self) -> str:
        """For lists of failures."""
        return f"{self.rival}, {self.recording.name}, {'honest' if self.attack is None else self.attack.spec}"

    def key(self, rival_key: str) -> str:
        """Names everything that its outcome follows from."""
        spec = None if self.attack is None else [self.attack.spec, self.attack.target]
        return content_key([self.recording.key, spec, self.rival, rival_key, code_key(_RUN_CODE, _NOT_RUN)])


def recordings_of(suite: Suite) -> list[RecordingCase]:
    """Every recording of a suite.

    Raises
    ------
    ConfigError
        Where a scenario or a folder of real recordings is missing.
    """
    drives = [case for group in suite.drives for case in _drives(group, objects=suite.objects)]
    return [*drives, *(case for group in suite.real for case in _real(group, objects=suite.objects))]


def attacks_on(recording: RecordingCase, suite: Suite) -> list[AttackCase]:
    """Every attack of a suite that is tried on a recording."""
    groups = [group for group in suite.attacks if not group.where or recording.place in group.where]
    return [case for group in groups for case in attack_cases(group)]


def runs_of(suite: Suite) -> list[tuple[RecordingCase, list[RunCase]]]:
    """The whole matrix, recording by recording; honest runs come first: others recall what was seen in them."""
    matrix = []
    for recording in recordings_of(suite):
        attacks: list[AttackCase | None] = [None] if suite.honest else []
        attacks += attacks_on(recording, suite)
        cases = [RunCase(recording=recording, attack=a, rival=r) for r, a in product(suite.rivals, attacks)]
        matrix.append((recording, cases))
    return matrix


def attack_cases(group: Attacks) -> Iterator[AttackCase]:
    """Each specification at each magnitude and onset.

    >>> lateral = "odometry-offset:axis=y,rate={x}"
    >>> group = Attacks(family="lateral", specs=(lateral,), magnitudes=(0.2, 0.1), onsets=(40,))
    >>> [case.spec for case in attack_cases(group)]
    ['odometry-offset:axis=y,rate=0.2,start=40', 'odometry-offset:axis=y,rate=0.1,start=40']
    """
    magnitudes: tuple[float | None, ...] = group.magnitudes or (None,)
    for magnitude, spec, onset in product(magnitudes, group.specs, group.onsets):
        yield AttackCase(
            family=group.family,
            goal=group.goal,
            spec=_filled(spec, magnitude, onset, group.lasts),
            onset=onset,
            magnitude=magnitude,
            unit=group.unit,
            within=group.within,
            target=group.target,
        )


def _filled(spec: str, x: float | None, onset: int, lasts: int | None) -> str:
    if x is not None:
        values: dict[str, Any] = {
            "x": f"{x:g}",
            "minus_x": f"{-x:g}",
            "inverse_x": f"{1 / x:.6g}" if x else "",
        }
        try:
            spec = spec.format(**values)
        except (KeyError, IndexError, ValueError):
            raise ConfigError(f"{spec}: only {{x}}, {{minus_x}} and {{inverse_x}} are filled in") from None
    stop = "" if lasts is None else f",stop={onset + lasts}"
    return f"{spec}{',' if ':' in spec else ':'}start={onset}{stop}"


def _drives(group: Drives, *, objects: bool) -> Iterator[DriveCase]:
    for name, weather, seed in product(group.scenarios, group.weathers, group.seeds):
        scenario = load_scenario(
            name, weather=weather, seed=seed, duration_s=group.duration_s, width=group.width, height=group.height,
            frame_rate_hz=group.frame_rate_hz, field_of_view_deg=group.field_of_view_deg,
        )  # fmt: skip
        if group.patch is not None:
            detector = scenario.sensors.object_detector.model_copy(update={"patch": group.patch})
            sensors = scenario.sensors.model_copy(update={"object_detector": detector})
            scenario = scenario.model_copy(update={"sensors": sensors})
        for sensor_seed in group.sensor_seeds or (seed,):
            yield DriveCase(
                place=Path(name).stem, scenario=scenario, sensor_seed=sensor_seed, objects=objects
            )


def _real(group: Real, *, objects: bool) -> Iterator[RealCase]:
    own = group.claims == RECORDED
    for text in group.paths:
        path = _found(text, _data_folders())
        if path is None:
            raise ConfigError(
                f"{text}: no such recording; set BELIE_DATA to the folder that holds it, or write its "
                f"whole path"
            )
        streams = tuple((name, _stream(value, path)) for name in STREAMS if (value := getattr(group, name)))
        for seed in (0,) if own else group.seeds:
            yield RealCase(path=path, claims=group.claims, seed=seed, streams=streams, objects=objects)


def _stream(value: str, recording: Path) -> str:
    """A topic as it is; a file by its path, where it lies here, beside the recording, in it or in BELIE_DATA."""
    if value in ("none", "poses") or (value.startswith("/") and not Path(value).is_file()):
        return value
    path = _found(value, [Path(), recording.parent, recording, *_data_folders()])
    if path is not None and path.is_file():
        return str(path)
    if Path(value).suffix:
        raise ConfigError(f"{value}: no such file here or beside {recording}")
    return value


def _data_folders() -> list[Path]:
    folder = os.environ.get("BELIE_DATA")
    return [Path(), *([Path(folder)] if folder else [])]


def _found(text: str, folders: Sequence[Path]) -> Path | None:
    path = Path(text).expanduser()
    return next((folder / path for folder in folders if (folder / path).exists()), None)
