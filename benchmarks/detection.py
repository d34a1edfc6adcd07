"""Detection by family of attacks: ``python benchmarks/detection.py`` prints Markdown tables.

Every attack is tried at many onsets on real recordings whose claims are honest but for it. A hit is an alert
of the right type on the right source within so many attacked frames, the first one included, and no other
alert before it. Exits 1 where `default` misses what is asked of it.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from typing import get_args

import cv2
import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from _families import FAMILIES, Family
from _recordings import RECORDINGS, VARIANTS, Variant, drive, made_recording
from _tables import (
    Found,
    Job,
    Profile,
    detection_lines,
    falls_short,
    families_named,
    honest_lines,
    miss_lines,
    sweep_lines,
)
from _trials import HonestRun, Trial, kept_frames, onsets_of
from belie.detector import Config

# The noise of a stream is learned in 20 frames; kitti06 has no more than 51.
FIRST_ONSET = {"kitti00": 40, "kitti06": 30, "handheld": 40}


def run(job: Job) -> Found:
    """One honest run, and every attack from its kept states."""
    recording = made_recording(drive(job.recording), job.variant, job.seed)
    frames, first = len(recording.joined), FIRST_ONSET[job.recording]
    period_s = float(np.median(np.diff(recording.frame_stamps_ns()))) * 1e-9
    families = [f for f in families_named(job.families) if job.recording in f.recordings]
    allowed = {f.name: f.frames_allowed(period_s) for f in families}
    onsets = {f.name: onsets_of(frames, first, allowed[f.name], job.onsets) for f in families}
    few = {f.name: onsets_of(frames, first, allowed[f.name], job.sweep_onsets) for f in families}
    keep = kept_frames(recording, [o for many in (*onsets.values(), *few.values()) for o in many])
    honest = HonestRun(recording, Config(profile=job.profile), keep)

    def tried(family: Family, starts: Sequence[int], magnitude: float | None = None) -> list[Trial]:
        within = family.frames_allowed(period_s, magnitude)
        trials = (
            honest.attacked(text, onset, within, family.least_m)
            for onset in starts
            for text in family.texts(onset, magnitude)
        )
        return [trial for trial in trials if trial is not None]

    swept: dict[tuple[str, float], list[Trial]] = {}
    for family in families if job.sweep_onsets else ():
        for magnitude in family.sweep if few[family.name] else ():
            swept[family.name, magnitude] = found = tried(family, few[family.name], magnitude)
            # Smaller lies need not be tried far below what is caught.
            if sum(trial.hit for trial in found) < 0.3 * len(found):
                break
    return Found(
        job=job,
        frames=frames,
        false_alerts=honest.false_alerts,
        trials={family.name: tried(family, onsets[family.name]) for family in families},
        swept=swept,
    )


def run_all(jobs: Sequence[Job], workers: int) -> list[Found]:
    """Every job, in as many processes, with a progress bar on stderr; answers in the order of jobs."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    context = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
    with (
        Progress(*columns, console=console, disable=not console.is_terminal) as progress,
        ProcessPoolExecutor(workers, mp_context=context, initializer=_one_thread) as pool,
    ):
        task = progress.add_task("recordings", total=len(jobs))
        futures = [pool.submit(run, job) for job in jobs]
        waiting = set(futures)
        while waiting:
            ready, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            progress.advance(task, len(ready))
        return [future.result() for future in futures]


def _one_thread() -> None:
    cv2.setNumThreads(1)


def main() -> int:
    """Run, and print; 1 if a target is missed in `default`."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="6 onsets, no sweep, claims `noisy` only")
    parser.add_argument("--recordings", nargs="+", choices=RECORDINGS, default=list(RECORDINGS))
    parser.add_argument("--variants", nargs="+", choices=list(VARIANTS))
    parser.add_argument("--families", nargs="+", choices=[f.name for f in FAMILIES])
    parser.add_argument("--profiles", nargs="+", choices=get_args(Profile), default=list(get_args(Profile)))
    parser.add_argument("--onsets", type=int, default=None, help="onsets a recording [20]")
    parser.add_argument("--sweep-onsets", type=int, default=None, help="the same for other magnitudes [8]")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0], help="of the noise of the claims [0]")
    parser.add_argument("--honest", action="store_true", help="honest claims only: look for false alerts")
    parser.add_argument("--jobs", type=int, default=2, help="processes [2]")
    parser.add_argument("--misses", action="store_true", help="list every miss")
    a = parser.parse_args()
    families = [] if a.honest else families_named(a.families)
    variants: list[Variant] = a.variants or (["noisy"] if a.quick else list(VARIANTS))
    sweep = a.sweep_onsets if a.sweep_onsets is not None else (0 if a.quick else 8)
    jobs = [
        Job(
            recording=recording,
            variant=variant,
            profile=profile,
            families=tuple(family.name for family in families),
            onsets=a.onsets or (6 if a.quick else 20),
            sweep_onsets=sweep,
            seed=seed,
        )
        for profile in a.profiles
        for recording in a.recordings
        for variant in variants
        for seed in a.seeds
    ]
    began = time.perf_counter()
    found = run_all(jobs, a.jobs)
    print(f"{len(jobs)} runs in {time.perf_counter() - began:.0f} s. Claims:")
    print("\n".join(f"- {variant}: {VARIANTS[variant]}" for variant in variants))
    print("\n## Honest claims\n\n" + "\n".join(honest_lines(found)))
    for profile in a.profiles if families else ():
        ours = [f for f in found if f.job.profile == profile]
        print(f"\n## Detection, `{profile}`\n\n" + "\n".join(detection_lines(ours, families)))
        if sweep:
            print(f"\n### Smallest lie, `{profile}`\n\n" + "\n".join(sweep_lines(ours, families)))
        if a.misses:
            print(f"\n### Misses, `{profile}`\n\n" + "\n".join(miss_lines(ours, families)))
    ours = [f for f in found if f.job.profile == "default"]
    short = [family for family in families if falls_short(family, _pooled(ours, family))]
    return int(bool(short) or any(f.false_alerts for f in ours))


def _pooled(found: Sequence[Found], family: Family) -> list[Trial]:
    return [trial for f in found for trial in f.trials.get(family.name, [])]


if __name__ == "__main__":
    raise SystemExit(main())
