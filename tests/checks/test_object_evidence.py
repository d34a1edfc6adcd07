"""Evidence about boxes and habits, one function at a time."""

import numpy as np
import pytest

from belie.checks.objects import Counts, Habit, passing_evidence


def test_a_box_that_the_scene_passes_through_is_suspect_and_one_that_carries_its_corners_is_not():
    through = passing_evidence(np.zeros(4, bool), np.ones(4, bool))
    assert through is not None
    assert through > 5.0
    mostly_rides = passing_evidence(np.arange(10) > 0, np.ones(10, bool))
    assert mostly_rides is not None
    assert mostly_rides < 0.0


def test_corners_that_neither_ride_nor_keep_still_are_another_object():
    assert passing_evidence(np.zeros(6, bool), np.arange(6) < 2) is None


def habit_after(gaps, messages=600, rate=0.03):
    habit, own = Habit(rate=rate, persistence_s=0.02, prior_messages=40, prior_gaps=10), Counts()
    for length in gaps:
        habit.ended(own, length)
    for _ in range(messages):
        habit.right(own)
    return habit


@pytest.mark.parametrize(("gaps", "low_s", "high_s"), [([1] * 30, 0.0, 0.05), ([4] * 30, 0.2, 0.6)])
def test_how_long_misses_last_is_told_in_seconds(gaps, low_s, high_s):
    assert low_s < habit_after(gaps).memory_s(0.1) < high_s


def test_a_habit_that_was_learned_gives_patience_from_the_first_message_on():
    learnt = habit_after([4] * 30)
    taught = Habit(rate=learnt.share(), persistence_s=learnt.memory_s(0.1), prior_messages=40, prior_gaps=10)
    new = Habit(rate=0.03, persistence_s=0.02, prior_messages=40, prior_gaps=10)
    gap = [sum(h.surprise(Counts(), k, 0.1) for k in range(6)) for h in (taught, new)]
    assert gap[0] < 6.0 < 14.0 < gap[1]
