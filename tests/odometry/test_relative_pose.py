import numpy as np
import poselib
import pytest

from belie.geometry import SE3, so3_log
from belie.odometry.relative_pose import estimate_relative_pose, straightened
from belie.odometry.two_view import relative_pose_from_scratch, rotation_between

TRUTH = SE3.exp([0.05, 0.0, -0.8, 0.002, 0.02, 0.001])


def pairs(seed, n=300, noise=3e-4, outliers=0.0, truth=TRUTH):
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-6, 6, (n, 2)), rng.uniform(4, 40, n)])
    moved = truth.apply(points)
    a = points[:, :2] / points[:, 2:]
    b = moved[:, :2] / moved[:, 2:] + rng.normal(0, noise, (n, 2))
    bad = rng.random(n) < outliers
    b[bad] += rng.uniform(-0.1, 0.1, (int(bad.sum()), 2))
    return a, b, 1.0 / points[:, 2], truth


@pytest.mark.parametrize("outliers", [0.0, 0.3])
def test_known_depths_give_the_full_motion(outliers):
    a, b, rho, truth = pairs(1, outliers=outliers)
    pose = estimate_relative_pose(a, b, rho, (0.01 * rho) ** 2, SE3.identity(), sigma=3e-4)
    error = (pose.T_cur_prev @ truth.inverse()).log()
    assert np.linalg.norm(error[:3]) < 0.02
    assert np.degrees(np.linalg.norm(error[3:])) < 0.02


def test_unknown_depths_give_what_poselib_gives():
    a, b, rho, _ = pairs(2, outliers=0.2)
    typical = np.full(len(a), np.median(rho))
    start = SE3(np.eye(3), np.array([0.0, 0.0, -0.8]))
    pose = estimate_relative_pose(a, b, typical, (10 * typical) ** 2, start, sigma=3e-4, fix_length=True)
    camera = {"model": "SIMPLE_PINHOLE", "width": 1, "height": 1, "params": [1.0, 0.0, 0.0]}
    other, _ = poselib.estimate_relative_pose(a, b, camera, camera, {"max_epipolar_error": 1e-3}, {})
    assert np.degrees(np.linalg.norm(so3_log(pose.T_cur_prev.R @ other.R.T))) < 0.03
    direction = pose.T_cur_prev.t / np.linalg.norm(pose.T_cur_prev.t)
    assert np.degrees(np.arccos(direction @ other.t / np.linalg.norm(other.t))) < 0.5
    assert np.linalg.norm(pose.T_cur_prev.t) == pytest.approx(0.8, rel=1e-6)


def test_covariance_tells_the_error_that_is_made():
    whitened = []
    for seed in range(60):
        a, b, rho, truth = pairs(seed, n=150)
        pose = estimate_relative_pose(a, b, rho, (1e-4 * rho) ** 2, truth, sigma=3e-4)
        error = (truth @ pose.T_cur_prev.inverse()).log()
        whitened.append(error @ np.linalg.solve(pose.covariance, error))
    # chi2 with six degrees of freedom has mean 6; the robust kernel costs a little information
    assert 4.0 < np.mean(whitened) < 9.0


def test_wrong_depth_priors_do_not_make_the_scale_creep():
    """Were the depths' covariance part of the cost, longer translations would look more likely."""
    ratios = []
    for seed in range(20):
        a, b, rho, truth = pairs(seed)
        rng = np.random.default_rng(100 + seed)
        # what a filter holds: the truth scatters about the prior
        prior = rho / (1.0 + rng.normal(0, 0.1, len(rho)))
        pose = estimate_relative_pose(a, b, prior, (0.1 * prior) ** 2, truth, sigma=3e-4)
        ratios.append(np.linalg.norm(pose.T_cur_prev.t) / np.linalg.norm(truth.t))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.01)


def test_scratch_finds_a_road_scene_with_far_points():
    a, b, _, truth = pairs(3, outliers=0.2)
    found = relative_pose_from_scratch(a, b, 3e-4)
    assert np.degrees(np.arccos(found.t @ truth.t / np.linalg.norm(truth.t))) < 3.0


def test_scratch_refuses_unrelated_points():
    rng = np.random.default_rng(0)
    assert relative_pose_from_scratch(rng.normal(size=(8, 2)), rng.normal(size=(8, 2)), 1e-3) is None


def test_rotation_between_survives_outliers():
    truth = SE3.exp([0, 0, 0, 0.01, -0.02, 0.005])
    a, b, _, _ = pairs(4, outliers=0.3, truth=truth)
    R, parallax = rotation_between(a, b, 3e-4)
    assert np.degrees(np.linalg.norm(so3_log(R @ truth.R.T))) < 0.02
    assert np.median(parallax) < 2e-3


def depths_by(motion, a, b):
    """Inverse depths by which `motion` carries a to b as well as it can, along the epipolar lines."""
    rotated = np.column_stack([a, np.ones(len(a))]) @ motion.R.T
    cross = np.cross(np.column_stack([b, np.ones(len(b))]), np.broadcast_to(motion.t, (len(b), 3)))
    away = np.cross(rotated, np.column_stack([b, np.ones(len(b))]))
    return np.maximum((cross * away).sum(axis=1) / (cross**2).sum(axis=1), 1e-3)


def yaw_left(straighten, rounds=8):
    """Error of the yaw, of what it was, when again and again a map is made with the motion that it calls for."""
    rng = np.random.default_rng(3)
    # Fog: nothing is far away, and most corners lie near the horizon, where the epipolar lines are level.
    points = np.column_stack([rng.uniform(-8, 8, 150), rng.normal(0, 0.7, 150), rng.uniform(8, 25, 150)])
    truth = SE3.exp([0.0, 0.0, -0.8, 0.0, 0.0, 0.0])
    off = SE3.exp([0.0, 0.0, 0.0, 0.0, np.radians(0.2), 0.0])
    motion, moved = off @ truth, truth.apply(points)
    a, b = points[:, :2] / points[:, 2:], moved[:, :2] / moved[:, 2:]
    for _ in range(rounds):
        rho = depths_by(motion, a, b)
        noisy = b + rng.normal(0, 5e-4, b.shape)
        pose = estimate_relative_pose(a, noisy, rho, (0.03 * rho) ** 2, motion, sigma=5e-4)
        if straighten:
            pose = straightened(pose, a, noisy, rho, (0.03 * rho) ** 2, sigma=5e-4)
        motion = pose.T_cur_prev
    assert np.linalg.norm(motion.t) == pytest.approx(0.8, rel=0.1)  # the map's scale
    return abs(float(so3_log((motion @ truth.inverse()).R)[1])) / np.radians(0.2)


def test_a_bent_map_does_not_keep_the_motion_that_bent_it():
    assert yaw_left(straighten=True) < 0.2
    assert yaw_left(straighten=False) > 2.0 * yaw_left(straighten=True)
