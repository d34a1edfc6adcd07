"""Θ of equation (6) against two independent optimisers, and against the truth."""

import numpy as np
import poselib
import pytest
from scipy.optimize import least_squares

from belie.geometry import SE3, CameraModel
from belie.odometry.optimization import OptimizationSettings, optimize_pose

SETTINGS = OptimizationSettings(max_iterations=60, convergence=1e-13)
PINHOLE = CameraModel(width=1241, height=376, fx=718.9, fy=718.9, cx=607.2, cy=185.2)
DISTORTED = CameraModel(
    width=752, height=480, fx=460, fy=455, cx=370, cy=245, model="radial_tangential",
    distortion=(-0.29, 0.08, 1e-3, -5e-4),
)  # fmt: skip
FISHEYE = CameraModel(
    width=640, height=480, fx=250, fy=250, cx=319.5, cy=239.5, model="equidistant",
    distortion=(-0.02, 0.004, -0.003, 0.001),
)  # fmt: skip


def pairs(camera, seed=0, n=600, outliers=0.15, levels=False):
    """Noisy pairs of a known pose, some of them wrong."""
    rng = np.random.default_rng(seed)
    px = rng.uniform([20, 20], [camera.width - 21, camera.height - 21], (n, 2))
    depth_m = rng.uniform(4, 50, n)
    in_cam = np.column_stack([camera.normalize(px), np.ones(n)]) * depth_m[:, None]
    T_odom_cam = SE3.exp([3.0, -1.0, 20.0, 0.1, 0.6, -0.05])
    sigma = 1.5 ** rng.integers(0, 4, n) if levels else np.ones(n)
    observed = camera.project(in_cam) + rng.normal(0, 0.7, (n, 2)) * sigma[:, None]
    wrong = rng.random(n) < outliers
    observed[wrong] += rng.uniform(-15, 15, (wrong.sum(), 2)) * sigma[wrong, None]
    guess = T_odom_cam @ SE3.exp([0.15, -0.1, 0.25, 0.01, -0.012, 0.006])
    return T_odom_cam, guess, T_odom_cam.apply(in_cam), observed, sigma


def difference(a, b):
    """(degrees, metres) between two poses."""
    xi = (a.inverse() @ b).log()
    return np.degrees(np.linalg.norm(xi[3:])), np.linalg.norm(a.t - b.t)


def by_poselib(camera, guess, points, observed, delta):
    start = poselib.CameraPose()
    start.R, start.t = guess.inverse().R, guess.inverse().t
    model = {"model": "PINHOLE", "width": camera.width, "height": camera.height,
             "params": [camera.fx, camera.fy, camera.cx, camera.cy]}  # fmt: skip
    options = {"loss_type": "HUBER", "loss_scale": delta, "max_iterations": 500,
               "gradient_tol": 1e-14, "step_tol": 1e-14}  # fmt: skip
    pose, _ = poselib.refine_absolute_pose(observed, points, start, model, options)
    return SE3.from_matrix(np.column_stack([pose.R, pose.t])).inverse()


def by_scipy(camera, guess, points, observed, sigma, delta):
    def whitened_norms(xi):
        cam = (guess @ SE3.exp(xi)).inverse().apply(points)
        return np.linalg.norm((camera.project(cam) - observed) / sigma[:, None], axis=1)

    # One residual a point, its norm: SciPy's Huber then is the Huber of the point, as ours.
    found = least_squares(whitened_norms, np.zeros(6), loss="huber", f_scale=delta, xtol=1e-14, ftol=1e-14,
                          gtol=1e-14, max_nfev=500)  # fmt: skip
    return guess @ SE3.exp(found.x), 2.0 * found.cost


def assert_same(a, b):
    degrees, metres = difference(a, b)
    assert degrees < 1e-3, degrees
    assert metres < 1e-3, metres


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("outliers", [0.0, 0.15, 0.4])
def test_agrees_with_poselib(seed, outliers):
    _, guess, points, observed, sigma = pairs(PINHOLE, seed, outliers=outliers)
    ours = optimize_pose(PINHOLE, guess, points, observed, sigma, SETTINGS)
    assert_same(ours.T_odom_cam, by_poselib(PINHOLE, guess, points, observed, SETTINGS.huber_sigma))


