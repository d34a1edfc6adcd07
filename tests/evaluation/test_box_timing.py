"""Boxes that are told for other frames than they are about move as the pixels did then."""

import numpy as np
import pytest

from belie.detector import ObjectView
from belie.evaluation.box_timing import BoxTiming

SIZE = (640, 480)
FRAME_NS = 100_000_000


def place(number, k):
    """Middle of an object that swings to and fro, each in its own time."""
    return np.array([200.0 + 40.0 * np.sin(0.21 * k + number), 150.0 + 40.0 * number])


def evenly(number, k):
    """The same for one that keeps its speed."""
    return np.array([100.0 + 3.0 * k, 150.0 + 40.0 * number])


def timing_of(late, frames=60, *, objects=4, corners=20, place=place):
    """Objects that the detector follows by their pixels, and corrects by half of what is told, `late` frames late."""
    timing, rng = BoxTiming(), np.random.default_rng(0)
    followed = [place(number, -1) for number in range(objects)]
    for k in range(frames):
        views = []
        for number in range(objects):
            box = followed[number] + place(number, k) - place(number, k - 1) + rng.normal(0.0, 0.1, 2)
            told = place(number, k - late) + rng.normal(0.0, 0.3, 2)
            followed[number] = box + 0.5 * (told - box)
            views.append(view(number, box, told, k, corners))
        timing.see(views, SIZE, k * FRAME_NS)
    return timing


def view(number, middle, told, k, corners):
    corners_px = np.zeros((corners, 2))
    return ObjectView(
        source="/d", name=str(number), label="car", told_label="car", misnamed=False,
        box_px=np.concatenate([middle - 20.0, middle + 20.0]),
        detected_px=np.concatenate([told - 20.0, told + 20.0]), told_ns=k * FRAME_NS, predicted_px=corners_px,
        observed_px=corners_px, error_px2=None, status="reported", number=number,
    )  # fmt: skip


@pytest.mark.parametrize("late", [0, 1, 5, -5])
def test_a_delay_is_told(late):
    assert timing_of(late).late_frames() == late


@pytest.mark.parametrize(
    "how",
    [{"place": evenly}, {"objects": 2}, {"corners": 9}, {"frames": 15}],
    ids=lambda how: next(iter(how)),
)
def test_where_it_cannot_be_told_nothing_is_said(how):
    assert timing_of(5, **how).late_frames() == 0


def test_memory_is_bounded():
    timing = timing_of(5, frames=3000)
    assert sum(len(one.seen) + len(one.told) for one in timing._objects.values()) < 16_010
    assert timing.late_frames() == 5
