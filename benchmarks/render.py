"""Cost of a rendered frame, and how its corners behave beside those of real cameras: ``python benchmarks/render.py``.

Cost: street, weather by weather, at three sizes: wall time, and the processor's of all threads, which other programs
disturb less. Corners: FAST at threshold 20, and LK tracks over three frames that agree forwards and backwards; of
those on what does not move, the reprojection error in the middle frame of points triangulated from the outer two with
the true poses. Real recordings (`../shared/data` or ``BELIE_DATA``) go through the same; their poses are their
reference, so their error holds its noise too.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from rich.progress import track

from belie.geometry import SE3, CameraModel, FloatArray
from belie.simulation.renderer import Renderer
from belie.simulation.weather import WEATHERS

SIZES = ((640, 480), (1280, 720), (1920, 1080))
SCENES = (("street", "straight"), ("street", "highway"), ("corridor", "straight"), ("flight", "straight"))
_STEP_S = 0.1  # between the frames of a track: real recordings run at 10 Hz
_DATA = Path(os.environ.get("BELIE_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
Gray = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Triple:
    """Three frames with their true poses; `still` marks, in each, what does not move (None: not known)."""

    images: tuple[Gray, Gray, Gray]
    poses: tuple[SE3, SE3, SE3]
    camera: CameraModel
    still: tuple[Mask, Mask, Mask] | None = None


def camera(width: int, height: int) -> CameraModel:
    """A camera of 80 deg."""
    focal = 0.5 * width / math.tan(math.radians(40.0))
    return CameraModel(
        width=width, height=height, fx=focal, fy=focal, cx=0.5 * width - 0.5, cy=0.5 * height - 0.5
    )


def cost_lines(frames: int) -> list[str]:
    """The table of costs."""
    world = import_module("belie.simulation.scenes.street").build(
        seed=1, manoeuvre="straight", duration_s=15.0
    )
    lines = ["| weather | size | wall, ms a frame | processor, ms a frame |", "|---|---|---:|---:|"]
    for name in track(("sunny", "light-fog", "night", "rainy-night"), description="cost"):
        for width, height in SIZES:
            with Renderer(world, camera(width, height), WEATHERS[name], 1) as renderer:
                renderer.render(0.0)  # compiles
                wall, processor = [], []
                for k in range(frames):
                    start = time.perf_counter(), time.process_time()
                    renderer.render(0.05 * (k + 1))
                    wall.append(1e3 * (time.perf_counter() - start[0]))
                    processor.append(1e3 * (time.process_time() - start[1]))
            mid = statistics.median
            lines.append(f"| {name} | {width}x{height} | {mid(wall):.0f} | {mid(processor):.0f} |")
    return lines


def corner_lines(triples: int) -> list[str]:
    """The table of corners, made and real."""
    lines = [
        "| images | weather | FAST | tracks | of corners | reprojection, px: median | p90 |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for scene, manoeuvre in track(SCENES, description="corners"):
        names = f"{scene} {manoeuvre}"
        lines += [_row(names, name, simulated(scene, manoeuvre, name, triples)) for name in WEATHERS]
    lines += [_row(recording, "real", real(recording, triples)) for recording in ("kitti00", "kitti06")]
    return lines


def simulated(scene: str, manoeuvre: str, weather: str, count: int) -> list[Triple]:
    """Triples from a simulated drive, at KITTI's pixel count."""
    world = import_module(f"belie.simulation.scenes.{scene}").build(
        seed=1, manoeuvre=manoeuvre, duration_s=15.0
    )
    model = camera(960, 480)
    triples = []
    with Renderer(world, model, WEATHERS[weather], 1) as renderer:
        for start in np.linspace(0.5, 10.0, count):
            times = [float(start) + k * _STEP_S for k in range(3)]
            a, b, c = (renderer.render(t) for t in times)
            p, q, r = (world.ego.T_world_body(t) @ world.T_body_cam for t in times)
            masks = [view.ids == 0 for view in (a, b, c) if view.ids is not None]
            triples.append(
                Triple(
                    images=(a.gray, b.gray, c.gray),
                    poses=(p, q, r),
                    camera=model,
                    still=(masks[0], masks[1], masks[2]),
                )
            )
    return triples


