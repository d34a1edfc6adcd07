"""Who agrees on a motion: traffic along the road says nothing against the direction, but all the more of the length."""

import numpy as np
import pytest

from belie.geometry import SE3, so3_log
from belie.odometry.agreement import agreement, stretched, sureness_of
from belie.odometry.first_baseline import first_baseline
from belie.odometry.pose_covariance import PoseCovariance
from belie.odometry.relative_pose import estimate_relative_pose

SIGMA = 1e-3  # focal lengths
AHEAD = SE3.exp([0.02, 0.0, -1.0, 0.0, 0.01, 0.0])  # T_cur_prev


def seen(points, motion, rng):
    moved = motion.apply(points)
    return moved[:, :2] / moved[:, 2:] + rng.normal(0.0, SIGMA, (len(points), 2))


def scene(n, rng):
    return np.column_stack([rng.uniform(-6, 6, n), rng.uniform(-3, 3, n), rng.uniform(6, 30, n)])


def road(standing, overtaking, rng):
    """A scene, and traffic that overtakes on a parallel course; corners in both images, and the true 1/Z."""
    points = scene(standing + overtaking, rng)
    faster = SE3(AHEAD.R, -0.8 * AHEAD.t)
    current = np.concatenate([seen(points[:standing], AHEAD, rng), seen(points[standing:], faster, rng)])
    return points[:, :2] / points[:, 2:], current, 1.0 / points[:, 2]


def test_overtaking_traffic_speaks_of_the_length_only():
    rng = np.random.default_rng(0)
    previous, current, rho = road(80, 40, rng)
    pose = estimate_relative_pose(previous, current, rho, np.full(120, 1e-8), AHEAD, sigma=SIGMA)
    assert pose.inliers[:80].mean() > 0.9
    assert pose.neutral[80:].mean() > 0.8
    assert agreement(pose) > 0.9
    sureness = sureness_of(agreement(pose))
    wider = np.diag(stretched(pose.covariance, pose, sureness)) / np.diag(pose.covariance)
    assert wider[2] > 3.0  # along the road
    assert wider[0] < 1.1
    assert wider[3:] == pytest.approx(1.0)


def test_a_map_is_made_only_where_most_tell_which_way():
    rng = np.random.default_rng(1)
    for standing, overtaking, makes_a_map in ((100, 20, True), (60, 55, False)):
        previous, current, _ = road(standing, overtaking, rng)
        first = first_baseline(previous, current, SIGMA, 0.03, 1.0)
        assert first is not None
        assert first.makes_a_map is makes_a_map
        if makes_a_map:
            assert first.pose.T_cur_prev.t[2] < -0.99


@pytest.mark.parametrize("outliers", [0.0, 0.15, 0.3])
def test_rotations_are_off_by_what_is_stated(outliers):
    rng = np.random.default_rng(2)
    normalised = []
    for _ in range(80):
        points = scene(150, rng)
        current = seen(points, AHEAD, rng)
        astray = rng.random(150) < outliers
        current[astray] += rng.uniform(-0.05, 0.05, (int(astray.sum()), 2))
        previous, rho = points[:, :2] / points[:, 2:], 1.0 / points[:, 2]
        pose = estimate_relative_pose(previous, current, rho, np.full(150, 1e-4), AHEAD, sigma=SIGMA)
        C = PoseCovariance(1).update(previous, current, pose, SIGMA) / sureness_of(agreement(pose)) ** 2
        error = so3_log(AHEAD.R @ pose.T_cur_prev.R.T)
        normalised.append(error @ np.linalg.solve(C[3:, 3:], error) / 3.0)
    assert 0.2 < np.sqrt(np.mean(normalised)) < 1.2
