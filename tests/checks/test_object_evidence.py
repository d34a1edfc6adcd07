"""Evidence about boxes and habits, one function at a time."""

import numpy as np
import pytest

from belie.checks.objects import (
    Counts,
    ErrorTest,
    Habit,
    PhantomTest,
    background_evidence,
    passing_evidence,
    shared_thresholds,
)


def test_a_box_that_the_scene_passes_through_is_suspect_and_one_that_carries_its_corners_is_not():
    through = passing_evidence(np.zeros(4, bool), np.ones(4, bool))
    assert through is not None
    assert through > 5.0
    mostly_rides = passing_evidence(np.arange(10) > 0, np.ones(10, bool))
    assert mostly_rides is not None
    assert mostly_rides < 0.0


def test_corners_that_neither_ride_nor_keep_still_are_another_object():
    assert passing_evidence(np.zeros(6, bool), np.arange(6) < 2) is None


def test_a_box_in_the_air_counts_once_and_not_where_its_corners_told_it_already():
    passed, aloft, lying = PhantomTest(), PhantomTest(aloft=True), PhantomTest(aloft=True)
    for test, told in ((passed, (6.0, None)), (aloft, (6.0, None)), (lying, (None, 6.0))):
        for k in range(2):
            test.add(*told, 15.0, k)
    assert (passed.accused, aloft.accused, lying.accused) == (False, True, False)
    assert passed.statistic + 3.9 == aloft.statistic
    assert lying.statistic == 12.0
    silent = PhantomTest(aloft=True)
    silent.add(None, 0.0, 15.0, 0)
    assert silent.statistic == 0.0


def test_corners_that_ride_take_back_what_passed_but_not_where_corners_lie():
    test = PhantomTest()
    test.add(None, 6.0, 15.0, 0)
    test.add(5.2, None, 15.0, 1)
    test.take_back(2)
    assert test.statistic == pytest.approx(7.2)
    test.take_back(9)
    assert test.statistic == pytest.approx(6.0)


def test_an_accusation_ends_where_what_it_rests_on_is_taken_back():
    test = PhantomTest()
    for k in range(3):
        test.add(6.0, None, 15.0, k)
    for riding, accused in ((3, True), (3, False)):
        test.take_back(riding)
        assert test.accused == accused


def habit_after(gaps, messages=600, rate=0.03):
    habit, own = Habit(rate=rate, persistence_s=0.02, prior_messages=40, prior_gaps=10), Counts()
    for length in gaps:
        habit.learn(own, Counts(begun=1, lasted=length - 1))
    habit.learn(own, Counts(right=messages))
    return habit


@pytest.mark.parametrize(("gaps", "low_s", "high_s"), [([1] * 30, 0.0, 0.05), ([4] * 30, 0.2, 0.6)])
def test_how_long_misses_last_is_told_in_seconds(gaps, low_s, high_s):
    assert low_s < habit_after(gaps).memory_s(0.1) < high_s


def test_a_habit_that_was_learned_gives_patience_from_the_first_message_on():
    learnt = habit_after([4] * 30)
    taught = Habit(rate=learnt.share(), persistence_s=learnt.memory_s(0.1), prior_messages=40, prior_gaps=10)
    new = Habit(rate=0.03, persistence_s=0.02, prior_messages=40, prior_gaps=10)
    gap = [sum(h.wrong(Counts(), k > 0, 0.1) for k in range(6)) for h in (taught, new)]
    assert gap[0] < 6.0 < 14.0 < gap[1]


def told_of(pattern, test, threshold=14.6):
    """Message at which a pattern of misses ("x") and detections (".") is accused, or None."""
    for k, letter in enumerate(pattern):
        if letter == ".":
            test.right(0.1)
        elif test.wrong(0.1, threshold, k):
            return k
    return None


def fresh_test():
    test = ErrorTest(Habit(rate=0.03, persistence_s=0.02, prior_messages=40, prior_gaps=10))
    assert told_of("." * 60, test) is None
    return test


@pytest.mark.parametrize("pattern", ["xxx.xxx.xxx.xxx", "xx.xxxx.xxxx", "xxxx.xxxx"])
def test_a_lie_that_fails_now_and_then_is_found_over_several_runs(pattern):
    assert told_of(pattern, fresh_test()) is not None


