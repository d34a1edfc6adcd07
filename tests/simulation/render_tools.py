"""Shared by the tests of the pictures: small worlds, small cameras."""

import warnings
from functools import cache
from importlib import import_module

import numpy as np
import pytest

from belie.geometry import SE3, CameraModel
from belie.simulation.rendered import Rendered
from belie.simulation.world import World
from belie.types import BelieError


def _has_egl() -> bool:
    from belie.simulation.gpu import open_context

    try:
        open_context().release()
    except BelieError as error:
        warnings.warn(f"tests of rendered pictures are SKIPPED: {error}", stacklevel=1)
        return False
    return True


needs_egl = pytest.mark.skipif(not _has_egl(), reason="no moderngl or no EGL")


def camera(width: int = 320, height: int = 240, **more: object) -> CameraModel:
    focal = 0.6 * width
    return CameraModel(
        width=width, height=height, fx=focal, fy=focal, cx=0.5 * width - 0.5, cy=0.5 * height - 0.5, **more
    )  # type: ignore[arg-type]


@cache
def world(scene: str, manoeuvre: str = "straight", seed: int = 1) -> World:
    return import_module(f"belie.simulation.scenes.{scene}").build(
        seed=seed, manoeuvre=manoeuvre, duration_s=3.0
    )


def T_world_cam(seen: World, t_s: float) -> SE3:
    return seen.ego.T_world_body(t_s) @ seen.T_body_cam


def points_of(rendered: Rendered, model: CameraModel, pixels: np.ndarray) -> np.ndarray:
    """Points in the camera's frame behind integer pixels, shape (N, 3)."""
    z = rendered.depth_m[pixels[:, 1], pixels[:, 0]].astype(np.float64)
    return np.column_stack([model.normalize(pixels.astype(np.float64)) * z[:, None], z])
