"""Time of `Detector.update` beside ORB, matching and essential matrix: ``python benchmarks/latency.py``.

Both see the same frames in one run, frame by frame in turn, so that noise of the machine hits both. The
detector is given odometry at the frame rate, an IMU at 200 Hz, localisation and GNSS at 10 Hz, so that all
checks run. Beside the wall time stands the processor's, of all threads, which other programs disturb less.
Exits 1 where the ratio of the medians is above 0.40.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt
import simplejpeg
from rich.console import Console
from rich.progress import track

from _recordings import CAMERA, R_BODY_CAM, Drive, MemoryRecording, drive, made_recording
from _scene import corridor
from belie.detector import Config, Detector
from belie.geometry import SE3, CameraModel, FloatArray
from belie.types import Frame, MountedCamera

LIMIT = 0.40
WIDTH, HEIGHT = 1920, 1080
_SETTLING_FRAMES = 5  # the first ones build the map, and fill the caches of both
Image = npt.NDArray[np.uint8]


class Pipeline:
    """ORB with 1000 features, brute-force Hamming matching with cross-check, essential matrix, pose."""

    def __init__(self, K: FloatArray) -> None:
        self._K = K
        self._orb = cv2.ORB.create(1000)
        self._matcher = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True)
        self._last: tuple[Sequence[cv2.KeyPoint], npt.NDArray[np.uint8]] | None = None

    def update(self, image: Image) -> int:
        """Pairs that agree with the motion since the last image."""
        keypoints, descriptors = self._orb.detectAndCompute(image, None)
        last, self._last = self._last, (keypoints, descriptors)
        if last is None:
            return 0
        matches = self._matcher.match(last[1], descriptors)
        before = np.array([last[0][m.queryIdx].pt for m in matches])
        now = np.array([keypoints[m.trainIdx].pt for m in matches])
        E, mask = cv2.findEssentialMat(before, now, self._K, cv2.RANSAC, 0.999, 1.0)
        return int(cv2.recoverPose(E[:3], before, now, self._K, mask=mask)[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Times:
    """Milliseconds of each frame."""

    wall_ms: list[float] = field(default_factory=list)
    cpu_ms: list[float] = field(default_factory=list)

    def take(self, call: Callable[[], object]) -> None:
        """Run and add."""
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        call()
        self.wall_ms.append((time.perf_counter() - wall_s) * 1e3)
        self.cpu_ms.append((time.process_time() - cpu_s) * 1e3)

    def settled(self) -> tuple[float, float, float]:
        """Wall time p50 and p95, processor time p50; without the first frames."""
        wall, cpu = self.wall_ms[_SETTLING_FRAMES:], self.cpu_ms[_SETTLING_FRAMES:]
        return float(np.median(wall)), float(np.percentile(wall, 95)), float(np.median(cpu))


def measure(recording: MemoryRecording, profile: str, threads: int, what: str) -> tuple[Times, Times]:
    """Belie and the pipeline over one recording, frame by frame in turn."""
    cv2.setNumThreads(threads)
    cv2.setRNGSeed(0)
    detector = Detector(recording.cameras, Config.model_validate({"profile": profile}))
    pipeline = Pipeline(recording.cameras[CAMERA].model.K)
    belie, other = Times(), Times()
    console = Console(stderr=True)
    steps = track(recording.joined, what, console=console, disable=not console.is_terminal)
    for index, step in enumerate(steps):
        runs: list[tuple[Times, Callable[[], object]]] = [
            (belie, partial(detector.update, step.frame, step.claims)),
            (other, partial(pipeline.update, step.frame.image)),
        ]
        # Whoever comes second finds the image in the cache: take turns.
        for times, call in runs if index % 2 else reversed(runs):
            times.take(call)
    return belie, other


def enlarged(source: Drive) -> Drive:
    """The drive with its images resized to 1920x1080, the camera with them."""
    model = source.camera.model
    across, down = WIDTH / model.width, HEIGHT / model.height
    camera = replace(
        model,
        width=WIDTH,
        height=HEIGHT,
        fx=model.fx * across,
        fy=model.fy * down,
        cx=(model.cx + 0.5) * across - 0.5,
        cy=(model.cy + 0.5) * down - 0.5,
    )
    frames = [
        replace(frame, image=cv2.resize(frame.image, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC))
        for frame in source.frames
    ]
    return replace(source, camera=replace(source.camera, model=camera), frames=tuple(frames))


def synthetic(frames: int) -> Drive:
    """A corridor at 1920x1080, 30 Hz."""
    model = CameraModel(width=WIDTH, height=HEIGHT, fx=1100.0, fy=1100.0, cx=959.5, cy=539.5)
    T_body_cam = SE3(R_BODY_CAM, np.zeros(3))
    console = Console(stderr=True)
    made = track(
        corridor(model, frames), "rendering", frames, console=console, disable=not console.is_terminal
    )
    images, poses = zip(*made, strict=True)
    stamps_ns = [round(i * 1e9 / 30.0) for i in range(frames)]
    return Drive(
        name="corridor",
        camera=MountedCamera(model=model, T_body_cam=T_body_cam),
        frames=tuple(
            Frame(camera=CAMERA, stamp_ns=t, received_ns=t, image=image)
            for t, image in zip(stamps_ns, images, strict=True)
        ),
        poses=tuple(SE3(R_BODY_CAM, np.zeros(3)) @ T @ T_body_cam.inverse() for T in poses),
    )


def decode_ms(images: Sequence[Image]) -> tuple[float, float]:
    """Medians of decoding a frame from PNG (as KITTI has it) and from JPEG at quality 90."""
    png, jpeg = [], []
    for image in images:
        data = cv2.imencode(".png", image)[1]
        began = time.perf_counter()
        cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
        png.append((time.perf_counter() - began) * 1e3)
        compressed = simplejpeg.encode_jpeg(image[..., None], 90, "GRAY", "444")
        began = time.perf_counter()
        simplejpeg.decode_jpeg(compressed, "GRAY")
        jpeg.append((time.perf_counter() - began) * 1e3)
    return float(np.median(png)), float(np.median(jpeg))


def main() -> int:
    """Measure, and print a Markdown table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=200, help="of each recording, at most [200]")
    parser.add_argument("--recording", default="kitti00", choices=("kitti00", "kitti06"))
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2], help="OpenCV's [1 2]")
    parser.add_argument("--profiles", nargs="+", choices=("default", "paper"), default=["default"])
    a = parser.parse_args()
    source = drive(a.recording)
    source = replace(source, frames=source.frames[: a.frames], poses=source.poses[: a.frames])
    sources: dict[str, Callable[[], Drive]] = {
        f"{a.recording} {source.camera.model.width}x{source.camera.model.height}": lambda: source,
        f"{a.recording} enlarged to {WIDTH}x{HEIGHT}": lambda: enlarged(source),
        f"corridor {WIDTH}x{HEIGHT}": lambda: synthetic(a.frames),
    }
    heads = (
        *("frames", "profile", "threads", "belie p50", "p95", "pipeline p50", "p95", "ratio"),
        *(f"<= {LIMIT}", "processor: belie p50", "pipeline p50", "ratio", "decode PNG, JPEG"),
    )
    print(f"All times in ms.\n\n| {' | '.join(heads)} |\n|---|---|{'---:|' * (len(heads) - 2)}")
    met = True
    for name, make in sources.items():
        made = make()
        recording = made_recording(made, "noisy")
        png_ms, jpeg_ms = decode_ms([frame.image for frame in made.frames[::10]])
        for profile in a.profiles:
            for threads in a.threads:
                belie, other = measure(recording, profile, threads, f"{name}, {profile}, {threads} thread(s)")
                ours, theirs = belie.settled(), other.settled()
                within = ours[0] <= LIMIT * theirs[0]
                met = met and (within or profile != "default")
                cells = (
                    *(name, profile, str(threads), f"{ours[0]:.1f}", f"{ours[1]:.1f}"),
                    *(f"{theirs[0]:.1f}", f"{theirs[1]:.1f}", f"{ours[0] / theirs[0]:.2f}"),
                    *("yes" if within else "**no**", f"{ours[2]:.1f}", f"{theirs[2]:.1f}"),
                    *(f"{ours[2] / theirs[2]:.2f}", f"{png_ms:.1f}, {jpeg_ms:.1f}"),
                )
                print(f"| {' | '.join(cells)} |", flush=True)
    return int(not met)


if __name__ == "__main__":
    raise SystemExit(main())
