"""Objects' windows: one kernel does what the image's own stages do, step by step."""

import cv2
import numpy as np
import pytest

from belie.odometry.local_features import ImageStack, View, Window, window_of
from belie.odometry.local_matching import match_corners
from belie.odometry.tracking import TrackingSettings, build_pyramid, track


def _textured(height: int, width: int, seed: int = 0) -> np.ndarray:
    coarse = np.random.default_rng(seed).integers(0, 256, (height // 6 + 1, width // 6 + 1), np.uint8)
    return np.ascontiguousarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC))


@pytest.mark.parametrize("box", [[90, 60, 154, 124], [30, 100, 290, 150], [-20, 20, 30, 130]])
def test_a_view_holds_the_pyramid_and_the_contrast_of_its_window(box: list[float]) -> None:
    stack = ImageStack(_textured(200, 320))
    window = window_of(np.array(box, dtype=float))
    view, picture = View.of(stack, window), window.cut(stack)
    made = [each for each in view.pictures if each.size]
    assert [a.tolist() for a in made] == [a.tolist() for a in build_pyramid(picture, 3)]
    m = int(0.2 * min(picture.shape))
    assert view.contrast == pytest.approx(float(picture[m:-m, m:-m].std()))


def test_corners_are_matched_as_the_image_s_own_are() -> None:
    rng, settings = np.random.default_rng(1), TrackingSettings(min_eigenvalue=1.0)
    image = _textured(240, 320)
    moved = cv2.warpAffine(image, np.array([[1.02, 0.0, 1.3], [0.0, 1.02, -2.1]]), (320, 240))
    other = np.where(np.arange(320) < 150, _textured(240, 320, seed=5), moved).astype(
        np.uint8
    )  # its left half is gone
    window = window_of(np.array([110.0, 80.0, 190.0, 160.0]))
    before, after = View.of(ImageStack(image), window), View.of(ImageStack(other), window)
    start = rng.uniform(30.0, 86.0, (24, 2))
    found, agreeing, votes, _, _ = match_corners(
        before.pictures, after.pictures, start, np.zeros(24, bool), settings.iterations, 0.75, 1.0
    )
    pyramids = [build_pyramid(view.pictures[0], 3) for view in (before, after)]
    expected, verified = track(*pyramids, start, start, settings)
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert 3 < agreeing.sum() == votes <= verified.sum() < 24
    assert not agreeing[~verified].any()


def test_leads_alone_say_how_an_object_moves() -> None:
    image, rows = _textured(240, 320), np.arange(240)[:, None]
    middle = (rows >= 105) & (rows < 135)  # of the object: goes to the left, while all else goes to the right
    bands = np.where(middle, np.roll(image, -3, axis=1), np.roll(image, 3, axis=1))
    window = window_of(np.array([110.0, 80.0, 190.0, 160.0]))
    views = [View.of(ImageStack(each), window).pictures for each in (image, bands)]
    px = np.array([[x, y] for x in np.linspace(112.0, 188.0, 8) for y in (90.0, 120.0, 150.0)])
    start, s = window.to_window(px), TrackingSettings()
    leads = px[:, 1] == 120.0
    for which, shift in ((np.zeros(24, bool), 3.0), (leads, -3.0)):
        found, agreeing, votes, _, _ = match_corners(
            *views, start, which, s.iterations, s.min_correlation, 1.0
        )
        assert votes >= 6
        moved = (found - start)[agreeing, 0] / window.scale
        assert np.median(moved) == pytest.approx(shift, abs=0.2)


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (2, 2)])
def test_a_window_of_a_tiny_image_shows_its_border_on_all_sides(shape: tuple[int, int]) -> None:
    image = np.full(shape, 90, np.uint8)
    image[0, 0] = 30
    picture = Window(np.array([0.5, 0.5]), 1.0, (31, 31)).cut(ImageStack(image))
    expected = cv2.copyMakeBorder(image, 15, 15, 15, 15, cv2.BORDER_REPLICATE)[:31, :31]
    assert picture.tolist() == expected.tolist()