@pytest.mark.parametrize("pattern", ["x." * 40, "xx...." * 40, "x.x..xx...x..." * 20])
def test_flicker_is_not_accused(pattern):
    assert told_of(pattern, fresh_test()) is None


def test_an_accused_run_is_not_learned_and_one_that_ended_is():
    accused, ended = fresh_test(), fresh_test()
    before = (accused.own.begun, accused.own.lasted)
    assert told_of("xxxxxxxx", accused) is not None
    assert told_of("......", accused) is None
    assert (accused.own.begun, accused.own.lasted) == before
    assert told_of("xx......", ended) is None
    assert ended.own.begun + ended.own.lasted == pytest.approx(before[0] + before[1] + 2.0, abs=0.01)


@pytest.mark.parametrize(
    ("pattern", "doubtful", "begun", "lasted", "chances"),
    [
        ("xxx", 0, 1, 2, 2),
        ("xxx", 1, 1, 1, 1),
        ("xxx", 3, 0, 0, 0),
        ("x.xx", 9, 1, 0, 1),
        ("xx.", 5, 1, 1, 2),
    ],
)
def test_errors_that_nobody_saw_end_lasted_at_least_so_long(pattern, doubtful, begun, lasted, chances):
    test = fresh_test()
    known = test.own.begun, test.own.lasted, test.own.chances
    assert told_of(pattern, test) is None
    steps = len(test.unlearned(doubtful)[1])
    test.conclude(doubtful)
    learnt = test.own.begun, test.own.lasted, test.own.chances
    assert np.subtract(learnt, known) == pytest.approx([begun, lasted, chances], abs=0.05)
    assert steps == chances
    assert test.errors == 0


def test_an_accusation_outlasts_one_message_and_ends_with_the_next():
    test = fresh_test()
    assert told_of("xxxxxxxxxxxx", test) is not None
    for still in (True, False):
        test.right(0.1)
        assert test.accused is still


def test_errors_that_nobody_vouches_for_are_open_and_end_soon():
    test = fresh_test()
    for k in range(12):
        assert not test.wrong(0.1, 14.6, k, vouched=False)
    assert test.is_open
    for _ in range(4):
        test.right(0.1)
    assert not test.is_open
    assert test.errors == 0


def test_however_many_false_alarms_are_tolerated_one_must_tell_something():
    assert shared_thresholds(*np.full((3, 2), 0.3), np.ones(2), 2.0).min() >= 1.0


def test_a_ground_that_was_fitted_askew_accuses_nobody() -> None:
    """Corners of a parked car of kitti00, frame 70, and ground fitted 0.02 rad too high by a clip that began at 48."""
    fitted = np.array([0.025, 0.026, 0.026, 0.029, 0.029, 0.029, 0.030, 0.030, 0.030])
    car = np.array([0.034, 0.022, 0.028, 0.025, 0.028, 0.033, 0.025, 0.028, 0.033])
    told = [background_evidence(car, np.full(9, 1e-3), fitted, 0.0517, tilt=tilt) for tilt in (0.0, 0.0086)]
    assert told[0] is not None
    assert told[0] > 5.0
    assert told[1] is not None
    assert told[1] < told[0] / 3.0
    ground = np.linspace(0.015, 0.045, 30)
    shown = background_evidence(ground, np.full(30, 1e-3), ground, 0.052, tilt=0.0086)
    assert shown is not None
    assert shown > 3.0


def test_what_moves_along_is_explained_by_no_ground_that_lies_elsewhere() -> None:
    """A van that drives ahead, in a simulated rainy night: its corners seem to be far away."""
    ground = np.array([0.010, 0.014, 0.014, 0.017, 0.018, 0.034, 0.035, 0.037, 0.041, 0.042])
    van = np.array([0.001, 0.007, 0.007, 0.007, 0.007, 0.002, 0.001, 0.002, 0.003, 0.004])
    assert background_evidence(van, np.full(10, 1.2e-3), ground, 0.050, tilt=0.010) == 0.0
