"""Attacks on object detections in simulated drives of every scene and weather: Markdown tables.

python benchmarks/objects_simulated.py --cache /tmp/clean --sensor-seeds 1 2 3

The pictures are those of `clean_simulated.py` (rendered once, into the cache); the camera's own motion is estimated
once a drive. Each sensor seed is a detector of its own, with the habits of `docs/simulated-sensors.md`; its objects are
hidden or renamed one at a time for two seconds, at drawn onsets. An object is attacked where the truth shows it plainly
(24 px or more, at most 30 % hidden, in view) and the detector held it in the second before: in fog that a detector
cannot see through it flickers, and that is no attack. A hit is an alert of the right type that names the object while
the attack lasts. ``--miss-run 4.1`` gives the detector gaps of that many messages for objects in plain view, too;
``--calibrated 101`` learns its habits first, from a clean run of another seed, as ``belie calibrate`` does.
"""

from __future__ import annotations

import argparse
import copy
import json
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from itertools import product
from pathlib import Path

import numpy as np

from _recordings import MemoryRecording
from belie.attacks import attack
from belie.checks.objects import ObjectSettings
from belie.detector import Config
from belie.detector.alerts import AlertBook, Judgement
from belie.detector.default_profile import DefaultProfile
from belie.detector.objects import ObjectStage
from belie.detector.paper_profile import PaperProfile
from belie.detector.scene_witness import Scene
from belie.evaluation.intervals import wilson_interval
from belie.geometry import SE3, CameraModel, box_iou
from belie.recordings import open_recording
from belie.simulation.labels import ObjectLabel
from belie.simulation.rendered import Rendered
from belie.simulation.scenario import Scenario
from belie.simulation.sensors.sampling import Motion
from belie.simulation.simulate import SimulatedRecording
from belie.simulation.stage import CAMERA, Stage, build_world
from belie.simulation.truth import objects_path
from belie.simulation.weather import WEATHERS
from belie.simulation.world import World
from belie.types import (
    Alert,
    AlertType,
    Claim,
    DetectionClaim,
    Frame,
    GrayImage,
    Status,
    Step,
    VisualEstimate,
)
from clean_simulated import SCENARIOS, Job, label_of, render

LEAST_PX = 24.0
LONG = 20  # frames that an attack lasts
BEFORE = 10  # frames in which the object must have been held
KINDS = ("hide", "relabel:to=bird", "relabel:to=person")
OBJECT_ALERTS = (AlertType.OBSTACLE_HIDING, AlertType.OBJECT_MISCLASSIFICATION, AlertType.OBSTACLE_INJECTION)


class Kept:
    """Pictures and true labels of a drive in memory, in the order of its frames: stands in for a renderer."""

    def __init__(self, images: Sequence[GrayImage], labels: Sequence[tuple[ObjectLabel, ...]]) -> None:
        self._images, self._labels = iter(images), iter(labels)

    def render(self, t_s: float, ego: Motion | None = None) -> Rendered:
        """The next picture."""
        gray = next(self._images)
        return Rendered(bgr=np.empty((0, 0, 3), np.uint8), gray=gray, depth_m=None, ids=None)

    def labels(
        self, world: World, rendered: Rendered, camera: CameraModel, t_s: float, T_world_body: SE3
    ) -> tuple[ObjectLabel, ...]:
        """The labels of the picture that was just shown."""
        return next(self._labels)


@dataclass(frozen=True, slots=True)
class Drive:
    """A rendered drive: pictures, truth, and what the camera said of its own motion and of itself."""

    images: tuple[GrayImage, ...]
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


