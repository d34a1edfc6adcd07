"""The N-view midpoint: exact without noise, near the optimum with it, and its three gates."""

import numpy as np

from belie.geometry import triangulate_rays


def rays_to(points, centres):
    """Two or more observations a point, in the layout of `triangulate_rays`."""
    ways = points[:, None] - centres[None]
    rays = ways / np.linalg.norm(ways, axis=2, keepdims=True)
    starts = np.arange(len(points) + 1) * len(centres)
    return np.tile(centres, (len(points), 1)), rays.reshape(-1, 3), starts


def test_recovers_points_from_exact_rays():
    points = np.random.default_rng(0).uniform([-5, -3, 5], [5, 3, 30], (200, 3))
    for views in (2, 3, 5):
        centres = np.linspace([0, 0, 0], [1.5, 0.2, 1.0], views)
        c, r, s = rays_to(points, centres)
        found, accepted = triangulate_rays(c, r, s, 1e-3, np.full(len(c), 1e-3))
        assert accepted.all()
        np.testing.assert_allclose(found, points, atol=1e-8)


def test_more_views_help_against_noise():
    rng = np.random.default_rng(1)
    points = rng.uniform([-3, -2, 6], [3, 2, 12], (400, 3))
    errors = []
    for views in (2, 5):
        c, r, s = rays_to(points, np.linspace([0, 0, 0], [1.0, 0, 0], views))
        noisy = r + rng.normal(0, 1e-3, r.shape)
        noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
        found, accepted = triangulate_rays(c, noisy, s, 1e-3, np.full(len(c), 0.02))
        assert accepted.mean() > 0.99
        errors.append(np.median(np.linalg.norm(found - points, axis=1)[accepted]))
    assert errors[1] < errors[0] < 0.25


def test_refuses_parallel_rays():
    centres, rays, starts = rays_to(np.array([[0.0, 0, 1000]]), np.array([[0.0, 0, 0], [1, 0, 0]]))
    _, accepted = triangulate_rays(centres, rays, starts, 0.005, np.full(2, 0.1))
    assert not accepted[0]
    same = np.array([[0.0, 0, 1], [0, 0, 1]])
    assert not triangulate_rays(centres, same, starts, 0.0, np.full(2, 0.1))[1][0]


def test_refuses_points_behind_the_camera():
    centres, rays, starts = rays_to(np.array([[0.0, 0, 5]]), np.array([[0.0, 0, 0], [1, 0, 0]]))
    _, accepted = triangulate_rays(centres, -rays, starts, 0.005, np.full(2, 0.1))
    assert not accepted[0]


def test_gate_is_the_angle_off_the_ray():
    centres = np.array([[0.0, 0, 0], [1, 0, 0]])
    rays = np.array([[0.0, 0.01, 1], [-0.1, -0.01, 1]])  # skew: both 0.01 rad off the midpoint
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    starts = np.array([0, 2])
    assert triangulate_rays(centres, rays, starts, 0.005, np.full(2, 0.012))[1][0]
    assert not triangulate_rays(centres, rays, starts, 0.005, np.full(2, 0.008))[1][0]


def test_one_observation_is_no_point():
    one = np.array([[0.0, 0, 1]])
    _, accepted = triangulate_rays(np.zeros((1, 3)), one, np.array([0, 1]), 0.0, np.ones(1))
    assert not accepted[0]
