"""Clean simulated drives of every scene in every weather: does belie stay silent, and how often has it no answer?

python benchmarks/clean_simulated.py --cache /tmp/clean --sensor-seeds 1 2 3

Each scene and weather is rendered once, into a bag of the cache; fresh seeds of the sensors then cost no rendering.
The seed of the world is --world-seed; the first sensor seed equal to it gives what ``belie simulate`` writes.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from belie.detector import Config, Detector
from belie.geometry import SE3, CameraModel
from belie.recordings import open_recording, write_mcap
from belie.simulation.labels import ObjectLabel
from belie.simulation.rendered import Rendered
from belie.simulation.scenario import Scenario, load_scenario
from belie.simulation.sensors.sampling import Motion
from belie.simulation.simulate import SimulatedRecording
from belie.simulation.stage import Stage, build_world
from belie.simulation.truth import objects_line, objects_path, write_objects
from belie.simulation.weather import WEATHERS
from belie.simulation.world import World
from belie.types import Status

SCENARIOS = (
    "street-straight", "street-curve", "street-lane-change", "street-stop-and-go", "highway", "corridor",
    "flight", "patch",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One scenario in one weather, and the seeds of its world and of its sensors."""

    scenario: str
    weather: str
    world_seed: int
    sensor_seed: int
    duration_s: float
    size: tuple[int, int]
    rate_hz: float
    cache: Path

    @property
    def bag(self) -> Path:
        """Where its pictures are kept."""
        width, height = self.size
        named = f"{self.scenario}_{self.weather}_{self.world_seed}_{self.duration_s:g}s"
        return self.cache / f"{named}_{width}x{height}_{self.rate_hz:g}hz.mcap"

    def settings(self, seed: int) -> Scenario:
        """Its scenario under a seed."""
        width, height = self.size
        return load_scenario(
            self.scenario, weather=self.weather, seed=seed, duration_s=self.duration_s, width=width,
            height=height, frame_rate_hz=self.rate_hz,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What came of it: false alerts in words, and how many checked frames stayed undecided, by check and reason."""

    job: Job
    frames: int
    alerts: list[str]
    ran: Counter[str]
    undecided: dict[str, Counter[str]]


class KeptPictures:
    """Pictures and labels of a bag, in the order of its frames: stands in for a renderer."""

    def __init__(self, bag: Path) -> None:
        self._steps = open_recording(bag).steps()
        self._lines = iter(objects_path(bag).read_text(encoding="utf-8").splitlines())

    def render(self, t_s: float, ego: Motion | None = None) -> Rendered:
        """The next picture."""
        gray = next(self._steps).frame.image
        return Rendered(
            bgr=np.asarray(cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR)), gray=gray, depth_m=None, ids=None
        )

    def labels(
        self, world: World, rendered: Rendered, camera: CameraModel, t_s: float, T_world_body: SE3
    ) -> tuple[ObjectLabel, ...]:
        """The labels of the picture that was just shown."""
        return tuple(label_of(entry) for entry in json.loads(next(self._lines))["objects"])


def label_of(entry: Mapping[str, Any]) -> ObjectLabel:
    """The label that a line of the truth tells."""
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


def render(job: Job) -> None:
    """Render into the cache, if it is not there."""
    if job.bag.exists() and objects_path(job.bag).exists():
        return
    lines: list[str] = []
    recording = SimulatedRecording(
        job.settings(job.world_seed), on_view=lambda view: lines.append(objects_line(view))
    )
    partial = job.bag.with_name(f".{job.bag.stem}.partial.mcap")
    partial.unlink(missing_ok=True)
    write_mcap(
        partial, recording.steps(), cameras=recording.cameras, body_axes="flu", image_encoding="jpeg",
        jpeg_quality=95,
    )  # fmt: skip
    write_objects(objects_path(job.bag), lines)
    partial.replace(job.bag)


def replayed(job: Job) -> SimulatedRecording:
    """The pictures of the cache with fresh sensors."""

    def open_stage(scenario: Scenario, world: World) -> AbstractContextManager[Stage]:
        kept = KeptPictures(job.bag)
        return nullcontext(
            Stage(scenario, world, kept, weather=WEATHERS[scenario.weather], labels=kept.labels)
        )

    world = build_world(job.settings(job.world_seed))
    return SimulatedRecording(job.settings(job.sensor_seed), world=world, stage_opener=open_stage)


def check(job: Job) -> Found:
    """Render if need be, and check."""
    from belie.evaluation.trace import without_numbers

    render(job)
    recording = replayed(job)
    detector = Detector(recording.cameras, Config())
    alerts, ran, undecided = list[str](), Counter[str](), dict[str, Counter[str]]()
    for step in recording.steps():
        verdict = detector.update(step.frame, step.claims)
        for result in verdict.checks:
            ran[result.check] += 1
            if result.status is Status.UNDECIDED:
                undecided.setdefault(result.check, Counter())[without_numbers(result.reason)] += 1
        for alert in verdict.alerts:
            why = [r for r in verdict.checks if r.source == alert.source and r.status is Status.CONTRADICTED]
            said = "; ".join(f"{r.reason} ({r.statistic} against {r.threshold} {r.unit})" for r in why)
            alerts.append(f"{alert.type.value} by {alert.source}, frame {verdict.frame}: {said}")
    return Found(job=job, frames=recording.scenario.frame_count, alerts=alerts, ran=ran, undecided=undecided)


def lines(found: Sequence[Found]) -> Iterator[str]:
    """The table; then every false alert, and why checks had no answer."""
    checks = sorted({check for one in found for check in one.ran})
    yield f"| scene | weather | runs | frames | false alerts | {' | '.join(f'{c} undecided' for c in checks)} |"
    yield f"|---|---|---:|---:|---:|{'---:|' * len(checks)}"
    for (scenario, weather), own in grouped(found).items():
        shares = [_share(own, check) for check in checks]
        cells = [
            scenario,
            weather,
            len(own),
            sum(f.frames for f in own),
            sum(len(f.alerts) for f in own),
            *shares,
        ]
        yield f"| {' | '.join(str(cell) for cell in cells)} |"
    total = sum(f.frames / f.job.rate_hz for f in found)
    yield f"\n{len(found)} runs, {total / 3600.0:.2f} h, false alerts {sum(len(f.alerts) for f in found)}\n"
    for f in found:
        for alert in f.alerts:
            yield f"- {f.job.scenario}, {f.job.weather}, sensor seed {f.job.sensor_seed}: {alert}"
    yield "\nReasons for UNDECIDED (check, frames, share of all that stayed undecided):\n"
    reasons = Counter[tuple[str, str]]()
    for f in found:
        for check, counted in f.undecided.items():
            reasons.update({(check, reason): count for reason, count in counted.items()})
    for (check, reason), count in reasons.most_common(25):
        yield f"- {check}: {reason}: {count} ({100 * count / reasons.total():.0f} %)"


def grouped(found: Iterable[Found]) -> dict[tuple[str, str], list[Found]]:
    """By scene and weather."""
    groups: dict[tuple[str, str], list[Found]] = {}
    for one in found:
        groups.setdefault((one.job.scenario, one.job.weather), []).append(one)
    return groups


def _share(found: Sequence[Found], check: str) -> str:
    ran = sum(one.ran[check] for one in found)
    open_ = sum(one.undecided.get(check, Counter()).total() for one in found)
    return f"{100 * open_ / ran:.0f} %" if ran else ""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cache", type=Path, required=True, help="folder of rendered bags")
    parser.add_argument("--sensor-seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--world-seed", type=int, default=1)
    parser.add_argument("--scenarios", nargs="+", default=list(SCENARIOS))
    parser.add_argument("--weathers", nargs="+", default=list(WEATHERS))
    parser.add_argument("--duration", type=float, default=15.0, help="seconds")
    parser.add_argument("--size", type=int, nargs=2, default=(640, 480), help="pixels")
    parser.add_argument("--rate", type=float, default=10.0, help="images [Hz]")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    wanted = parser.parse_args()
    wanted.cache.mkdir(parents=True, exist_ok=True)
    jobs = [
        Job(
            scenario=scenario, weather=weather, world_seed=wanted.world_seed, sensor_seed=seed,
            duration_s=wanted.duration, size=(wanted.size[0], wanted.size[1]), rate_hz=wanted.rate, cache=wanted.cache,
        )
        for scenario, weather, seed in product(wanted.scenarios, wanted.weathers, wanted.sensor_seeds)
    ]  # fmt: skip
    found, began = list[Found](), time.monotonic()
    with ProcessPoolExecutor(wanted.jobs) as pool:
        for one in pool.map(check, jobs):
            found.append(one)
            print(
                f"{time.monotonic() - began:6.0f} s  {one.job.scenario} {one.job.weather} seed {one.job.sensor_seed}: "
                f"{'; '.join(one.alerts) or 'silent'}",
                file=sys.stderr,
                flush=True,
            )
    print("\n".join(lines(found)))


if __name__ == "__main__":
    main()
