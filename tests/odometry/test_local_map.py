"""Equation (3): the map is where the scene is, if the poses are true, and bent if they lie."""

import cv2
import numpy as np
import pytest

from belie.geometry import SE3, CameraModel
from belie.odometry.features import FeatureSettings, extract_features, image_pyramid
from belie.odometry.local_map import LocalMap, LocalMapSettings, triangulate_window
from belie.types import Keyframe

CAMERA = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
FEATURES = FeatureSettings()


def window(points, poses, rng=None, noise_px=0.0):
    """Keyframes that see the given points, with their rays."""
    keyframes, rays, sigmas = [], [], []
    for i, T_odom_cam in enumerate(poses):
        px = CAMERA.project(T_odom_cam.inverse().apply(points))
        px += 0 if rng is None else rng.normal(0, noise_px, px.shape)
        bearing = np.column_stack([CAMERA.normalize(px), np.ones(len(px))])
        rays.append(bearing / np.linalg.norm(bearing, axis=1, keepdims=True) @ T_odom_cam.R.T)
        sigmas.append(np.full(len(px), 1 / CAMERA.fx))
        keyframes.append(
            Keyframe(
                stamp_ns=i,
                T_odom_cam=T_odom_cam,
                px=px.astype(np.float32),
                level=np.zeros(len(px), np.int8),
                track=np.arange(len(px)),
            )
        )
    return keyframes, rays, sigmas


def test_window_of_true_poses_gives_the_scene():
    rng = np.random.default_rng(0)
    points = rng.uniform([-3, -2, 8], [3, 2, 20], (300, 3))
    poses = [SE3.exp([0.05 * i, 0.02 * i, 0.5 * i, 0, 0.01 * i, 0]) for i in range(5)]
    found = triangulate_window(*window(points, poses), LocalMapSettings(min_parallax_rad=1e-3))
    assert len(found) > 280
    gaps = np.linalg.norm(found.position_m[:, None] - points[None], axis=2).min(axis=1)
    assert gaps.max() < 1e-3  # px are float32
    last = np.linalg.norm(found.position_m - poses[-1].t, axis=1)
    np.testing.assert_allclose(found.distance_m, last)


def test_points_seen_once_are_left_out():
    points = np.array([[0.0, 0, 8], [1, 0, 9]])
    keyframes, rays, sigmas = window(points, [SE3.identity(), SE3.from_translation([0.5, 0, 0])])
    other = Keyframe(
        stamp_ns=1,
        T_odom_cam=keyframes[1].T_odom_cam,
        px=keyframes[1].px,
        level=keyframes[1].level,
        track=np.array([0, 77]),
    )
    found = triangulate_window([keyframes[0], other], rays, sigmas, LocalMapSettings())
    np.testing.assert_allclose(found.position_m, [[0.0, 0, 8]], atol=1e-4)


def test_gate_is_in_pixels():
    points = np.array([[0.0, 0, 8]])
    keyframes, rays, sigmas = window(points, [SE3.identity(), SE3.from_translation([0.5, 0, 0])])
    # Turn one ray by 2 px across the epipolar line; the midpoint shares it: 1 px off each.
    up = np.array([[0.0, 2 / CAMERA.fx, 0.0]])
    bent = rays[1] + up
    rays = [rays[0], bent / np.linalg.norm(bent)]
    assert len(triangulate_window(keyframes, rays, sigmas, LocalMapSettings(gate_px=1.1))) == 1
    assert len(triangulate_window(keyframes, rays, sigmas, LocalMapSettings(gate_px=0.9))) == 0


def wall_view(texture, T_wall_cam, distance_m=6.0):
    """A textured wall at z = distance, seen from a camera that looks along z."""
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))
    x = (u - CAMERA.cx) / CAMERA.fx * (distance_m - T_wall_cam.t[2]) + T_wall_cam.t[0]
    y = (v - CAMERA.cy) / CAMERA.fy * (distance_m - T_wall_cam.t[2]) + T_wall_cam.t[1]
    scale = 60.0  # texture pixels a metre
    row = np.clip(y * scale + 400, 0, texture.shape[0] - 2)
    column = np.clip(x * scale + 500, 0, texture.shape[1] - 2)
    return cv2.remap(texture, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR)


@pytest.fixture(scope="module")
def texture():
    rng = np.random.default_rng(0)
    image = np.full((800, 1000), 128, np.uint8)
    for _ in range(2500):
        x, y = int(rng.integers(0, 1000)), int(rng.integers(0, 800))
        w, h = rng.integers(4, 30, 2)
        cv2.rectangle(image, (x, y), (x + int(w), y + int(h)), int(rng.integers(0, 256)), -1)
    return cv2.GaussianBlur(image, (3, 3), 0)


def build(texture, true_poses, claimed_poses):
    local_map = LocalMap(CAMERA, LocalMapSettings(), FEATURES.scale_factor)
    reasons, features = [], None
    for i, (true, claimed) in enumerate(zip(true_poses, claimed_poses, strict=True)):
        pyramid = image_pyramid(wall_view(texture, true), FEATURES)
        features = extract_features(pyramid, FEATURES, previous=features)
        reasons.append(local_map.observe(i, pyramid, features, claimed))
    return local_map, reasons


def test_maps_a_wall_from_images(texture):
    poses = [SE3.from_translation([0.15 * i, 0.0, 0.0]) for i in range(6)]
    local_map, reasons = build(texture, poses, poses)
    assert reasons[0] == "first keyframe"
    assert sum(r is not None for r in reasons) >= 3
    assert len(local_map.points) > 200
    depth = local_map.points.position_m[:, 2]
    assert abs(np.median(depth) - 6.0) < 0.1
    assert np.mean(np.abs(depth - 6.0) < 0.5) > 0.8


def test_a_lie_about_the_scale_bends_the_map(texture):
    poses = [SE3.from_translation([0.15 * i, 0.0, 0.0]) for i in range(6)]
    lies = [SE3.from_translation([0.3 * i, 0.0, 0.0]) for i in range(6)]
    local_map, _ = build(texture, poses, lies)
    assert abs(np.median(local_map.points.position_m[:, 2]) - 12.0) < 0.4


def test_standing_still_keeps_map_and_keyframes(texture):
    poses = [SE3.from_translation([0.15 * i, 0.0, 0.0]) for i in range(6)]
    poses += [poses[-1]] * 8
    local_map, reasons = build(texture, poses, poses)
    assert all(r is None for r in reasons[-7:])
    assert len(local_map.points) > 200


def test_clear_forgets(texture):
    poses = [SE3.from_translation([0.15 * i, 0.0, 0.0]) for i in range(3)]
    local_map, _ = build(texture, poses, poses)
    local_map.clear()
    assert len(local_map.points) == 0
