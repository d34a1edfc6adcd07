"""Attacks on objects of simulated drives: which are tried, and what came of them; see `objects_simulated.py`."""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from _recordings import MemoryRecording
from _simulated import Drive, Judge, claims_of, drive_of
from belie.attacks import attack
from belie.checks.objects import ObjectSettings
from belie.detector import Config
from belie.detector.object_habits import ObjectHabits
from belie.evaluation.bench.cases import DriveCase
from belie.evaluation.bench.pictures import Pictures
from belie.evaluation.calibrate_habits import fitted
from belie.geometry import box_iou
from belie.simulation.labels import ObjectLabel
from belie.types import AlertType, DetectionClaim, Status

LONG = 20  # frames that an attack lasts
_LEAST_PX = 24.0
_BEFORE = 10  # frames in which the object must have been held
_KINDS = ("hide", "relabel:to=bird", "relabel:to=person")


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
        {o.id: o for o in labels if o.visible >= 0.7 and o.truncation <= 0.15 and _side(o) >= _LEAST_PX}
        for labels in drive.labels
    ]
    found: list[Target] = []
    for k in range(_BEFORE, len(plain) - long + 1):
        for actor, o in plain[k].items():
            held = sum(actor in told[i] for i in range(k - _BEFORE, k))
            # Under another id it would be told of in spite of the attack.
            would = sum(told[i].get(actor) == told[k].get(actor) for i in range(k, k + long))
            same = all(
                told[i].get(actor, told[k].get(actor)) == told[k].get(actor) for i in range(k, k + long)
            )
            if (
                held >= 0.5 * _BEFORE and would >= 0.5 * long and same and actor in told[k]
                and all(actor in plain[i] for i in range(k - _BEFORE, k + long))
            ):  # fmt: skip
                found.append(Target(actor, k, told[k][actor], o.label, _side(o)))
    return found


def _side(o: ObjectLabel) -> float:
    return float((o.box_px[2:] - o.box_px[:2]).max())


@dataclass(slots=True)
class Trial:
    """One attack: frames until the alert (None: never), and what was answered while it lasted."""

    kind: str
    spec: str
    side_px: float
    delay: int | None
    wrong: list[str]
    undecided: int = 0  # frames
    doubts: Counter[str] = field(default_factory=Counter)  # about the object itself, by frame
    frames: int = LONG


@dataclass(slots=True)
class Found:
    """What one seed on one drive gave."""

    case: DriveCase
    frames: int = 0
    false: list[str] = field(default_factory=list)
    trials: list[Trial] = field(default_factory=list)
    objects: int = 0
    undecided: Counter[str] = field(default_factory=Counter)


def run(
    one: tuple[DriveCase, Pictures],
    attacks: int,
    long: int,
    profile: str,
    miss_run: float | None,
    teachers: Sequence[int],
) -> Found:
    """A clean run of a seed, and attacks that branch off it."""
    case, pictures = one
    drive = drive_of(pictures)
    recording = claims_of(drive, case.sensor_seed, profile, miss_run)
    settings = calibrated(drive, teachers, miss_run) if teachers else None
    found, judge = Found(case=case, frames=len(recording.joined)), Judge(recording, drive, profile, settings)
    chosen = choose(targets(drive, recording, long), attacks, case)
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


def calibrated(drive: Drive, seeds: Sequence[int], miss_run: float | None) -> ObjectSettings:
    """Settings as ``belie calibrate`` learns them, from clean runs of other seeds on the same pictures."""
    seen: list[ObjectHabits] = []
    for seed in seeds:
        recording = claims_of(drive, seed, "default", miss_run)
        judge = Judge(recording, drive, "default", rate=1e-300)
        for index, step in enumerate(recording.joined):
            judge.look(index, step)
        seen += judge.habits()
    settings = Config().objects
    return settings.model_copy(update=fitted(seen, settings))


def choose(fit: Sequence[Target], attacks: int, case: DriveCase) -> list[tuple[str, Target]]:
    """Attacks: every object as likely as any other, however long it is in view."""
    s = case.scenario
    # Seeded as the tables in docs/objects.md were drawn: by the length of a file's name, too.
    name = (
        f"{case.place}_{s.weather}_{s.seed}_{s.duration_s:g}s_{s.width}x{s.height}_{s.frame_rate_hz:g}hz.mcap"
    )
    rng = np.random.default_rng([case.sensor_seed, s.seed, len(name)])
    actors, chosen = sorted({t.actor for t in fit}), []
    for n in range(attacks if fit else 0):
        actor = rng.choice(actors)
        target = fit[int(rng.choice([i for i, t in enumerate(fit) if t.actor == actor]))]
        kind = _KINDS[n % len(_KINDS)]
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
        trial.undecided += any(
            j.result.check == check and j.result.status is Status.UNDECIDED for j in judgements
        )
        trial.doubts[_plain(judge.doubt(target.name)) or "its detector's own habit"] += 1
    return trial


def _plain(reason: str) -> str:
    return "".join("#" if c.isdigit() else c for c in reason).split(" is missing: ")[-1]