def real(name: str, count: int) -> list[Triple]:
    """Triples from a KITTI folder; none where it is missing."""
    folder = _DATA / name
    files = sorted(folder.rglob("*.png")) or sorted(folder.rglob("*.jpg"))
    if not files or not (folder / "poses.txt").is_file():
        return []
    poses = [SE3.from_matrix(row.reshape(3, 4)) for row in np.loadtxt(folder / "poses.txt")]
    f, cx, cy = (718.856, 607.1928, 185.2157) if name == "kitti00" else (707.0912, 601.8873, 183.1104)
    triples = []
    for start in np.linspace(0, min(len(files), len(poses)) - 3, count).astype(int).tolist():
        a, b, c = (np.asarray(cv2.imread(str(files[start + k]), cv2.IMREAD_GRAYSCALE)) for k in range(3))
        model = CameraModel(width=a.shape[1], height=a.shape[0], fx=f, fy=f, cx=cx, cy=cy)
        triples.append(
            Triple(images=(a, b, c), poses=(poses[start], poses[start + 1], poses[start + 2]), camera=model)
        )
    return triples


def _row(images: str, weather: str, triples: Sequence[Triple]) -> str:
    if not triples:
        return f"| {images} | {weather} | no data at {_DATA} | | | | |"
    fast = [len(cv2.FastFeatureDetector.create(20).detect(triple.images[0])) for triple in triples]
    found = [_tracked(triple) for triple in triples]
    errors = np.concatenate([error for _, _, error in found])
    corners, tracks = sum(n for n, _, _ in found), sum(n for _, n, _ in found)
    shown = [f"{np.percentile(errors, q):.2f}" if len(errors) > 20 else "" for q in (50, 90)]
    share = f"{100 * tracks / max(corners, 1):.0f} %"
    cells = (images, weather, f"{np.median(fast):.0f}", f"{tracks / len(triples):.0f}", share, *shown)
    return f"| {' | '.join(cells)} |"


def _tracked(triple: Triple) -> tuple[int, int, FloatArray]:
    """Corners, tracks, and reprojection errors (px)."""
    corners = cv2.goodFeaturesToTrack(triple.images[0], 1000, 0.01, 7)
    if corners is None:
        return 0, 0, np.zeros(0)
    places, good = [corners], np.ones(len(corners), dtype=bool)
    for a, b in pairwise(triple.images):
        forth, found, _ = cv2.calcOpticalFlowPyrLK(a, b, places[-1], None)
        back, _, _ = cv2.calcOpticalFlowPyrLK(b, a, forth, None)
        good &= (found.ravel() == 1) & (np.linalg.norm((back - places[-1]).reshape(-1, 2), axis=1) < 0.5)
        places.append(forth)
    tracks = int(good.sum())
    px = [place.reshape(-1, 2).astype(np.float64) for place in places]
    for at, mask in zip(px, triple.still or (), strict=False):
        x, y = np.clip(at.round().astype(int), 0, [mask.shape[1] - 1, mask.shape[0] - 1]).T
        good &= mask[y, x]
    return len(corners), tracks, _reprojection(triple, px, good)


def _reprojection(triple: Triple, px: list[FloatArray], good: Mask) -> FloatArray:
    first, middle, last = triple.poses
    T_last_first = last.inverse() @ first
    rays = [np.column_stack([triple.camera.normalize(at), np.ones(len(at))]) for at in (px[0], px[2])]
    d = rays[0] @ T_last_first.R.T
    aa, bb, ab = (d * d).sum(1), (rays[1] * rays[1]).sum(1), (d * rays[1]).sum(1)
    depth = (ab * (rays[1] @ T_last_first.t) - bb * (d @ T_last_first.t)) / np.maximum(
        aa * bb - ab * ab, 1e-12
    )
    parallax = np.linalg.norm(px[2] - triple.camera.project(d), axis=1)
    good = good & (depth > 0.2) & (parallax > 1.0)
    seen = (middle.inverse() @ first).apply(rays[0] * depth[:, None])[good]
    return np.asarray(np.linalg.norm(triple.camera.project(seen) - px[1][good], axis=1))


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=8, help="for each cost")
    parser.add_argument("--triples", type=int, default=4, help="for each row of corners")
    parser.add_argument("--only", choices=("cost", "corners"))
    options = parser.parse_args()
    if options.only != "corners":
        print("\n".join(cost_lines(options.frames)), "\n")
    if options.only != "cost":
        print("\n".join(corner_lines(options.triples)))


if __name__ == "__main__":
    main()
