"""The paper's case of an adversarial patch, on a door and on a stop sign, simulated: how many runs are found?

python benchmarks/patch.py --cache /tmp/clean --sensor-seeds 1 2 3 4 5 6 7 8 9 10

Two ways. ``from frame 0``: as the simulator has it, the patch works in nine of ten messages from the first frame on,
and the detector has hardly ever seen what it hides. ``from frame N`` (``--onsets N``): the robot has seen door and sign
before the patch begins to work (it comes into view, or near enough). A hit is an alert of the right type that
names the object.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import replace
from pathlib import Path

from _recordings import MemoryRecording
from belie.attacks import attack
from belie.geometry import box_iou
from belie.types import AlertType, DetectionClaim
from clean_simulated import Job
from objects_simulated import Drive, Judge, claims_of, drive_of

WANTED = {"hide": AlertType.OBSTACLE_HIDING, "relabel": AlertType.OBJECT_MISCLASSIFICATION}


def names_of(recording: MemoryRecording, drive: Drive, label: str) -> Counter[str]:
    """Under which track ids the detector told of an object, and how often."""
    names = Counter[str]()
    for labels, step in zip(drive.labels, recording.joined, strict=True):
        truth = next((o for o in labels if o.label == label), None)
        for claim in step.claims:
            if truth is not None and isinstance(claim, DetectionClaim):
                names.update(
                    d.track_id
                    for d in claim.detections
                    if d.box_px is not None and box_iou(d.box_px, truth.box_px) > 0.5
                )
    return names


def found(job: Job, label: str, mode: str, start: int, profile: str) -> int | None:
    """Frame of the alert, from the patch's onset on."""
    drive = drive_of(replace(job, sensor_seed=job.world_seed))
    recording = claims_of(job, drive, profile, None, patch="none" if start else mode)
    names, judge = names_of(recording, drive, label), Judge(recording, drive, profile)
    if not names:
        return None
    spec = f"detections-patch:object={names.most_common(1)[0][0]},mode={mode},start={start}"
    steps = attack(recording, spec).steps() if start else recording.joined
    for index, step in enumerate(steps):
        _, alerts = judge.look(index, step)
        if any(a.type is WANTED[mode] and a.object in names and index >= start for a in alerts):
            return index - start
    return None


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cache", type=Path, required=True, help="folder of rendered bags")
    parser.add_argument("--sensor-seeds", type=int, nargs="+", default=list(range(1, 11)))
    parser.add_argument("--weathers", nargs="+", default=["sunny"])
    parser.add_argument("--size", type=int, nargs=2, default=(640, 480), help="pixels")
    parser.add_argument(
        "--onsets", type=int, nargs="+", default=[0, 40, 100], help="frames; 0: as the simulator has it"
    )
    parser.add_argument("--profile", default="default", choices=("default", "paper"))
    wanted = parser.parse_args()
    print("| weather | object | patch | works | found | frames to the alert |\n|---|---|---|---|---:|---|")
    for weather in wanted.weathers:
        for label, mode in (("door", "hide"), ("stop sign", "hide"), ("stop sign", "relabel")):
            for start in wanted.onsets:
                delays = [
                    found(
                        Job(
                            scenario="patch", weather=weather, world_seed=1, sensor_seed=seed, duration_s=15.0,
                            size=(wanted.size[0], wanted.size[1]), rate_hz=10.0, cache=wanted.cache,
                        ),
                        label, mode, start, wanted.profile,
                    )
                    for seed in wanted.sensor_seeds
                ]  # fmt: skip
                hits = sorted(d for d in delays if d is not None)
                row = (weather, label, mode, f"from frame {start}", f"{len(hits)}/{len(delays)}", str(hits))
                print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
