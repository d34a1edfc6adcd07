"""Corners compared with corners: right where texture is distinct, silent where it repeats."""

import cv2
import numpy as np

from belie.odometry.correspondence import CorrespondenceSettings, correspond, describe
from belie.odometry.features import FeatureSettings, extract_features, image_pyramid

FEATURES = FeatureSettings(max_corners=400)
SETTINGS = CorrespondenceSettings()


def texture(seed=0, shape=(300, 500)):
    """Noise of three scales, as stone or leaves have it: every patch is its own."""
    rng = np.random.default_rng(seed)
    layers = [cv2.GaussianBlur(rng.normal(0, 1, shape), (0, 0), sigma) * sigma for sigma in (1.5, 4, 10)]
    return np.clip(128 + 60 * sum(layers), 0, 255).astype(np.uint8)


def partners(before, after, radius_px=60.0):
    a, b = extract_features(before, FEATURES), extract_features(after, FEATURES)
    patches = [describe(image_pyramid(i, FEATURES), f, 1.5) for i, f in ((before, a), (after, b))]
    return a, b, correspond(a.px, a.level, patches[0], b, patches[1], radius_px, SETTINGS)


def test_finds_a_shift_under_a_change_of_exposure():
    image = texture()
    a, b, partner = partners(image, (0.6 * np.roll(image, (4, 17), axis=(0, 1)) + 30).astype(np.uint8))
    found = partner >= 0
    assert found.mean() > 0.4
    moved = b.px[partner[found]] - a.px[found]
    right = np.linalg.norm(moved - (17, 4), axis=1) < 4.0
    assert right.mean() > 0.95


def test_pairs_are_one_to_one():
    image = texture()
    _, _, partner = partners(image, np.roll(image, 9, axis=1))
    used = partner[partner >= 0]
    assert len(used) == len(set(used.tolist()))


def test_a_different_image_has_few_partners():
    _, _, partner = partners(texture(0), texture(1))
    assert (partner >= 0).mean() < 0.1


def test_repeated_texture_is_refused():
    tile = texture(2, (60, 50))
    noise = np.random.default_rng(0).normal(0, 1.0, (300, 500))
    wall = np.clip(np.tile(tile, (5, 10)) + noise, 0, 255).astype(np.uint8)
    _, _, partner = partners(wall, np.roll(wall, 12, axis=1), radius_px=120.0)
    assert (partner >= 0).mean() < 0.15


def test_beyond_the_radius_nothing_is_found():
    image = texture()
    a, b, partner = partners(image, np.roll(image, 80, axis=1), radius_px=30.0)
    moved = np.abs(b.px[partner[partner >= 0]] - a.px[partner >= 0])
    assert (moved <= 30.0).all()


def test_nothing_on_either_side():
    blank = np.full((300, 500), 80, np.uint8)
    assert len(partners(blank, texture())[2]) == 0
    assert (partners(texture(), blank)[2] == -1).all()
