"""Pictures that are rendered once: kept as a bag with their true objects, and played again under fresh sensors."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from belie.evaluation.bench.cache import code_key, content_key, touch
from belie.geometry import SE3, CameraModel
from belie.recordings import open_recording, write_mcap
from belie.simulation.labels import ObjectLabel
from belie.simulation.rendered import Rendered
from belie.simulation.scenario import Scenario
from belie.simulation.sensors.sampling import Motion
from belie.simulation.simulate import SimulatedRecording
from belie.simulation.stage import Stage, View, build_world
from belie.simulation.truth import objects_line, objects_path, write_objects
from belie.simulation.weather import WEATHERS
from belie.simulation.world import World
from belie.types import Step

_JPEG_QUALITY = 95
# Of a scenario, what its pictures do not depend on.
_NOT_SEEN = ("sensors",)
_RENDERER, _NOT_RENDERER = ("simulation", "geometry"), ("simulation/sensors", "simulation/scenarios")


@dataclass(frozen=True, slots=True, kw_only=True)
class Pictures:
    """The pictures of a scenario in a cache; `scenario.seed` is the world's."""

    scenario: Scenario
    cache: Path

    @property
    def key(self) -> str:
        """Names everything that the pictures follow from: the scenario without its sensors, and the renderer's code."""
        seen = self.scenario.model_dump(mode="json", exclude=set(_NOT_SEEN))
        return content_key([seen, code_key(_RENDERER, _NOT_RENDERER)])

    @property
    def bag(self) -> Path:
        """Where they are."""
        s = self.scenario
        return self.cache / f"{s.scene}-{s.manoeuvre}-{s.weather}-{s.seed}-{self.key}.mcap"

    @property
    def is_there(self) -> bool:
        """Whether they were rendered already."""
        return self.bag.exists() and objects_path(self.bag).exists()

    def render(self, on_frame: Callable[[], None] | None = None) -> None:
        """Render them, if they are not there; where another process is at it, wait for that one.

        Raises
        ------
        MissingExtraError
            Without ``moderngl``.
        """
        if self.is_there:
            touch(self.bag, objects_path(self.bag))
            return
        self.cache.mkdir(parents=True, exist_ok=True)
        with _locked(self.cache / f".{self.bag.stem}.lock"):
            if not self.is_there:
                self._render(on_frame)

    def _render(self, on_frame: Callable[[], None] | None) -> None:
        lines: list[str] = []

        def note(view: View) -> None:
            lines.append(objects_line(view))
            if on_frame is not None:
                on_frame()

        recording = SimulatedRecording(self.scenario, on_view=note)
        partial = self.cache / f".{self.bag.stem}.{os.getpid()}.mcap"
        try:
            write_mcap(
                partial,
                (Step(frame=step.frame) for step in recording.steps()),
                cameras=recording.cameras,
                body_axes="flu",
                image_encoding="jpeg",
                jpeg_quality=_JPEG_QUALITY,
            )
            write_objects(objects_path(self.bag), lines)
            partial.replace(self.bag)
        finally:
            partial.unlink(missing_ok=True)

    def labels(self) -> tuple[tuple[ObjectLabel, ...], ...]:
        """The true objects in view, frame by frame."""
        lines = objects_path(self.bag).read_text(encoding="utf-8").splitlines()
        return tuple(tuple(_label(entry) for entry in json.loads(line)["objects"]) for line in lines)

    def steps(self, sensor_seed: int | None = None) -> tuple[SimulatedRecording, tuple[Step, ...]]:
        """The drive before these pictures, and its steps, with the sensors under a seed of their own.

        `decode_ms` is what the kept pictures took to decode.
        """
        seed = self.scenario.seed if sensor_seed is None else sensor_seed
        kept = KeptPictures(self)

        def open_stage(scenario: Scenario, world: World) -> AbstractContextManager[Stage]:
            weather = WEATHERS[scenario.weather]
            return nullcontext(Stage(scenario, world, kept, weather=weather, labels=kept.labels))

        world = build_world(self.scenario)
        drive = SimulatedRecording(
            self.scenario.model_copy(update={"seed": seed}), world=world, stage_opener=open_stage
        )
        steps = list(drive.steps())
        timed = zip(steps, kept.decode_ms, strict=True)
        return drive, tuple(replace(step, decode_ms=decode_ms) for step, decode_ms in timed)


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold a lock that ends with the process, however it ends."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
    path.unlink(missing_ok=True)


class KeptPictures:
    """Pictures and labels that were kept, in the order of their frames: stands in for a renderer."""

    def __init__(self, pictures: Pictures) -> None:
        self._frames, self._labels = _frames(pictures.bag), iter(pictures.labels())
        self.decode_ms: list[float] = []

    def render(self, t_s: float, ego: Motion | None = None) -> Rendered:
        """The next picture."""
        step = next(self._frames)
        self.decode_ms.append(step.decode_ms)
        gray = step.frame.image
        bgr = np.asarray(cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR))
        return Rendered(bgr=bgr, gray=gray, depth_m=None, ids=None)

    def labels(
        self, world: World, rendered: Rendered, camera: CameraModel, t_s: float, T_world_body: SE3
    ) -> tuple[ObjectLabel, ...]:
        """The labels of the picture that was just shown."""
        return next(self._labels)


def _frames(bag: Path) -> Iterator[Step]:
    steps: Any = open_recording(bag, odometry="none", imu="none", position="none", detections="none").steps()
    with closing(steps):
        yield from steps


def _label(entry: Mapping[str, Any]) -> ObjectLabel:
    length, width, height = entry["dimensions_m"]
    return ObjectLabel(
        id=entry["id"],
        label=entry["label"],
        box_px=np.array(entry["box_px"]),
        visible=entry["visible"],
        truncation=entry["truncation"],
        distance_m=entry["distance_m"],
        T_cam_obj=SE3.from_quat_xyzw(np.array(entry["quat_cam_xyzw"]), np.array(entry["position_cam_m"])),
        dimensions_m=(length, width, height),
    )
