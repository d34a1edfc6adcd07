"""Unseen settings: ``python benchmarks/conditions.py`` prints a Markdown table.

Each recording is changed (skipped frames, another resolution, lens, light, blur, mount), its claims made from
the reference poses with realistic noise, and the paper's two attacks tried on it. Asked are no alert on the
honest claims, and at least 90 % of the attacks within 3 frames, or UNDECIDED with the reason.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
from rich.console import Console
from rich.progress import track

from _conditions import CONDITIONS
from _families import FAMILIES
from _recordings import RECORDINGS, VARIANTS, Variant, drive, made_recording
from _trials import FalseAlert, HonestRun, Trial, kept_frames, onsets_of, rate_text
from belie.detector import Config

TARGET = 0.9
ATTACKED = tuple(f for f in FAMILIES if f.name.startswith("paper-") and f.target is not None)
# The noise of a stream is learned in 20 frames; recordings of too few frames thereafter tell nothing.
FIRST_ONSET = 30
_CHECKS = ("odometry", "position", "imu")


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One recording under one condition."""

    condition: str
    recording: str
    variant: Variant
    onsets: int
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What came of it; `trials` by family, `undecided` by check: share of frames, and the reasons."""

    job: Job
    frames: int
    false_alerts: list[FalseAlert]
    trials: dict[str, list[Trial]]
    undecided: dict[str, tuple[float, Counter[str]]]

    def meets(self) -> bool:
        """No alert on honest claims; enough attacks caught, or the reason said why not."""
        return not self.false_alerts and all(
            sum(trial.hit or trial.abstained for trial in trials) >= TARGET * len(trials)
            for trials in self.trials.values()
        )


def run(job: Job) -> Found:
    """The honest run and the attacks of one job."""
    condition = next(c for c in CONDITIONS if c.name == job.condition)
    rng = np.random.default_rng([job.seed, *job.condition.encode()])
    source = drive(job.recording)
    recording = made_recording(condition.change(source, rng), job.variant, job.seed, reference=source)
    families = [family for family in ATTACKED if job.recording in family.recordings]
    onsets = onsets_of(len(recording.joined), FIRST_ONSET, 3, job.onsets)
    honest = HonestRun(recording, Config(), kept_frames(recording, onsets))
    trials: dict[str, list[Trial]] = {}
    for family in families:
        tried = (
            honest.attacked(text, onset, family.within, family.least_m)
            for onset in onsets
            for text in family.texts(onset)
        )
        trials[family.name] = [trial for trial in tried if trial is not None]
    return Found(
        job=job,
        frames=len(recording.joined),
        false_alerts=honest.false_alerts,
        trials=trials,
        undecided={check: honest.undecided(check, FIRST_ONSET) for check in _CHECKS},
    )


def lines(found: Sequence[Found]) -> Iterator[str]:
    """One row a condition and recording; then what was accused wrongly, missed, and not judged."""
    names = [family.name for family in ATTACKED]
    shares = [f"{check} undecided" for check in _CHECKS]
    yield f"| condition | recording | frames | false alerts | {' | '.join((*names, *shares))} | met |"
    yield f"|---|---|---:|---:|{'---:|' * (len(names) + len(shares))}---|"
    for f in found:
        rates = [rate_text(f.trials.get(name, [])) for name in names]
        undecided = [
            "–" if np.isnan(f.undecided[check][0]) else f"{100 * f.undecided[check][0]:.0f} %"
            for check in _CHECKS
        ]
        cells = (
            f.job.condition, f.job.recording, str(f.frames), str(len(f.false_alerts)), *rates, *undecided,
            "yes" if f.meets() else "**no**",
        )  # fmt: skip
        yield f"| {' | '.join(cells)} |"
    yield "\nFalse alerts:\n"
    for f in found:
        for one in f.false_alerts:
            yield f"- {f.job.condition}, {f.job.recording}, frame {one.frame}: {one.alert}: {one.reason}"
    yield "\nMissed, late or taken for another:\n"
    for f in found:
        for trial in (t for trials in f.trials.values() for t in trials if not t.hit):
            delay = "missed" if trial.delay is None else f"at attacked frame {trial.delay + 1}"
            said = "; ".join((delay, *trial.wrong, *sorted(set(trial.undecided))))
            yield f"- {f.job.condition}, {f.job.recording}, {trial.spec}: {said}"
    yield f"\nReasons for UNDECIDED from frame {FIRST_ONSET} on:\n"
    for f in found:
        for check, (_, reasons) in f.undecided.items():
            for reason, count in reasons.most_common(3):
                yield f"- {f.job.condition}, {f.job.recording}, {check}: {count} x {reason}"


def main() -> int:
    """Run, and print; 1 where a condition is not met."""
    names = [condition.name for condition in CONDITIONS]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="4 onsets, kitti00 only")
    parser.add_argument("--recordings", nargs="+", choices=RECORDINGS, default=None)
    parser.add_argument("--conditions", nargs="+", choices=names, default=names)
    parser.add_argument("--variant", choices=list(VARIANTS), default="noisy")
    parser.add_argument("--onsets", type=int, default=None, help="a recording [10]")
    parser.add_argument("--seed", type=int, default=0, help="of the noise")
    parser.add_argument("--jobs", type=int, default=2, help="processes [2]")
    a = parser.parse_args()
    recordings = a.recordings or (["kitti00"] if a.quick else RECORDINGS)
    jobs = [
        Job(
            condition=c,
            recording=r,
            variant=a.variant,
            onsets=a.onsets or (4 if a.quick else 10),
            seed=a.seed,
        )
        for c in a.conditions
        for r in recordings
    ]
    began = time.perf_counter()
    context = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
    console = Console(stderr=True)
    with ProcessPoolExecutor(a.jobs, mp_context=context, initializer=_one_thread) as pool:
        results = pool.map(run, jobs)
        shown = track(results, "runs", len(jobs), console=console, disable=not console.is_terminal)
        found = list(shown)
    print(f"{len(jobs)} runs in {time.perf_counter() - began:.0f} s. Claims: {VARIANTS[a.variant]}\n")
    print("\n".join(lines(found)))
    return int(not all(f.meets() for f in found))


def _one_thread() -> None:
    cv2.setNumThreads(1)


if __name__ == "__main__":
    raise SystemExit(main())