def simulated(
    job: Job,
    images: Sequence[GrayImage],
    labels: Sequence[tuple[ObjectLabel, ...]],
    miss_run: float | None,
    patch: str | None = None,
) -> SimulatedRecording:
    """The drive with the sensors of the job's seed."""

    def open_stage(scenario: Scenario, world: World) -> AbstractContextManager[Stage]:
        kept = Kept(images, labels)
        return nullcontext(
            Stage(scenario, world, kept, weather=WEATHERS[scenario.weather], labels=kept.labels)
        )

    scenario = job.settings(job.sensor_seed)
    changes = {"plain_miss_frames": miss_run, "patch": patch}
    changes = {name: value for name, value in changes.items() if value is not None}
    if changes:
        told = scenario.sensors.object_detector.model_copy(update=changes)
        sensors = scenario.sensors.model_copy(update={"object_detector": told})
        scenario = scenario.model_copy(update={"sensors": sensors})
    return SimulatedRecording(
        scenario, world=build_world(job.settings(job.world_seed)), stage_opener=open_stage
    )


@lru_cache(maxsize=2)
def drive_of(bag_job: Job) -> Drive:
    """Render if need be; read; and let the camera look at its own motion, once."""
    render(bag_job)
    images = tuple(step.frame.image for step in open_recording(bag_job.bag).steps())
    lines = objects_path(bag_job.bag).read_text(encoding="utf-8").splitlines()
    labels = tuple(tuple(label_of(entry) for entry in json.loads(line)["objects"]) for line in lines)
    recording = simulated(bag_job, images, labels, None)
    (camera,) = recording.cameras.values()
    profile, ear = DefaultProfile(CAMERA, camera, Config()), Eavesdropper()
    profile._objects = ear  # type: ignore[assignment]  # everything else stays as it runs on a robot
    for step in recording.steps():
        profile.update(step.frame, step.claims)
    return Drive(images, labels, tuple(ear.heard))


def claims_of(
    job: Job, drive: Drive, profile: str, miss_run: float | None, patch: str | None = None
) -> MemoryRecording:
    """What the detector of a seed says of the drive; with the odometry too, where the profile needs it."""
    recording = simulated(job, drive.images, drive.labels, miss_run, patch)
    everything = profile == "paper"
    steps = tuple(
        Step(
            frame=step.frame,
            claims=tuple(c for c in step.claims if everything or isinstance(c, DetectionClaim)),
        )
        for step in recording.steps()
    )
    return MemoryRecording(name=job.bag.stem, cameras=recording.cameras, joined=steps)


@dataclass(slots=True)
class Target:
    """An object that may be attacked from a frame on: its truth, and the name that the detector gives it then."""

    actor: int
    frame: int
    name: str
    label: str
    side_px: float


def targets(drive: Drive, recording: MemoryRecording, long: int) -> list[Target]:
    """Every object at every frame from which on it is plainly there, and was held by the detector."""
    told: list[dict[int, str]] = []  # by frame: actor to track id
    for labels, step in zip(drive.labels, recording.joined, strict=True):
        claim = next((c for c in step.claims if isinstance(c, DetectionClaim)), None)
        named: dict[int, str] = {}
        for o in labels:
            near = [
                (box_iou(o.box_px, d.box_px), d.track_id)
                for d in (claim.detections if claim else ())
                if d.box_px is not None
            ]
            overlap, name = max(near, default=(0.0, ""))
            if overlap > 0.5:
                named[o.id] = name
        told.append(named)
    plain = [
        {o.id: o for o in labels if o.visible >= 0.7 and o.truncation <= 0.15 and _side(o) >= LEAST_PX}
        for labels in drive.labels
    ]
    found: list[Target] = []
    for k in range(BEFORE, len(plain) - long + 1):
        for actor, o in plain[k].items():
            held = sum(actor in told[i] for i in range(k - BEFORE, k))
            # Under another id it would be told of in spite of the attack.
            would = sum(told[i].get(actor) == told[k].get(actor) for i in range(k, k + long))
            same = all(
                told[i].get(actor, told[k].get(actor)) == told[k].get(actor) for i in range(k, k + long)
            )
            if (
                held >= 0.5 * BEFORE and would >= 0.5 * long and same and actor in told[k]
                and all(actor in plain[i] for i in range(k - BEFORE, k + long))
            ):  # fmt: skip
                found.append(Target(actor, k, told[k][actor], o.label, _side(o)))
    return found


