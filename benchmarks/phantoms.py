"""Phantom boxes anywhere over the real street of kitti00: how many are found, how soon, and what hides the others?

``python benchmarks/phantoms.py`` draws boxes 45 to 160 px wide whose foot is in the lower half of the image, at any
time, also over true objects and over asphalt without texture: whoever forges a box does not ask what lies behind it.
Each lasts ten messages of the detector of `objects.py`. What is not found is counted by what was answered about it.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator

import numpy as np

from _object_recordings import Annotated, annotated, detected
from belie.attacks import attack
from belie.detector import Config
from belie.detector.objects import ObjectStage
from belie.evaluation.intervals import wilson_interval
from belie.geometry import FloatArray
from belie.geometry.boxes import overlaps
from belie.types import Status
from objects import sights

NAME, LASTS = "kitti00", 10
WIDTH_PX = (45.0, 160.0)
HEIGHTS = (0.5, 1.2)  # over the width
FIRST, LAST = 8, 85  # frames in which there are objects, too
TAKEN = "its evidence was not enough"


def drawn(count: int, seed: int) -> Iterator[tuple[FloatArray, str, int]]:
    """Boxes (4,), labels and onsets."""
    model, rng = annotated(NAME).camera.model, np.random.default_rng(seed)
    for _ in range(count):
        width = rng.uniform(*WIDTH_PX)
        height = width * rng.uniform(*HEIGHTS)
        left, foot = rng.uniform(20.0, model.width - width - 20.0), rng.uniform(0.53, 0.9) * model.height
        box = np.array([left, max(foot - height, 5.0), left + width, foot])
        yield box.round(), str(rng.choice(["car", "person"])), int(rng.integers(FIRST, LAST))


def found(box: FloatArray, label: str, start: int, seed: int) -> tuple[int | None, str]:
    """Messages until the alert, and the most frequent answer until then."""
    left, top, right, bottom = box.tolist()
    spec = f"detections-phantom:label={label},x={left},y={top},w={right - left},h={bottom - top}"
    attacked = attack(detected(annotated(NAME), seed), f"{spec},start={start},stop={start + LASTS}")
    (lie,), config = attacked.labels, Config()
    stage = ObjectStage(
        annotated(NAME).camera.model, config.objects, config.tracking, config.sequential.false_alarms_per_hour
    )
    answers = Counter[str]()
    for index, (step, sight) in enumerate(zip(attacked.steps(), sights(NAME), strict=True)):
        stage.take(step.claims, step.frame.stamp_ns)
        told = [j.result for j in stage.update(step.frame, *sight) if j.result.check == "injection"]
        if any(r.status is Status.CONTRADICTED and r.object == lie.object for r in told):
            return index - start, ""
        answers.update(view.unseen or TAKEN for view in stage.views if view.name == lie.object)
        if index == start + LASTS - 1:
            break
    return None, answers.most_common(1)[0][0] if answers else "not followed"


def _share_of(box: FloatArray, objects: tuple[Annotated, ...]) -> float:
    others = np.array([o.box_px for o in objects]).reshape(-1, 4)
    return float(overlaps(box[None], others)[1].max(initial=0.0))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--boxes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    wanted = parser.parse_args()
    tried: dict[str, list[tuple[int | None, str]]] = {"beside true objects": [], "over a true object": []}
    for n, (box, label, start) in enumerate(drawn(wanted.boxes, wanted.seed)):
        over = _share_of(box, annotated(NAME).objects[start]) > 0.0
        tried[[*tried][over]].append(found(box, label, start, n))
    print("| phantom | found within 5 | within 10 | not found, as most often answered |\n|---|---:|---:|---|")
    for where, some in tried.items():
        delays = [delay for delay, _ in some if delay is not None]
        why = Counter(reason for delay, reason in some if delay is None).most_common()
        low, high = wilson_interval(len(delays), len(some)) or (0.0, 1.0)
        row = (
            where, f"{sum(d < 5 for d in delays)}/{len(some)}",
            f"{len(delays)}/{len(some)} ({100 * low:.0f} to {100 * high:.0f} %)",
            "; ".join(f"{count} x {reason}" for reason, count in why),
        )  # fmt: skip
        print(f"| {' | '.join(row)} |")


if __name__ == "__main__":
    main()
