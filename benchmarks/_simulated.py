"""Simulated drives whose detections are judged again and again: the camera looks at its own motion once a drive.

The pictures are those of `belie bench`, in its cache: what one renders, the other finds.
"""

from __future__ import annotations

import argparse
import copy
from dataclasses import dataclass, replace
from functools import lru_cache

from _recordings import MemoryRecording
from belie.checks.objects import ObjectSettings
from belie.detector import Config
from belie.detector.alerts import AlertBook, Judgement
from belie.detector.default_profile import DefaultProfile
from belie.detector.object_habits import ObjectHabits
from belie.detector.objects import ObjectStage
from belie.detector.paper_profile import PaperProfile
from belie.detector.scene_witness import Scene
from belie.evaluation.bench.cache import CacheSettings
from belie.evaluation.bench.cases import DriveCase, recordings_of
from belie.evaluation.bench.pictures import Pictures
from belie.evaluation.bench.suite import load_suite, parse_suite
from belie.simulation.labels import ObjectLabel
from belie.simulation.stage import CAMERA
from belie.simulation.weather import WEATHERS
from belie.types import (
    Alert,
    AlertType,
    Claim,
    ConfigError,
    DetectionClaim,
    Frame,
    GrayImage,
    Step,
    VisualEstimate,
)

OBJECT_ALERTS = (AlertType.OBSTACLE_HIDING, AlertType.OBJECT_MISCLASSIFICATION, AlertType.OBSTACLE_INJECTION)


def drive_parser(description: str | None, suite: str, scenario: str) -> argparse.ArgumentParser:
    """Flags that tell which drives; by default those of a suite that hold a scenario."""
    drives = next(drives for drives in load_suite(suite).drives if scenario in drives.scenarios)
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add, size = parser.add_argument, (drives.width, drives.height)
    add("--cache", default="", help="folder of rendered pictures; that of `belie bench` if not given")
    add("--cached-only", action="store_true", help="leave out what is not rendered yet")
    add("--scenarios", nargs="+", default=drives.scenarios)
    add("--weathers", nargs="+", default=drives.weathers, choices=list(WEATHERS), metavar="WEATHER")
    add("--world-seeds", type=int, nargs="+", default=drives.seeds)
    add("--sensor-seeds", type=int, nargs="*", default=drives.sensor_seeds, help="if none: the world's")
    add("--duration", type=float, default=drives.duration_s, help="seconds")
    add("--size", type=int, nargs=2, default=size, help="pixels")
    add("--rate", type=float, default=drives.frame_rate_hz, help="images [Hz]")
    add("--profile", default="default", choices=("default", "paper"))
    return parser


def cases_of(parser: argparse.ArgumentParser, wanted: argparse.Namespace) -> list[tuple[DriveCase, Pictures]]:
    """The drives that the flags tell, as a suite with these settings names them, and their pictures."""
    drives = {
        "scenarios": wanted.scenarios, "weathers": wanted.weathers, "seeds": wanted.world_seeds,
        "sensor_seeds": wanted.sensor_seeds, "duration_s": wanted.duration, "width": wanted.size[0],
        "height": wanted.size[1], "frame_rate_hz": wanted.rate,
    }  # fmt: skip
    folder = CacheSettings(folder=wanted.cache).path()
    try:
        cases = recordings_of(parse_suite({"title": "", "drives": [drives]}, "flags"))
    except ConfigError as error:
        parser.error(str(error))
    found = [(c, Pictures(scenario=c.scenario, cache=folder)) for c in cases if isinstance(c, DriveCase)]
    if wanted.cached_only:
        found = [(case, pictures) for case, pictures in found if pictures.is_there]
        if not found:
            parser.error(f"{folder} holds none of these drives: without --cached-only they are rendered")
    return found


@dataclass(frozen=True, slots=True)
class Drive:
    """A rendered drive: pictures, truth, and what the camera said of its own motion and of itself."""

    pictures: Pictures
    labels: tuple[tuple[ObjectLabel, ...], ...]
    sights: tuple[tuple[VisualEstimate | None, Scene | None, str], ...]


