"""Equation (2): enough corners, evenly spread, in every light, at bounded cost."""

import cv2
import numpy as np
import pytest

from belie.odometry import features
from belie.odometry.features import FeatureSettings, extract_features, image_pyramid

SETTINGS = FeatureSettings()


def scene(height=376, width=1241, contrast=1.0, seed=0):
    """Rectangles of many sizes: corners whose places are known to exist on every level."""
    rng = np.random.default_rng(seed)
    image = np.full((height, width), 120.0)
    for _ in range(700):
        x, y = rng.integers(0, width), rng.integers(0, height)
        w, h = rng.integers(6, 60, 2)
        image[y : y + h, x : x + w] = rng.uniform(0, 255)
    return np.clip(120 + contrast * (image - 120) + rng.normal(0, 0.7, image.shape), 0, 255).astype(np.uint8)


def occupied_share(features, width, height, cells=(6, 12)):
    row = (features.px[:, 1] / height * cells[0]).astype(int)
    column = (features.px[:, 0] / width * cells[1]).astype(int)
    return len(set(zip(row.tolist(), column.tolist(), strict=True))) / (cells[0] * cells[1])


def test_corners_lie_where_the_corners_are():
    image = np.full((200, 300), 50, np.uint8)
    image[60:140, 90:210] = 200
    noise = np.random.default_rng(0).normal(0, 0.5, image.shape)  # FAST drops corners whose scores tie
    image = np.clip(cv2.GaussianBlur(image, (3, 3), 0) + noise, 0, 255).astype(np.uint8)
    features = extract_features(image, SETTINGS)
    truth = np.array([(90, 60), (209, 60), (90, 139), (209, 139)])
    distance = np.linalg.norm(features.px[:, None] - truth[None], axis=2).min(axis=1)
    scale = SETTINGS.scale_factor ** features.level.astype(float)
    assert (distance <= 2.5 * scale).all()
    assert set(np.unique(features.level)) == {0, 1, 2, 3}  # the same corners on every level


def test_spread_is_even_and_bounded():
    features = extract_features(scene(), SETTINGS)
    assert 0.85 * SETTINGS.max_corners <= len(features) <= SETTINGS.max_corners
    assert occupied_share(features, 1241, 376) > 0.95


def test_one_rich_patch_does_not_starve_the_rest():
    image = scene(contrast=0.25)
    rng = np.random.default_rng(3)
    image[:180, :250] = rng.integers(0, 256, (180, 250))
    features = extract_features(image, SETTINGS)
    rich = (features.px[:, 0] < 250) & (features.px[:, 1] < 180)
    assert rich.mean() < 0.35
    assert occupied_share(features, 1241, 376) > 0.9


@pytest.mark.parametrize("contrast", [1.0, 0.3, 0.12])
def test_fog_lowers_the_threshold_not_the_number(contrast):
    first = extract_features(scene(contrast=contrast), SETTINGS)
    assert len(first) > 0.6 * SETTINGS.max_corners


def test_night_beside_a_lamp():
    image = scene(contrast=0.12)
    image[:, 900:] = scene(contrast=1.0)[:, 900:]
    features = extract_features(image, SETTINGS)
    assert (features.px[:, 0] < 850).sum() > 300


def test_blank_wall_gives_no_corners_from_noise():
    rng = np.random.default_rng(0)
    for sigma in (0.0, 0.7, 1.5):
        wall = np.clip(90 + rng.normal(0, sigma, (480, 752)), 0, 255).astype(np.uint8)
        assert len(extract_features(wall, SETTINGS)) <= 20


def test_steps_of_light_and_texture_are_survived():
    previous = extract_features(scene(contrast=0.1), SETTINGS)  # the tunnel
    rng = np.random.default_rng(5)
    rough = cv2.GaussianBlur(rng.integers(0, 256, (376, 1241)).astype(np.uint8), (3, 3), 0)
    for image in (rough, scene(), scene(contrast=0.1), scene()):
        features = extract_features(image, SETTINGS, previous=previous)
        assert 0.5 * SETTINGS.max_corners < len(features) <= SETTINGS.max_corners
        previous = features