def _side(o: ObjectLabel) -> float:
    return float((o.box_px[2:] - o.box_px[:2]).max())


class Judge:
    """The object checks of a profile, and the alerts that stand; copied where an attack branches off the clean run."""

    def __init__(
        self, recording: MemoryRecording, drive: Drive, profile: str, objects: ObjectSettings | None = None,
        rate: float = Config().sequential.false_alarms_per_hour,
    ) -> None:  # fmt: skip
        ((name, camera),) = recording.cameras.items()
        config, self._drive = Config(), drive
        self._paper = PaperProfile(name, camera, config) if profile == "paper" else None
        self._stage = ObjectStage(camera.model, objects or config.objects, config.tracking, rate)
        self._book = AlertBook()

    def __deepcopy__(self, memo: dict[int, object]) -> Judge:
        memo[id(self._drive)] = self._drive
        other = object.__new__(Judge)
        other.__dict__ = copy.deepcopy(self.__dict__, memo)
        return other

    def habits(self) -> list[dict[str, float]]:
        """What was learned of each detector."""
        return list(self._stage.habits().values())

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


@dataclass(slots=True)
class Trial:
    """One attack: frames until the alert (None: never), and what was answered while it lasted."""

    kind: str
    spec: str
    side_px: float
    delay: int | None
    wrong: list[str]
    undecided: Counter[str] = field(default_factory=Counter)
    frames: int = LONG


@dataclass(slots=True)
class Found:
    """What one seed on one drive gave."""

    job: Job
    frames: int = 0
    false: list[str] = field(default_factory=list)
    trials: list[Trial] = field(default_factory=list)
    objects: int = 0
    undecided: Counter[str] = field(default_factory=Counter)


def run(
    job: Job, attacks: int, long: int, profile: str, miss_run: float | None, teachers: Sequence[int]
) -> Found:
    """A clean run of a seed, and attacks that branch off it."""
    drive = drive_of(_bag_job(job))
    recording = claims_of(job, drive, profile, miss_run)
    settings = calibrated(job, drive, teachers, miss_run) if teachers else None
    found, judge = Found(job=job, frames=len(recording.joined)), Judge(recording, drive, profile, settings)
    chosen = choose(targets(drive, recording, long), attacks, job)
    found.objects = len({target.actor for _, target in chosen})
    for index, step in enumerate(recording.joined):
        for kind, target in chosen:
            if target.frame == index:
                found.trials.append(attacked(recording, copy.deepcopy(judge), kind, target, long))
        judgements, alerts = judge.look(index, step)
        for a in alerts:
            why = [j.result.reason for j in judgements if j.result.object == a.object]
            found.false.append(f"frame {index}: {a.type.value} of {a.object}: {why[0]}")
        for j in judgements:
            if j.result.status is Status.UNDECIDED and j.result.check != "injection":
                found.undecided[f"{j.result.check}: {_plain(j.result.reason)}"] += 1
    return found


def calibrated(job: Job, drive: Drive, seeds: Sequence[int], miss_run: float | None) -> ObjectSettings:
    """Settings as ``belie calibrate`` learns them, from clean runs of other seeds on the same pictures."""
    learnt: list[dict[str, float]] = []
    for seed in seeds:
        recording = claims_of(replace(job, sensor_seed=seed), drive, "default", miss_run)
        judge = Judge(recording, drive, "default", rate=1e-300)
        for index, step in enumerate(recording.joined):
            judge.look(index, step)
        learnt += judge.habits()
    found = {name: max(h[name] for h in learnt) for name in ("miss_rate", "confusion_rate", "persistence_s")}
    return Config().objects.model_copy(update=found)