class Eavesdropper:
    """Stands in for the object checks, and keeps what they are given besides detections."""

    views = ()

    def __init__(self) -> None:
        self.heard: list[tuple[VisualEstimate | None, Scene | None, str]] = []

    def take(self, claims: tuple[Claim, ...], now_ns: int) -> None:
        """Nothing of interest."""

    def update(
        self,
        frame: Frame,
        estimate: VisualEstimate | None,
        scene: Scene | None,
        *,
        doubted: str = "",
        half: GrayImage | None = None,
    ) -> list[Judgement]:
        """Keep it."""
        self.heard.append((estimate, scene, doubted))
        return []


@lru_cache(maxsize=2)
def drive_of(pictures: Pictures) -> Drive:
    """Render if need be; and let the camera look at its own motion, once."""
    pictures.render()
    recording, steps = pictures.steps()
    (camera,) = recording.cameras.values()
    profile, ear = DefaultProfile(CAMERA, camera, Config()), Eavesdropper()
    profile._objects = ear  # type: ignore[assignment]  # everything else stays as it runs on a robot
    for step in steps:
        profile.update(step.frame, step.claims)
    return Drive(pictures, pictures.labels(), tuple(ear.heard))


def claims_of(
    drive: Drive, sensor_seed: int, profile: str, miss_run: float | None = None, patch: str | None = None
) -> MemoryRecording:
    """What the detector of a seed says of the drive; with the odometry too, where the profile needs it."""
    scenario = drive.pictures.scenario
    changes = {"plain_miss_frames": miss_run, "patch": patch}
    changes = {name: value for name, value in changes.items() if value is not None}
    told = scenario.sensors.object_detector.model_copy(update=changes)
    sensors = scenario.sensors.model_copy(update={"object_detector": told})
    pictures = replace(drive.pictures, scenario=scenario.model_copy(update={"sensors": sensors}))
    recording, steps = pictures.steps(sensor_seed)
    if profile != "paper":
        steps = tuple(
            replace(step, claims=tuple(c for c in step.claims if isinstance(c, DetectionClaim)))
            for step in steps
        )
    return MemoryRecording(name=pictures.bag.stem, cameras=recording.cameras, joined=steps)


class Judge:
    """The object checks of a profile, and the alerts that stand; copied where an attack branches off the clean run."""

    def __init__(
        self, recording: MemoryRecording, drive: Drive, profile: str, objects: ObjectSettings | None = None,
        rate: float = Config().sequential.false_alarms_per_hour,
    ) -> None:  # fmt: skip
        ((name, camera),) = recording.cameras.items()
        config, self._drive = Config(), drive
        self._paper = PaperProfile(name, camera, config) if profile == "paper" else None
        self._settings, self._size = objects or config.objects, (camera.model.width, camera.model.height)
        self._stage = ObjectStage(camera.model, self._settings, config.tracking, rate)
        self._book = AlertBook()

    def __deepcopy__(self, memo: dict[int, object]) -> Judge:
        memo[id(self._drive)] = self._drive
        other = object.__new__(Judge)
        other.__dict__ = copy.deepcopy(self.__dict__, memo)
        return other

    def habits(self) -> list[ObjectHabits]:
        """What was seen of each detector."""
        return list(self._stage.habits().values())

    def doubt(self, name: str) -> str:
        """Why an object's absence means nothing (yet), by its own pixels; empty where it does."""
        for stream in self._stage.streams.values():
            for track in stream.tracks:
                if track.name == name:
                    return track.absence(self._size, self._settings)
        return "no longer followed"

    def look(self, index: int, step: Step) -> tuple[list[Judgement], list[Alert]]:
        """The judgements of a frame and the new alerts about objects."""
        if self._paper is not None:
            judgements = self._paper.update(step.frame, step.claims)
        else:
            estimate, scene, doubted = self._drive.sights[index]
            self._stage.take(step.claims, step.frame.stamp_ns)
            judgements = self._stage.update(step.frame, estimate, scene, doubted=doubted)
        raised = self._book.raise_new(judgements, step.frame.stamp_ns)
        return judgements, [alert for alert in raised if alert.type in OBJECT_ALERTS]