def test_texture_does_not_explode_the_work(monkeypatch):
    """FAST's time follows the corners that it finds: the threshold must keep them bounded."""
    rng = np.random.default_rng(5)
    rough = cv2.GaussianBlur(rng.integers(0, 256, scene().shape).astype(np.uint8), (3, 3), 0)
    assert len(cv2.FastFeatureDetector.create(7, True).detect(rough)) > 15000
    found = []
    fast = features._fast

    def counted(*args):
        px = fast(*args)
        found.append(len(px))
        return px

    monkeypatch.setattr(features, "_fast", counted)

    def work(image, hint):
        found.clear()
        extract_features(image, SETTINGS, previous=hint)
        return sum(found)

    calm = work(scene(), extract_features(scene(), SETTINGS))
    fog = extract_features(scene(contrast=0.1), SETTINGS)
    assert work(rough, fog) < 10 * calm  # one image, until the threshold has followed
    assert work(rough, extract_features(rough, SETTINGS, previous=fog)) < 4 * calm


def test_occupied_points_are_left_alone_and_budget_is_kept():
    image = scene()
    tracks = extract_features(image, SETTINGS, max_corners=200).px
    assert 100 < len(tracks) <= 200
    fresh = extract_features(image, SETTINGS, occupied_px=tracks, max_corners=150)
    assert 75 < len(fresh) <= 150
    gaps = np.linalg.norm(fresh.px[:, None] - tracks[None], axis=2).min(axis=1)
    assert gaps.min() >= SETTINGS.occupied_spacing_px


def test_distinct_levels_gives_no_corner_twice():
    settings = FeatureSettings(distinct_levels=True, occupied_spacing_px=10.0)
    features = extract_features(scene(), settings)
    for level in range(1, settings.levels):
        finer, here = features.px[features.level < level], features.px[features.level == level]
        assert len(here) > 0
        assert np.linalg.norm(here[:, None] - finer[None], axis=2).min() >= 10.0


def test_same_image_same_corners():
    a, b = (extract_features(scene(), SETTINGS) for _ in range(2))
    np.testing.assert_array_equal(a.px, b.px)
    np.testing.assert_array_equal(a.thresholds, b.thresholds)


@pytest.mark.parametrize("shape", [(8, 8), (16, 400), (5, 5), (1, 1), (2, 900)])
def test_tiny_images_are_no_accident(shape):
    features = extract_features(np.random.default_rng(0).integers(0, 255, shape).astype(np.uint8), SETTINGS)
    assert len(features) <= SETTINGS.max_corners
    assert (features.px >= -1).all()


def test_zero_wanted_corners():
    assert len(extract_features(scene(), SETTINGS, max_corners=0)) == 0


def test_given_pyramid_is_used():
    image = scene()
    whole = extract_features(image, SETTINGS)
    layered = extract_features(image_pyramid(image, SETTINGS), SETTINGS)
    np.testing.assert_array_equal(whole.px, layered.px)


def test_repeats_on_a_real_road(data_dir):
    """Corners of one frame are found again in the next: what equation (6) lives on."""
    frames = [
        cv2.imread(str(data_dir / f"kitti00/image_0/{i:06d}.png"), cv2.IMREAD_GRAYSCALE) for i in (40, 41)
    ]
    first = extract_features(frames[0], SETTINGS)
    second = extract_features(frames[1], SETTINGS, previous=first)
    assert min(len(first), len(second)) > 0.95 * SETTINGS.max_corners
    assert occupied_share(first, frames[0].shape[1], frames[0].shape[0]) > 0.7
    start = first.px[first.level == 0].reshape(-1, 1, 2)
    end, good, _ = cv2.calcOpticalFlowPyrLK(frames[0], frames[1], start, None, maxLevel=4)
    end = end.reshape(-1, 2)[good.ravel() == 1]
    near = np.linalg.norm(end[:, None] - second.px[second.level <= 1][None], axis=2).min(axis=1) < 2.0
    assert near.mean() > 0.5