@pytest.mark.parametrize("camera", [PINHOLE, DISTORTED, FISHEYE], ids=["pinhole", "distorted", "fisheye"])
def test_agrees_with_scipy_on_levels_and_lenses(camera):
    _, guess, points, observed, sigma = pairs(camera, 3, levels=True)
    ours = optimize_pose(camera, guess, points, observed, sigma, SETTINGS)
    theirs, _ = by_scipy(camera, guess, points, observed, sigma, SETTINGS.huber_sigma)
    assert_same(ours.T_odom_cam, theirs)


def test_default_settings_have_converged():
    """The stop of the default settings is no looser than the promise of 1e-3 deg and 1 mm."""
    for seed in range(5):
        _, guess, points, observed, sigma = pairs(PINHOLE, seed, levels=True)
        quick = optimize_pose(PINHOLE, guess, points, observed, sigma, OptimizationSettings())
        assert_same(
            quick.T_odom_cam, optimize_pose(PINHOLE, guess, points, observed, sigma, SETTINGS).T_odom_cam
        )


def test_error_is_the_mean_over_all_pairs_by_level_variance():
    _, guess, points, observed, sigma = pairs(PINHOLE, 2, levels=True)
    ours = optimize_pose(PINHOLE, guess, points, observed, sigma, SETTINGS)
    miss = PINHOLE.project(ours.T_odom_cam.inverse().apply(points)) - observed
    chi2 = (miss**2).sum(1) / sigma**2
    np.testing.assert_allclose(ours.chi2, chi2, rtol=1e-6, atol=1e-9)
    assert ours.error_px2 == pytest.approx(chi2.mean())
    clean = optimize_pose(PINHOLE, *pairs(PINHOLE, 2, outliers=0.0, levels=True)[1:], SETTINGS)
    assert clean.error_px2 == pytest.approx(2 * 0.7**2, rel=0.15)  # two coordinates of 0.7 px


def test_covariance_is_honest():
    """Over many draws the pose error, weighed by the covariance, is chi2 with six degrees of freedom."""
    scores = []
    for seed in range(60):
        truth, guess, points, observed, sigma = pairs(PINHOLE, seed, n=200, outliers=0.0)
        found = optimize_pose(PINHOLE, guess, points, observed, sigma, SETTINGS)
        xi = (found.T_odom_cam.inverse() @ truth).log()
        scores.append(xi @ np.linalg.solve(found.covariance * 0.7**2, xi))
    assert 4.5 < np.mean(scores) < 7.5


def test_unobservable_directions_are_said_to_be():
    """Points at infinity: rotation is known, translation is not."""
    rng = np.random.default_rng(0)
    points = rng.uniform([-4, -2, 8], [4, 2, 10], (100, 3)) * 1e6
    observed = PINHOLE.project(points)
    found = optimize_pose(PINHOLE, SE3.identity(), points, observed, np.ones(100), SETTINGS)
    spread = np.sqrt(np.diag(found.covariance))
    assert spread[:3].min() > 1e2
    assert spread[3:].max() < 1.0


def test_survives_a_hopeless_start():
    _, guess, points, observed, sigma = pairs(PINHOLE, 1)
    far = guess @ SE3.exp([0.0, 0.0, 60.0, 0.0, 1.5, 0.0])
    found = optimize_pose(PINHOLE, far, points, observed, sigma, SETTINGS)
    assert np.isfinite(found.T_odom_cam.matrix()).all()
    assert np.isfinite(found.covariance).all()


def test_refuses_too_few_or_unequal_arrays():
    with pytest.raises(ValueError, match="three pairs"):
        optimize_pose(PINHOLE, SE3.identity(), np.ones((2, 3)), np.ones((2, 2)), np.ones(2), SETTINGS)
    with pytest.raises(ValueError, match="equal number"):
        optimize_pose(PINHOLE, SE3.identity(), np.ones((9, 3)), np.ones((8, 2)), np.ones(9), SETTINGS)