def choose(fit: Sequence[Target], attacks: int, job: Job) -> list[tuple[str, Target]]:
    """Attacks: every object as likely as any other, however long it is in view."""
    rng = np.random.default_rng([job.sensor_seed, job.world_seed, len(job.bag.name)])
    actors, chosen = sorted({t.actor for t in fit}), []
    for n in range(attacks if fit else 0):
        actor = rng.choice(actors)
        target = fit[int(rng.choice([i for i, t in enumerate(fit) if t.actor == actor]))]
        kind = KINDS[n % len(KINDS)]
        if target.label in ("pedestrian", "person", "cyclist") and kind.endswith("person"):
            kind = "relabel:to=bird"
        chosen.append((kind, target))
    return chosen


def attacked(recording: MemoryRecording, judge: Judge, kind: str, target: Target, long: int) -> Trial:
    """One attack, watched from its onset until it is found or over."""
    spec = f"detections-{kind}{',' if ':' in kind else ':'}object={target.name}"
    spec += f",start={target.frame},stop={target.frame + long}"
    trial = Trial(kind.split(":", maxsplit=1)[0], spec, target.side_px, None, [], frames=long)
    wanted = AlertType.OBSTACLE_HIDING if trial.kind == "hide" else AlertType.OBJECT_MISCLASSIFICATION
    check = "hiding" if trial.kind == "hide" else "misclassification"
    for index, step in enumerate(attack(recording, spec).steps()):
        if index < target.frame:
            continue
        judgements, alerts = judge.look(index, step)
        for a in alerts:
            if a.type is wanted and a.object == target.name:
                trial.delay = index - target.frame
            else:
                trial.wrong.append(f"{a.type.value} of {a.object} at {index}")
        if trial.delay is not None or index >= target.frame + long:
            break
        for j in judgements:
            if j.result.check == check and j.result.status is Status.UNDECIDED:
                trial.undecided[_plain(j.result.reason)] += 1
    return trial


def _plain(reason: str) -> str:
    return "".join("#" if c.isdigit() else c for c in reason).split(" is missing: ")[-1]


def _bag_job(job: Job) -> Job:
    return Job(
        scenario=job.scenario, weather=job.weather, world_seed=job.world_seed, sensor_seed=job.world_seed,
        duration_s=job.duration_s, size=job.size, rate_hz=job.rate_hz, cache=job.cache,
    )  # fmt: skip


def lines(found: Sequence[Found], within: int, show: bool) -> Iterator[str]:
    """The tables."""
    yield "| scene | weather | clean runs | false alerts | hidden | in 5 | renamed | in 5 | undecided | missed |"
    yield "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|"
    groups: dict[tuple[str, str], list[Found]] = defaultdict(list)
    for one in found:
        groups[one.job.scenario, one.job.weather].append(one)
    for (scenario, weather), own in groups.items():
        yield f"| {scenario} | {weather} | {_cells(own, within)} |"
    clear = [one for one in found if one.job.weather != "heavy-fog"]
    heavy = [one for one in found if one.job.weather == "heavy-fog"]
    for name, own in (("all but heavy fog", clear), ("heavy fog", heavy)):
        if own:
            yield f"| **all scenes** | **{name}** | {_cells(own, within)} |"
    hours = sum(one.frames / one.job.rate_hz for one in found) / 3600.0
    yield f"\n{len(found)} clean runs, {hours:.2f} h, {sum(len(one.false) for one in found)} false alerts"
    for one in found:
        for text in one.false:
            yield f"- {_name(one.job)}: {text}"
    for kind in ("hide", "relabel"):
        trials = [t for one in clear for t in one.trials if t.kind == kind]
        low, high = wilson_interval(sum(t.delay is not None for t in trials), len(trials)) or (0.0, 1.0)
        delays = Counter(t.delay for t in trials if t.delay is not None)
        share = f"{100 * low:.1f} to {100 * high:.1f} %"
        yield f"\n{kind}, not in heavy fog: {share}; frames to the alert: {dict(sorted(delays.items()))}"
        for low_px, high_px in ((24, 32), (32, 48), (48, 96), (96, 10_000)):
            part = [t for t in trials if low_px <= t.side_px < high_px]
            yield f"- {low_px} to {high_px} px: {sum(t.delay is not None for t in part)}/{len(part)}"
    if show:
        yield "\nNot found:\n"
        for one in found:
            for t in one.trials:
                if t.delay is None:
                    why = "; ".join(f"{n} x {reason}" for reason, n in t.undecided.most_common(3))
                    wrong = "; ".join(t.wrong)
                    yield f"- {_name(one.job)}: {t.spec}, {t.side_px:.0f} px: {why or 'no doubt'} {wrong}"


