"""Cost of the object checks: ``python benchmarks/object_cost.py`` prints milliseconds per object and frame at 1080p.

CPU time (`time.process_time`, OpenCV on one thread) beside wall time: on a shared machine only the first means much.
Frames of `traffic` are enlarged to 1920x1080; its annotated vehicles and patches of the scene make up the objects.
"""

from __future__ import annotations

import argparse
import time

import cv2
import numpy as np

from _object_recordings import SOURCE, annotated
from belie.detector import Config
from belie.detector.objects import ObjectStage
from belie.geometry import CameraModel
from belie.types import Detection, DetectionClaim, Frame

WIDTH, HEIGHT = 1920, 1080
ROUNDS = 5


def main() -> int:
    """Measure with 1, 10 and 40 objects; 0 where 10 objects cost at most 0.3 ms of CPU time each (p50)."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--objects", type=int, nargs="+", default=[1, 10, 40])
    chosen = parser.parse_args()
    images, config = annotated("traffic"), Config()
    cv2.setNumThreads(1)
    frames = [np.asarray(cv2.resize(f.image, (WIDTH, HEIGHT)), np.uint8) for f in images.frames]
    # The odometry has looked at the halved image before.
    halves = [
        np.asarray(cv2.resize(f, (WIDTH // 2, HEIGHT // 2), interpolation=cv2.INTER_AREA), np.uint8)
        for f in frames
    ]
    scale = np.array([WIDTH / images.camera.model.width, HEIGHT / images.camera.model.height] * 2)
    model = CameraModel(width=WIDTH, height=HEIGHT, fx=1100, fy=1100, cx=959.5, cy=539.5)
    rng = np.random.default_rng(0)
    patches = [
        np.array([x, y, x + w, y + 0.7 * w])
        for x, y, w in rng.uniform([60, 100, 60], [1500, 700, 300], (60, 3))
    ]
    print(
        "| objects | CPU a frame p50 | p95 | CPU an object p50 | wall an object p50 |\n|---:|---:|---:|---:|---:|"
    )
    ten = 0.0
    for count in chosen.objects:
        took, wall = [], []
        for turn in range(ROUNDS):
            stage = ObjectStage(model, config.objects, config.tracking, 0.1)
            for k, image in enumerate(frames):
                boxes = [o.box_px * scale for o in images.objects[k]] + patches
                told = tuple(
                    Detection(label="car", score=0.9, track_id=str(i), box_px=box)
                    for i, box in enumerate(boxes[:count])
                )
                ns = k * 10**8
                frame = Frame(camera="c", stamp_ns=ns, received_ns=ns, image=image)
                claim = DetectionClaim(source=SOURCE, stamp_ns=ns, received_ns=ns, detections=told)
                began, began_wall = time.process_time(), time.perf_counter()
                stage.take((claim,), ns)
                stage.update(frame, half=halves[k])
                if turn:  # the first compiles
                    took.append((time.process_time() - began) * 1e3)
                    wall.append((time.perf_counter() - began_wall) * 1e3)
        p50, p95 = np.percentile(took, [50, 95])
        ten = p50 / count if count == 10 else ten
        each = f"{p50 / count:.3f} ms | {np.median(wall) / count:.3f} ms"
        print(f"| {count} | {p50:.2f} ms | {p95:.2f} ms | {each} |")
    return int(ten > 0.3)


if __name__ == "__main__":
    raise SystemExit(main())
