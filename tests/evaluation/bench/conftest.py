"""A small drive past textured bands, with the claims of every sensor."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from belie.evaluation.bench.made_claims import CAMERA, Drive, made_recording
from belie.evaluation.bench.memory import MemoryRecording
from belie.geometry import SE3, CameraModel
from belie.types import Frame, MountedCamera

WIDTH, HEIGHT, FOCAL = 240, 180, 200.0
DEPTHS_M = (4.0, 7.0, 12.0)
FRAMES, STEP_M = 70, 0.5
# Looks to the left of its way: x of the camera is forward, y down.
R_BODY_CAM = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def bands(x_m: float, textures: list[np.ndarray]) -> np.ndarray:
    rows = HEIGHT // len(DEPTHS_M)
    parts = []
    for depth, texture in zip(DEPTHS_M, textures, strict=True):
        shift = np.array([[1.0, 0.0, -FOCAL * x_m / depth], [0.0, 1.0, 0.0]])
        parts.append(cv2.warpAffine(texture, shift, (WIDTH, rows), flags=cv2.INTER_LINEAR))
    noise = np.random.default_rng(round(x_m * 1e6)).normal(0.0, 1.5, (HEIGHT, WIDTH))
    return np.clip(np.concatenate(parts) + noise, 0, 255).astype(np.uint8)


@pytest.fixture(scope="session")
def small_drive() -> MemoryRecording:
    rng = np.random.default_rng(3)
    length = int(WIDTH + FOCAL * FRAMES * STEP_M / min(DEPTHS_M)) + 100
    textures = [
        np.kron(rng.integers(30, 226, (15, length // 4 + 1)), np.ones((4, 4))).astype(np.uint8)
        for _ in DEPTHS_M
    ]
    model = CameraModel(
        width=WIDTH, height=HEIGHT, fx=FOCAL, fy=FOCAL, cx=WIDTH / 2 - 0.5, cy=HEIGHT / 2 - 0.5
    )
    frames, poses = [], []
    for index in range(FRAMES):
        x_m = STEP_M * index + 0.1 * np.sin(0.3 * index)
        stamp_ns = index * 100_000_000
        frames.append(
            Frame(camera=CAMERA, stamp_ns=stamp_ns, received_ns=stamp_ns, image=bands(x_m, textures))
        )
        poses.append(SE3.from_translation([x_m, 0.0, 0.0]))
    drive = Drive(
        name="bands",
        camera=MountedCamera(model=model, T_body_cam=SE3(R_BODY_CAM, np.zeros(3))),
        frames=tuple(frames),
        poses=tuple(poses),
    )
    return made_recording(drive, "noisy", seed=1)