def _cells(own: Sequence[Found], within: int) -> str:
    cells = [str(len(own)), str(sum(len(one.false) for one in own))]
    trials = [t for one in own for t in one.trials]
    for kind in ("hide", "relabel"):
        some = [t for t in trials if t.kind == kind]
        cells += [f"{sum(t.delay is not None for t in some)}/{len(some)}"]
        cells += [f"{sum(t.delay is not None and t.delay < within for t in some)}"]
    missed = [t for t in trials if t.delay is None]
    undecided = sum(_is_undecided(t) for t in missed)
    return " | ".join([*cells, str(undecided), str(len(missed) - undecided)])


def _is_undecided(trial: Trial) -> bool:
    return trial.undecided.total() >= 0.5 * trial.frames


def _name(job: Job) -> str:
    return f"{job.scenario}, {job.weather}, sensor seed {job.sensor_seed}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cache", type=Path, required=True, help="folder of rendered bags")
    parser.add_argument("--sensor-seeds", type=int, nargs="+", default=[1, 2, 3, 4])
    parser.add_argument("--attacks", type=int, default=6, help="attacks on each seed")
    parser.add_argument("--long", type=int, default=LONG, help="frames that an attack lasts")
    parser.add_argument("--world-seed", type=int, default=1)
    parser.add_argument("--scenarios", nargs="+", default=[s for s in SCENARIOS if s != "patch"])
    parser.add_argument("--weathers", nargs="+", default=list(WEATHERS))
    parser.add_argument("--duration", type=float, default=15.0, help="seconds")
    parser.add_argument("--size", type=int, nargs=2, default=(640, 480), help="pixels")
    parser.add_argument("--rate", type=float, default=10.0, help="images [Hz]")
    parser.add_argument("--profile", default="default", choices=("default", "paper"))
    parser.add_argument("--miss-run", type=float, help="mean gap in plain view [messages]")
    parser.add_argument(
        "--calibrated", type=int, nargs="+", default=[], help="sensor seeds to learn habits from first"
    )
    parser.add_argument("--cached-only", action="store_true", help="leave out what is not rendered yet")
    parser.add_argument("--misses", action="store_true", help="list what was not found")
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
    if wanted.cached_only:
        jobs = [job for job in jobs if job.bag.exists() and objects_path(job.bag).exists()]
    once = partial(
        run,
        attacks=wanted.attacks,
        long=wanted.long,
        profile=wanted.profile,
        miss_run=wanted.miss_run,
        teachers=wanted.calibrated,
    )
    found = []
    with ProcessPoolExecutor(wanted.jobs) as pool:
        for one in pool.map(once, jobs, chunksize=len(wanted.sensor_seeds)):
            found.append(one)
            missed = [f"{t.spec} ({t.side_px:.0f} px)" for t in one.trials if t.delay is None]
            told = "; ".join([*one.false, *missed])
            print(f"{_name(one.job)}, {len(one.trials)} attacks: {told or 'as should be'}", file=sys.stderr)
    print("\n".join(lines(found, 5, wanted.misses)))


if __name__ == "__main__":
    main()
