import cv2
import numpy as np
import pytest

from belie.odometry.tracking import TrackingSettings, build_pyramid, track

from .scenes import texture


@pytest.fixture(scope="module")
def image():
    return texture(3, 300)


def shifted(image, dx, dy):
    M = np.float32([[1, 0, dx], [0, 1, dy]])
    return cv2.warpAffine(image, M, image.shape[::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


def grid(image, margin=60, step=30):
    y, x = np.mgrid[margin : image.shape[0] - margin : step, margin : image.shape[1] - margin : step]
    return np.column_stack([x.ravel(), y.ravel()]).astype(float)


@pytest.mark.parametrize("motion", [(0.3, -0.4), (5.2, 3.7), (-17.6, 9.1)])
def test_subpixel_motion_is_found(image, motion):
    points = grid(image)
    settings = TrackingSettings()
    a, b = build_pyramid(image, 4), build_pyramid(shifted(image, *motion), 4)
    found, verified = track(a, b, points, points, settings)
    assert verified.mean() > 0.9
    assert np.abs(np.median(found[verified] - points[verified], axis=0) - motion).max() < 0.05


def test_exposure_does_not_matter(image):
    points = grid(image)
    darker = np.clip(shifted(image, 2.0, 1.0) * 0.5 + 30, 0, 255).astype(np.uint8)
    found, verified = track(
        build_pyramid(image, 3), build_pyramid(darker, 3), points, points, TrackingSettings()
    )
    assert verified.mean() > 0.9
    assert np.abs(np.median(found[verified] - points[verified], axis=0) - (2.0, 1.0)).max() < 0.1


def test_what_is_not_there_is_not_verified(image):
    points = grid(image)
    _, verified = track(
        build_pyramid(image, 3), build_pyramid(texture(99, 300), 3), points, points, TrackingSettings()
    )
    # smooth blobs resemble each other; the geometry must refuse the rest
    assert verified.mean() < 0.2


def test_blank_patches_and_points_outside_are_not_verified():
    blank = np.full((100, 100), 90, np.uint8)
    points = np.array([[50.0, 50.0], [2.0, 2.0], [-5.0, 400.0], [np.nan, 3.0]])
    _, verified = track(build_pyramid(blank, 2), build_pyramid(blank, 2), points, points, TrackingSettings())
    assert not verified.any()


def test_a_patch_of_an_edge_is_not_followed():
    step = np.zeros((80, 80), np.uint8)
    step[:, 40:] = 120
    corner = step.copy()
    corner[40:] = 0
    s = TrackingSettings(levels=2)
    start = np.array([[39.5, 39.5]])
    for image, followed in ((step, False), (corner, True)):
        noisy = np.clip(image + np.random.default_rng(0).normal(20.0, 4.0, image.shape), 0, 255).astype(
            np.uint8
        )
        pyramid = build_pyramid(noisy, 2)
        assert track(pyramid, pyramid, start, start, s)[1].all()  # there is enough contrast for both
        assert track(pyramid, pyramid, start, start, s, harris=0.04)[1].all() == followed
