"""Memory over a long recording: ``python benchmarks/memory.py`` writes 20,000 frames and reads them back.

Prints the resident set size over the pass and its peak; with ``--detector`` the frames are judged too.
Exits 1 above the limit of 600 MB.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import psutil

from _scene import claims_past_wall
from belie.detector import Config, Detector
from belie.geometry import SE3, CameraModel
from belie.recordings import open_recording, write_mcap
from belie.types import Frame, MountedCamera, Status, Step

LIMIT_MB = 600.0
CAMERA = "/camera/image_raw"
FRAME_PERIOD_NS = 33_333_333
WALL_PX = 4096
PX_PER_FRAME = 2  # 0.1 m a frame seen from 25 m at f = 500 px


def made_steps(frames: int) -> Iterator[Step]:
    """A drive along a wall 25 m away at 30 Hz, with odometry at the frames and an IMU at 180 Hz."""
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.integers(0, 256, (480, WALL_PX), dtype=np.uint8), (15, 15), 4)
    wall = cv2.normalize(np.hstack([wall, wall[:, :640]]), None, 0, 255, cv2.NORM_MINMAX)
    for index in range(frames):
        stamp_ns = index * FRAME_PERIOD_NS
        pose, samples = claims_past_wall(index, stamp_ns, FRAME_PERIOD_NS)
        left = PX_PER_FRAME * index % WALL_PX
        # A wall passed twice would be a replayed camera, and nothing else would be judged.
        lap = PX_PER_FRAME * index // WALL_PX
        image = np.ascontiguousarray(np.roll(wall[:, left : left + 640], 29 * lap, axis=0))
        frame = Frame(camera=CAMERA, stamp_ns=stamp_ns, received_ns=stamp_ns, image=image)
        yield Step(frame=frame, claims=(pose, *samples))


def main() -> int:
    """Write, read, print; 0 if memory stayed under the limit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--detector", action="store_true", help="judge every frame")
    parser.add_argument("--profile", choices=("default", "paper"), default="default", help="of the detector")
    arguments = parser.parse_args()
    process = psutil.Process()
    camera = MountedCamera(
        model=CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5),
        T_body_cam=SE3.identity(),
    )

    def rss_mb() -> float:
        return float(process.memory_info().rss) / 1e6

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.mcap"
        start_mb = peak_write_mb = rss_mb()

        def watch(count: int) -> None:
            nonlocal peak_write_mb
            if count % 100 == 0:
                peak_write_mb = max(peak_write_mb, rss_mb())

        start_s = time.perf_counter()
        write_mcap(
            path,
            made_steps(arguments.frames),
            cameras={CAMERA: camera},
            body_axes="flu",
            image_encoding="jpeg",
            progress=watch,
        )
        print(
            f"wrote {arguments.frames} frames, {path.stat().st_size / 1e6:.0f} MB, "
            f"in {time.perf_counter() - start_s:.0f} s; "
            f"RSS {start_mb:.0f} MB before, {peak_write_mb:.0f} MB peak"
        )
        print(f"{'frame':>8} {'RSS [MB]':>9}")
        statuses: Counter[Status] = Counter()
        peak_mb, start_s, count = rss_mb(), time.perf_counter(), 0
        every = max(1, arguments.frames // 20)
        recording = open_recording(path)
        config = Config.model_validate({"profile": arguments.profile})
        detector = Detector(recording.cameras, config) if arguments.detector else None
        for count, step in enumerate(recording.steps(), start=1):
            if detector is not None:
                statuses[detector.update(step.frame, step.claims).status] += 1
            if count % 50 == 0:
                peak_mb = max(peak_mb, rss_mb())
            if count % every == 0:
                print(f"{count:>8} {rss_mb():>9.1f}", flush=True)
            del step
        elapsed_s = time.perf_counter() - start_s
        done = "judged" if arguments.detector else "read"
        print(f"{done} {count} frames at {count / elapsed_s:.0f} frames/s; peak RSS {peak_mb:.0f} MB", end="")
        print(f" (limit {LIMIT_MB:.0f} MB)")
        if detector is not None:
            print(", ".join(f"{status}: {n}" for status, n in statuses.most_common()))
    if count != arguments.frames:
        print(f"only {count} of {arguments.frames} frames came back", file=sys.stderr)
        return 1
    return int(peak_mb > LIMIT_MB)


if __name__ == "__main__":
    raise SystemExit(main())
