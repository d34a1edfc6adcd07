"""A small drive past textured bands at four depths, as a KITTI folder; and the command line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from belie.cli.main import app

WIDTH, HEIGHT, FOCAL = 320, 240, 260.0
DEPTHS_M = (4.0, 6.0, 9.0, 14.0)
FRAMES, STEP_M = 90, 0.06


def bands(x_m: float, textures: list[np.ndarray]) -> np.ndarray:
    """The view of a camera that looks across its way, `x_m` along it."""
    rows = HEIGHT // len(DEPTHS_M)
    parts = []
    for depth, texture in zip(DEPTHS_M, textures, strict=True):
        shift = np.array([[1.0, 0.0, -FOCAL * x_m / depth], [0.0, 1.0, 0.0]])
        parts.append(cv2.warpAffine(texture, shift, (WIDTH, rows), flags=cv2.INTER_LINEAR))
    noise = np.random.default_rng(round(x_m * 1e6)).normal(0.0, 1.5, (HEIGHT, WIDTH))
    return np.clip(np.concatenate(parts) + noise, 0, 255).astype(np.uint8)


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drive")
    (folder / "image_0").mkdir()
    rng = np.random.default_rng(3)
    length = int(WIDTH + FOCAL * FRAMES * STEP_M / min(DEPTHS_M)) + 50
    textures = [
        cv2.GaussianBlur(
            np.kron(rng.integers(30, 226, (15, length // 4 + 1)), np.ones((4, 4))).astype(np.uint8),
            (3, 3),
            0.8,
        )
        for _ in DEPTHS_M
    ]
    poses, times = [], []
    for index in range(FRAMES):
        # An even speed would be a poor test of the scale; and claims are never perfect.
        x_m = STEP_M * index + 0.05 * np.sin(0.3 * index)
        cv2.imwrite(str(folder / "image_0" / f"{index:06d}.png"), bands(x_m, textures))
        pose = np.eye(4)[:3]
        pose[:, 3] = np.array([x_m, 0.0, 0.0]) + rng.normal(0.0, 0.0003, 3)
        poses.append(" ".join(f"{value:.9e}" for value in pose.ravel()))
        times.append(f"{index * 0.1:.6e}")
    (folder / "poses.txt").write_text("\n".join(poses) + "\n")
    (folder / "times.txt").write_text("\n".join(times) + "\n")
    camera = f"{FOCAL} 0 {WIDTH / 2 - 0.5} 0 0 {FOCAL} {HEIGHT / 2 - 0.5} 0 0 0 1 0"
    (folder / "calib.txt").write_text(f"P0: {camera}\n")
    return folder


@pytest.fixture(scope="session")
def run() -> Callable[..., Result]:
    def invoke(*arguments: object) -> Result:
        # pytest-xdist tells its workers how wide the terminal is.
        return CliRunner(env={"COLUMNS": None}).invoke(
            app, [str(argument) for argument in arguments], prog_name="belie"
        )

    return invoke


@pytest.fixture(scope="session")
def attacked(drive: Path, run: Callable[..., Result], tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("attacked") / "attacked.mcap"
    result = run("attack", drive, "odometry-offset:axis=z,rate=0.2,start=60,stop=70", "-o", output)
    assert result.exit_code == 0, result.output
    return output
