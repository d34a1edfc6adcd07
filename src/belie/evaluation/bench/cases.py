"""The run matrix of a suite: what is recorded, how it is attacked, and the key by which a finished run is known."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from belie.evaluation.bench.cache import code_key, content_key
from belie.evaluation.bench.suite import Attacks, Drives, Goal, Real, Suite
from belie.simulation.scenario import Scenario, load_scenario
from belie.types import ConfigError

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
    """Real images with claims made from their reference poses."""

    path: Path
    claims: str
    seed: int

    weather = "real"

    @property
    def place(self) -> str:
        """The recording's name."""
        return self.path.name

    @property
    def name(self) -> str:
        """For tables and reports."""
        return f"{self.place} {self.claims} {self.seed}"

    @property
    def key(self) -> str:
        """Names everything that it follows from; the files are taken to stay as they are."""
        stat = self.path.stat() if self.path.exists() else None
        stamp = None if stat is None else stat.st_mtime_ns
        return content_key([str(self.path), stamp, self.claims, self.seed, code_key(("recordings",))])


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
    return [*drives, *(case for group in suite.real for case in _real(group))]


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
            frame_rate_hz=group.frame_rate_hz,
        )  # fmt: skip
        if group.patch is not None:
            detector = scenario.sensors.object_detector.model_copy(update={"patch": group.patch})
            sensors = scenario.sensors.model_copy(update={"object_detector": detector})
            scenario = scenario.model_copy(update={"sensors": sensors})
        for sensor_seed in group.sensor_seeds or (seed,):
            yield DriveCase(
                place=Path(name).stem, scenario=scenario, sensor_seed=sensor_seed, objects=objects
            )


def _real(group: Real) -> Iterator[RealCase]:
    for text, seed in product(group.paths, group.seeds):
        path = Path(text).expanduser()
        if not path.is_absolute():
            folder = os.environ.get("BELIE_DATA")
            path = Path(folder) / path if folder and not path.exists() else path
        if not path.exists():
            raise ConfigError(
                f"{text}: no such recording; set BELIE_DATA to the folder that holds it, or write its "
                f"whole path"
            )
        yield RealCase(path=path, claims=group.claims, seed=seed)
