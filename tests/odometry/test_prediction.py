"""Equations (4) and (5)."""

import numpy as np
import pytest

from belie.geometry import SE3, CameraModel
from belie.odometry.prediction import constant_velocity, predict
from belie.types import MapPoints

PINHOLE = CameraModel(width=640, height=480, fx=500, fy=490, cx=319.5, cy=239.5)
DISTORTED = CameraModel(
    width=752, height=480, fx=460, fy=455, cx=370, cy=245, model="radial_tangential",
    distortion=(-0.29, 0.08, 1e-3, -5e-4),
)  # fmt: skip
FISHEYE = CameraModel(
    width=640, height=480, fx=250, fy=250, cx=319.5, cy=239.5, model="equidistant",
    distortion=(-0.02, 0.004, -0.003, 0.001),
)  # fmt: skip


def cloud(n=500, seed=0):
    rng = np.random.default_rng(seed)
    position_m = rng.uniform([-20, -10, -10], [20, 10, 40], (n, 3))
    level = rng.integers(0, 4, n).astype(np.int8)
    return MapPoints(position_m=position_m, level=level, distance_m=rng.uniform(1, 50, n))


def test_velocity_is_kept_in_the_moving_frame():
    step = SE3.exp([0.1, 0.0, 0.8, 0.0, 0.05, 0.0])  # a curve
    poses = [SE3.exp([1.0, 2.0, 3.0, 0.2, -0.4, 0.1])]
    for _ in range(4):
        poses.append(poses[-1] @ step)
    assert constant_velocity(poses[0], poses[1], 1.0).is_close(poses[2])
    assert constant_velocity(poses[0], poses[1], 2.0).is_close(poses[3])
    assert constant_velocity(poses[0], poses[2], 0.5).is_close(poses[3])


@pytest.mark.parametrize("camera", [PINHOLE, DISTORTED, FISHEYE])
def test_agrees_with_the_camera_model(camera):
    points, T_odom_cam = cloud(), SE3.exp([0.5, -0.2, 1.0, 0.05, 0.1, -0.02])
    found = predict(camera, T_odom_cam, points, 1.5)
    in_cam = T_odom_cam.inverse().apply(points.position_m)
    np.testing.assert_allclose(found.px, camera.project(in_cam[found.index]), atol=1e-6)
    assert 10 < len(found) < len(points)


@pytest.mark.parametrize("camera", [PINHOLE, DISTORTED])
def test_keeps_all_in_view_and_nothing_else(camera):
    points = cloud()
    found = predict(camera, SE3.identity(), points, 1.5)
    normalized = points.position_m[:, :2] / points.position_m[:, 2:]
    u, v = np.meshgrid(np.linspace(0, camera.width - 1, 40), np.linspace(0, camera.height - 1, 40))
    border = camera.normalize(np.column_stack([u.ravel(), v.ravel()]))
    # Inside for sure: within the largest rectangle that the image covers; outside for sure: beyond its hull.
    inner = np.array([[-0.55, -0.4], [0.55, 0.4]])
    sure = (points.position_m[:, 2] > 0.1) & (normalized > inner[0]).all(1) & (normalized < inner[1]).all(1)
    outside = (points.position_m[:, 2] <= 0) | (np.abs(normalized) > np.abs(border).max(0) + 0.01).any(1)
    assert set(np.flatnonzero(sure)) <= set(found.index.tolist())
    assert not set(np.flatnonzero(outside)) & set(found.index.tolist())


def test_nearer_points_appear_on_coarser_levels():
    points = MapPoints(position_m=[[0, 0, 10.0], [0, 0, 10.0]], level=[1, 1], distance_m=[15.0, 10.0])
    np.testing.assert_allclose(predict(PINHOLE, SE3.identity(), points, 1.5).level, [2.0, 1.0])


def test_empty_map():
    assert len(predict(PINHOLE, SE3.identity(), cloud(0), 1.5)) == 0
