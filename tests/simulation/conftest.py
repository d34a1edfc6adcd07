"""A small made world that needs no graphics: textured planes, drawn by casting a ray through every pixel."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from belie.geometry import SE3
from belie.simulation.scenario import Scenario
from belie.simulation.stage import Stage

# camera axes (right, down, forward) in body axes (forward, left, up)
T_BODY_CAM = SE3(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.array([1.5, 0.0, 1.4]))
SPEED_M_S = 8.0
PLANES = [
    ((-20, 7.0, -0.1), (220, 0, 0), (0, 0, 9.0)),
    ((-20, -7.0, -0.1), (220, 0, 0), (0, 0, 9.0)),
    ((-20, -7.0, 0.0), (220, 0, 0), (0, 14.0, 0)),
    ((200, -7.0, 0.0), (0, 14.0, 0), (0, 0, 9.0)),
    *(((12.0 * k, 4.6, 0.0), (0, 1.6, 0), (0, 0, 1.5)) for k in range(1, 15)),
    *(((12.0 * k + 5.0, -6.2, 0.0), (0, 1.6, 0), (0, 0, 1.5)) for k in range(1, 15)),
]


class Straight:
    """Along x at an even speed, with a slight sway."""

    def T_world_body(self, t_s):
        return SE3.from_translation([SPEED_M_S * t_s, 0.0, 0.0])

    def twist(self, t_s):
        return np.array([SPEED_M_S, 0.0, 0.0]), np.zeros(3)


class Parked:
    def __init__(self, x, y):
        self.T = SE3.from_translation([x, y, 0.75])

    def T_world_body(self, t_s):
        return self.T

    def twist(self, t_s):
        return np.zeros(3), np.zeros(3)


def texture(seed: int, height: int, width: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    image = np.zeros((height, width), np.float32)
    for sigma in (1.5, 4.0, 10.0):
        layer = cv2.GaussianBlur(rng.normal(size=(height, width)).astype(np.float32), (0, 0), sigma)
        image += layer / layer.std()
    return np.clip(128 + 35 * image, 0, 255).astype(np.uint8)


class PlaneRenderer:
    """Has the surface of `belie.simulation.renderer.Renderer`, as far as a stage asks for it."""

    def __init__(self, world, camera) -> None:
        self.world, self.camera = world, camera
        self.pictures = [
            texture(i, *(max(48, int(25 * np.linalg.norm(edge))) for edge in (plane[2], plane[1])))
            for i, plane in enumerate(PLANES)
        ]
        v, u = np.mgrid[0 : camera.height, 0 : camera.width]
        self.rays = np.dstack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)])

    def render(self, t_s, ego=None):
        T = (ego or self.world.ego).T_world_body(t_s)
        T_world_cam = T @ self.world.T_body_cam
        rays = (self.rays @ T_world_cam.R.T).astype(np.float32)
        nearest = np.full(rays.shape[:2], np.inf, np.float32)
        image = np.full(rays.shape[:2], 200, np.uint8)
        for plane, picture in zip(PLANES, self.pictures, strict=True):
            corner, a, b = (np.array(x, float) for x in plane)
            normal = np.cross(a, b)
            if a[0] == 0.0 and not 0.0 < corner[0] - T_world_cam.t[0] < 45.0 and corner[0] < 190.0:
                continue  # a box behind, or too far to matter
            with np.errstate(divide="ignore", invalid="ignore"):
                depth = ((corner - T_world_cam.t) @ normal) / (rays @ normal)
            hit = T_world_cam.t + rays * depth[..., None] - corner
            s, t = hit @ a / (a @ a), hit @ b / (b @ b)
            seen = (depth > 0.05) & (depth < nearest) & (s >= 0) & (s < 1) & (t >= 0) & (t < 1)
            if not seen.any():
                continue
            x = (s * (picture.shape[1] - 1)).astype(np.float32)
            y = (t * (picture.shape[0] - 1)).astype(np.float32)
            image[seen] = cv2.remap(picture, x, y, cv2.INTER_LINEAR)[seen]
            nearest[seen] = depth[seen]
        noise = np.random.default_rng(round(t_s * 1e6)).normal(0.0, 1.5, image.shape)
        gray = np.clip(image + noise, 0, 255).astype(np.uint8)
        return SimpleNamespace(
            bgr=cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR),
            gray=gray,
            depth_m=nearest,
            ids=np.zeros(gray.shape, np.int32),
        )


def label_of(world, rendered, camera, t_s, T_world_body):
    """Every actor ahead, unoccluded: its box from its eight corners."""
    found = []
    for actor in world.actors:
        T_cam_obj = (T_world_body @ world.T_body_cam).inverse() @ actor.motion.T_world_body(t_s)
        half = 0.5 * np.array(actor.dimensions_m)
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).T.reshape(-1, 3)
        corners = T_cam_obj.apply(signs * half)
        if corners[:, 2].min() < 0.5:
            continue
        px = camera.project(corners) + 0.5
        low = np.clip(px.min(axis=0), 0, [camera.width, camera.height])
        high = np.clip(px.max(axis=0), 0, [camera.width, camera.height])
        if (high - low).min() < 1.0:
            continue
        found.append(
            SimpleNamespace(
                id=actor.id,
                label=actor.label,
                box_px=np.concatenate([low, high]),
                visible=1.0,
                truncation=0.0,
                distance_m=float(np.linalg.norm(T_cam_obj.t)),
                T_cam_obj=T_cam_obj,
                dimensions_m=np.array(actor.dimensions_m),
            )
        )
    return tuple(found)


def make_world(*actors):
    lane = np.column_stack([np.linspace(-20, 220, 481), np.zeros(481), np.zeros(481)])
    return SimpleNamespace(
        ego=Straight(),
        T_body_cam=T_BODY_CAM,
        actors=actors,
        lane=SimpleNamespace(centre_m=lane, half_width_m=1.75, speed_m_s=SPEED_M_S),
        ground_height_m=lambda x, y: 0.0,
    )


def make_actor(id, x, y, label="car"):
    return SimpleNamespace(
        id=id,
        label=label,
        dimensions_m=(4.2, 1.8, 1.5),
        base_m=0.0,
        motion=Parked(x, y),
        parts=(),
        is_patched=False,
    )


@contextmanager
def open_plane_stage(scenario, world) -> Iterator[Stage]:
    weather = SimpleNamespace(visibility_m=None, is_dark=False)
    renderer = PlaneRenderer(world, scenario.camera_model())
    yield Stage(scenario, world, renderer, weather=weather, labels=label_of)


@pytest.fixture
def made():
    """A made world, and how to open a stage on it."""
    opened = []

    def open_stage(scenario, world):
        opened.append(True)
        return open_plane_stage(scenario, world)

    def scenario(**changes):
        values = {
            "width": 320,
            "height": 240,
            "frame_rate_hz": 10,
            "duration_s": 3.0,
            "field_of_view_deg": 75,
        }
        return Scenario.model_validate({**values, **changes})

    return SimpleNamespace(
        world=make_world(make_actor(3, 40.0, 4.0), make_actor(4, 60.0, -4.5, "truck")),
        make_world=make_world,
        make_actor=make_actor,
        open_stage=open_stage,
        scenario=scenario,
        opened=opened,
    )
