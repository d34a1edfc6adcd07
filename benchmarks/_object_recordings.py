"""Real images with annotated objects, and a detector with the habits of real ones over them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from _recordings import CAMERA, MemoryRecording, data_folder
from belie.geometry import SE3, CameraModel, FloatArray
from belie.types import Detection, DetectionClaim, Frame, MountedCamera, Step

RECORDINGS = ("kitti00", "traffic", "carla_crossing")
SOURCE = "/detections"
_VEHICLES = ("car", "van", "truck")
_INTERVAL_NS = {"kitti00": 103_700_000, "traffic": 100_000_000, "carla_crossing": 300_000_000}


@dataclass(frozen=True, slots=True, kw_only=True)
class Annotated:
    """One annotated box: edges px, and how much of the object others hide."""

    track_id: str
    label: str
    box_px: FloatArray
    occluded: float = 0.0
    truncated: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class AnnotatedImages:
    """Frames of one camera, and the objects annotated in each."""

    name: str
    camera: MountedCamera
    frames: tuple[Frame, ...]
    objects: tuple[tuple[Annotated, ...], ...]


@cache
def annotated(name: str) -> AnnotatedImages:
    """Read a recording of `RECORDINGS` into memory."""
    folder = data_folder() / name
    if name == "carla_crossing":
        files = sorted((folder / "images").iterdir())
        objects = _crossing(folder, files)
        model = _model(files[0], f=340.0)
    else:
        files = sorted((folder / ("image_0" if name == "kitti00" else "image_2")).iterdir())
        objects = _boxes(folder / "boxes.json", len(files))
        f, cx, cy = (718.856, 607.1928, 185.2157) if name == "kitti00" else (721.5377, 609.5593, 172.854)
        model = _model(files[0], f=f, cx=cx, cy=cy)
    frames = tuple(
        Frame(
            camera=CAMERA, stamp_ns=i * _INTERVAL_NS[name], received_ns=i * _INTERVAL_NS[name],
            image=np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), np.uint8),
        )
        for i, path in enumerate(files)
    )  # fmt: skip
    mounted = MountedCamera(model=model, T_body_cam=SE3.identity())
    return AnnotatedImages(name=name, camera=mounted, frames=frames, objects=objects)


def _model(path: Path, f: float, cx: float | None = None, cy: float | None = None) -> CameraModel:
    height, width = np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)).shape
    return CameraModel(
        width=width, height=height, fx=f, fy=f,
        cx=0.5 * width - 0.5 if cx is None else cx, cy=0.5 * height - 0.5 if cy is None else cy,
    )  # fmt: skip


def _boxes(path: Path, frames: int) -> tuple[tuple[Annotated, ...], ...]:
    found: list[list[Annotated]] = [[] for _ in range(frames)]
    for entry in json.loads(path.read_text())["objects"]:
        for box in entry["boxes"]:
            found[box["frame"]].append(
                Annotated(
                    track_id=str(entry["track_id"]), label=entry["label"], box_px=np.array(box["xyxy"], float),
                    occluded=box["occluded"], truncated=box["truncated"],
                )
            )  # fmt: skip
    return tuple(tuple(objects) for objects in found)


def _crossing(folder: Path, files: Sequence[Path]) -> tuple[tuple[Annotated, ...], ...]:
    """Boxes without identities, but listed in one order of the actors: joined by that order and by nearness."""
    found: list[tuple[Annotated, ...]] = []
    last: list[Annotated] = []
    made = 0
    for path in files:
        table = folder / "boxes" / f"{path.stem}.txt"
        told = [line.split()[:5] for line in table.read_text().splitlines()] if table.exists() else []
        boxes = [
            (np.array([x0, y0, x1, y1], float), label.lower()) for x0, x1, y0, y1, label in filter(None, told)
        ]
        ids = {now: last[then].track_id for then, now in _in_order(last, boxes)}
        for k in range(len(boxes)):
            if k not in ids:
                made += 1
                ids[k] = str(made)
        last = [Annotated(track_id=ids[k], label=label, box_px=box) for k, (box, label) in enumerate(boxes)]
        found.append(tuple(last))
    return tuple(found)


def _in_order(last: Sequence[Annotated], boxes: Sequence[tuple[FloatArray, str]]) -> list[tuple[int, int]]:
    """Pairs that keep the order of both lists and are near each other: as many, and as near, as there can be."""
    worth = np.zeros((len(last) + 1, len(boxes) + 1))
    paired = np.zeros(worth.shape)
    for i, old in enumerate(last):
        for j, (box, label) in enumerate(boxes):
            step = 0.5 * float(np.linalg.norm(box[:2] + box[2:] - old.box_px[:2] - old.box_px[2:]))
            near = 1.0 - step / (0.6 * float((box[2:] - box[:2]).max()))
            paired[i + 1, j + 1] = near if old.label == label and near > 0.0 else -np.inf
            worth[i + 1, j + 1] = max(worth[i, j + 1], worth[i + 1, j], worth[i, j] + paired[i + 1, j + 1])
    pairs, i, j = [], len(last), len(boxes)
    while i and j:
        if worth[i, j] == worth[i, j - 1]:
            j -= 1
        elif worth[i, j] == worth[i - 1, j]:
            i -= 1
        else:
            i, j = i - 1, j - 1
            pairs.append((i, j))
    return pairs


def detected(
    images: AnnotatedImages,
    seed: int,
    *,
    jitter: float = 0.03,
    miss: float = 0.05,
    flip: float = 0.02,
    ids: bool = True,
) -> MemoryRecording:
    """The recording with a detector's messages: jitter of the box, misses, label flips among vehicles.

    Jitter is the standard deviation of each edge relative to the side; an object that is hidden by more than 60 %
    or cut by more than 70 % is not detected.
    """
    rng = np.random.default_rng([seed, len(images.name)])
    size = np.array([images.camera.model.width, images.camera.model.height] * 2, float)
    steps = []
    for frame, objects in zip(images.frames, images.objects, strict=True):
        told = []
        for o in objects:
            noise, lot, other = rng.normal(size=4), rng.random(2), rng.choice(_VEHICLES)
            if lot[0] < miss or o.occluded > 0.6 or o.truncated > 0.7:
                continue
            box = np.clip(o.box_px + jitter * noise * np.tile(o.box_px[2:] - o.box_px[:2], 2), 0.0, size)
            if (box[2:] - box[:2] < 4.0).any():
                continue
            label = str(other) if o.label in _VEHICLES and lot[1] < flip else o.label
            told.append(Detection(label=label, score=0.9, track_id=o.track_id if ids else "", box_px=box))
        claim = DetectionClaim(
            source=SOURCE, stamp_ns=frame.stamp_ns, received_ns=frame.stamp_ns, detections=tuple(told)
        )
        steps.append(Step(frame=frame, claims=(claim,)))
    return MemoryRecording(name=images.name, cameras={CAMERA: images.camera}, joined=tuple(steps))
