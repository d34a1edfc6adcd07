"""A textured corridor that a camera flies through, with exact poses; and what a drive past a wall claims."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel
from belie.types import MotionClaim, PoseClaim

# Walls at these x, floor and ceiling at these y; camera axes, metres.
_SIDES_M = (-3.0, 3.0)
_LEVELS_M = (-2.5, 1.5)
_TEXELS_PER_M = 64.0
_VISIBLE_M = 25.0


def corridor(
    camera: CameraModel, frames: int, seed: int = 0, first: int = 0
) -> Iterator[tuple[npt.NDArray[np.uint8], SE3]]:
    """Images from number `first` on, and their poses ``T_world_cam``: 0.5 m a frame, swaying and turning a little.

    Every pixel's ray meets the nearest of four planes; their texture fades to gray with the distance, as in
    haze, which also keeps what is far from sparkling.
    """
    rng = np.random.default_rng(seed)
    texture = _texture(rng)
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack(
        [(columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy, np.ones(columns.shape)], axis=-1
    )
    for i in range(first, first + frames):
        yaw = 0.03 * np.sin(0.15 * i)
        T_world_cam = SE3(
            np.array(cv2.Rodrigues(np.array([0.0, yaw, 0.0]))[0]),
            np.array([0.5 * np.sin(0.1 * i), 0.1 * np.sin(0.37 * i), 0.5 * i]),
        )
        image = _render(rays @ T_world_cam.R.T, T_world_cam.t, texture)
        noisy = image + 2.0 * rng.standard_normal(image.shape, dtype=np.float32)
        yield np.clip(np.rint(noisy), 0, 255).astype(np.uint8), T_world_cam


def _texture(rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """Noise of several octaves with sharp-edged tiles on it, that can be repeated."""
    size = 2048
    total = np.zeros((size, size), dtype=np.float32)
    for cells in (32, 128, 512):
        octave = rng.standard_normal((cells, cells), dtype=np.float32)
        total += cv2.resize(octave, (size, size), interpolation=cv2.INTER_NEAREST) * (32.0 / cells) ** 0.3
    spread = float(total.std())
    return np.asarray(np.clip(128.0 + 45.0 * total / spread, 0.0, 255.0), dtype=np.float32)


def _render(
    rays: npt.NDArray[np.float64], position_m: npt.NDArray[np.float64], texture: npt.NDArray[np.float32]
) -> npt.NDArray[np.float32]:
    x, y, z = position_m
    with np.errstate(divide="ignore"):
        to_side = np.where(rays[..., 0] < 0.0, _SIDES_M[0] - x, _SIDES_M[1] - x) / rays[..., 0]
        to_level = np.where(rays[..., 1] < 0.0, _LEVELS_M[0] - y, _LEVELS_M[1] - y) / rays[..., 1]
    meets_side = np.abs(to_side) < np.abs(to_level)
    depth = np.minimum(np.where(meets_side, np.abs(to_side), np.abs(to_level)), 1e4)
    across = np.where(meets_side, y + depth * rays[..., 1], x + depth * rays[..., 0])
    # Each plane has a strip of the texture of its own.
    across = across + 8.0 * np.where(meets_side, rays[..., 0] < 0.0, 2 + (rays[..., 1] < 0.0))
    along = z + depth * rays[..., 2]
    size = len(texture)
    u = np.asarray(np.mod(along * _TEXELS_PER_M, size), dtype=np.float32)
    v = np.asarray(np.mod(across * _TEXELS_PER_M, size), dtype=np.float32)
    seen = cv2.remap(texture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    clear = np.exp(-depth / _VISIBLE_M)
    return np.asarray(128.0 + (seen - 128.0) * clear, dtype=np.float32)


def claims_past_wall(
    index: int, stamp_ns: int, period_ns: int, imu_per_frame: int = 6
) -> tuple[PoseClaim, tuple[MotionClaim, ...]]:
    """Odometry and IMU of a frame, 0.1 m after the one before, and without a turn."""
    pose = PoseClaim(
        source="/odom",
        frame_id="odom",
        stamp_ns=stamp_ns,
        received_ns=stamp_ns,
        T_odom_body=SE3.from_translation([0.1 * index, 0.0, 0.0]),
    )
    times_ns = [stamp_ns + k * period_ns // imu_per_frame for k in range(imu_per_frame)]
    rates = (
        MotionClaim(source="/imu", kind="imu", stamp_ns=t, received_ns=t, angular_rad_s=np.zeros(3))
        for t in times_ns
    )
    return pose, tuple(rates)
