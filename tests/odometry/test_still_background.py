"""The background of a standing camera: when there is one, and what differs from it."""

import numpy as np
import pytest

from belie.geometry import SE3
from belie.odometry.local_features import ImageStack
from belie.odometry.still_background import NO_DIFFERENCE, StillBackground, without_boxes
from belie.types import VisualEstimate

HALF_S = 500_000_000
WALL = np.random.default_rng(3).integers(60, 120, (120, 160)).astype(np.uint8)


def estimate(
    turn_rad: float = 0.0, parallax_px: float = 0.02, inliers: int = 80, previous_ns: int = 0
) -> VisualEstimate:
    return VisualEstimate(
        stamp_ns=previous_ns + 1, previous_stamp_ns=previous_ns,
        T_prev_cur=SE3.exp([0, 0, 0, 0, turn_rad, 0]), covariance=np.eye(6) * 1e-8,
        corners=99, matches=99, inliers=inliers, parallax_px=parallax_px,
    )  # fmt: skip


def stood(images: int = 6, seen: VisualEstimate | None = None) -> StillBackground:
    background = StillBackground(focal_px=300.0)
    for k in range(images):
        background.see(ImageStack(WALL), seen or estimate(), k * HALF_S)
    return background


def test_needs_five_images_half_a_second_apart() -> None:
    assert stood(5).difference() is None
    assert stood(6).difference() is not None
    fast = StillBackground(focal_px=300.0)
    for k in range(12):
        fast.see(ImageStack(WALL), estimate(), k * HALF_S // 5)
    assert fast.difference() is None


@pytest.mark.parametrize(
    "moved", [estimate(turn_rad=0.01), estimate(parallax_px=1.0), estimate(inliers=0), None]
)
def test_ends_when_the_camera_moves_or_does_not_know(moved: VisualEstimate | None) -> None:
    background = stood()
    background.see(ImageStack(WALL), moved, 10 * HALF_S)
    assert background.difference() is None


def test_ends_where_nobody_tells_of_all_of_its_motion() -> None:
    """Images that were not fit to judge by are not shown to it; the camera may have moved in them."""
    background = stood()
    background.see(ImageStack(WALL), estimate(previous_ns=5 * HALF_S), 6 * HALF_S)
    assert background.difference() is not None
    background.see(ImageStack(WALL), estimate(previous_ns=8 * HALF_S), 9 * HALF_S)
    assert background.difference() is None


def test_begins_anew_after_a_turn() -> None:
    """How far the camera turned before it stopped does not matter."""
    background = StillBackground(focal_px=300.0)
    for k in range(12):
        background.see(ImageStack(WALL), estimate(turn_rad=0.05 if k < 5 else 0.0), k * HALF_S)
    assert background.difference() is not None


def test_subtracts_every_level_by_itself() -> None:
    """Of large objects nobody needs the first one, which costs most."""
    background = stood()
    background.see(ImageStack(np.minimum(WALL + 20, 255).astype(np.uint8)), estimate(), 6 * HALF_S)
    assert background.difference() is None, "all of it has changed"
    image = WALL.copy()
    image[40:80, 40:60] = 200
    background.see(ImageStack(image), estimate(), 7 * HALF_S)
    difference = background.difference()
    assert difference is not None
    assert difference is background.difference()
    whole, half = (difference.level(k).astype(int) - NO_DIFFERENCE for k in (0, 1))
    mean = whole.reshape(60, 2, 80, 2).mean(axis=(1, 3))
    assert np.abs(half - mean).max() <= 1.0
    left = without_boxes(difference, np.array([[40.0, 40, 60, 60]])).level(1).astype(int) - NO_DIFFERENCE
    assert not left[20:30, 20:30].any()
    assert (left[30:40, 20:30] == half[30:40, 20:30]).all()


def test_a_camera_that_turns_slowly_does_not_stand() -> None:
    assert stood(60, estimate(turn_rad=0.2 / 300.0)).difference() is not None, (
        "each image is a new background"
    )
    slow = StillBackground(focal_px=300.0)
    for k in range(60):
        slow.see(ImageStack(WALL), estimate(turn_rad=0.2 / 300.0), k * HALF_S // 10)
    assert slow.difference() is None


def test_who_walks_is_no_part_of_it_and_a_lit_image_is_no_walker() -> None:
    background = StillBackground(focal_px=300.0)
    for k in range(10):
        image = WALL.copy()
        image[40:80, 10 * k : 10 * k + 10] = 200
        background.see(ImageStack(image), estimate(), k * HALF_S)
    difference = background.difference()
    assert difference is not None
    where = np.argwhere(np.abs(difference.level(0).astype(int) - NO_DIFFERENCE) > 10)
    assert where.min(axis=0).tolist() == [40, 90]
    assert where.max(axis=0).tolist() == [79, 99]
    assert (without_boxes(difference, np.array([[88.0, 38, 102, 82]])).level(0) == NO_DIFFERENCE).all()
    background.see(ImageStack((WALL * 1.5).astype(np.uint8)), estimate(), 10 * HALF_S)
    assert background.difference() is None
