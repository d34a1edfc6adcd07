"""The paper's case of an adversarial patch, on a door and on a stop sign, simulated: how many runs are found?

python benchmarks/patch.py                                                                  ten worlds
python benchmarks/patch.py --world-seeds 1 --sensor-seeds 1 2 3 4 5 6 7 8 9 --duration 15  nine detectors in one

The drives are the printed patch's of `belie bench paper` (the second line's: of `belie bench clean`), and so are their
pictures. Two ways. ``from frame 0``: as the simulator has it, the patch works in nine of ten messages from the first
frame on, and the detector has hardly ever seen what it hides. ``from frame N`` (``--onsets N``): the robot has seen
door and sign before the patch begins to work (it comes into view, or near enough). A hit is an alert of the right type
that names the object; what has been passed by the onset is not tried.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from contextlib import suppress
from itertools import product

from _recordings import MemoryRecording
from _simulated import Drive, Judge, cases_of, claims_of, drive_of, drive_parser
from belie.attacks import attack
from belie.geometry import box_iou
from belie.types import AlertType, AttackError, DetectionClaim

PATCHES = (("door", "hide"), ("stop sign", "hide"), ("stop sign", "relabel"))
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


def found(drive: Drive, sensor_seed: int, label: str, mode: str, start: int, profile: str) -> int | None:
    """Frame of the alert, from the patch's onset on."""
    recording = claims_of(drive, sensor_seed, profile, patch="none" if start else mode)
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
    parser = drive_parser(__doc__, suite="paper", scenario="patch")
    parser.add_argument(
        "--onsets", type=int, nargs="+", default=[0, 40, 100], help="frames; 0: as the simulator has it"
    )
    wanted = parser.parse_args()
    delays: dict[tuple[str, str, str, int], list[int | None]] = defaultdict(list)
    for case, pictures in cases_of(parser, wanted):
        for (label, mode), start in product(PATCHES, wanted.onsets):
            with suppress(AttackError):  # it has been passed by then: nothing to attack
                delay = found(drive_of(pictures), case.sensor_seed, label, mode, start, wanted.profile)
                delays[case.weather, label, mode, start].append(delay)
    print("| weather | object | patch | works | found | frames to the alert |\n|---|---|---|---|---:|---|")
    for (weather, label, mode, start), tried in delays.items():
        hits = sorted(d for d in tried if d is not None)
        row = (weather, label, mode, f"from frame {start}", f"{len(hits)}/{len(tried)}", str(hits))
        print(f"| {' | '.join(row)} |")


if __name__ == "__main__":
    main()
