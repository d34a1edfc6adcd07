"""Columns of checks that come late, fall silent, or change their unit."""

import numpy as np
import pytest

from belie.evaluation.trace import NOT_RUN, Reasons, TraceRecorder, parse_floor, without_numbers
from belie.types import CheckResult, Detection, Frame, Status, Step, Verdict


def recorded(*frames):
    """A trace of frames, each a list of check results."""
    recorder = TraceRecorder()
    for k, checks in enumerate(frames):
        frame = Frame(camera="/image", stamp_ns=10 * k, received_ns=0, image=np.zeros((2, 2), np.uint8))
        recorder.add(
            Step(frame=frame),
            Verdict(frame=k, stamp_ns=10 * k, status=Status.CONSISTENT, latency_ms=1.0, checks=tuple(checks)),
        )
    return recorder.finish()


def result(statistic=1.0, threshold=4.0, **fields):
    given = {"check": "odometry", "source": "/odom", "status": Status.CONSISTENT}
    return CheckResult(**(given | fields), statistic=statistic, threshold=threshold)


def test_late_and_silent_checks_are_padded():
    late = result(source="/late", floor="2 m")
    trace = recorded([result()], [result(), late], [], [late])
    first, second = trace.checks
    assert first.status.tolist() == [0, 0, NOT_RUN, NOT_RUN]
    assert second.status.tolist() == [NOT_RUN, 0, NOT_RUN, 0]
    np.testing.assert_array_equal(second.ratio, [np.nan, 0.25, np.nan, 0.25])
    np.testing.assert_array_equal(second.floors["m"], [np.nan, 2.0, np.nan, 2.0])
    assert second.share(Status.CONSISTENT) == 1.0


def test_floors_that_come_and_go():
    trace = recorded([result(floor="1 m/s")], [result()], [result(floor="3 m/s, 4 deg/s")])
    np.testing.assert_array_equal(trace.checks[0].floors["m/s"], [1.0, np.nan, 3.0])
    np.testing.assert_array_equal(trace.checks[0].floors["deg/s"], [np.nan, np.nan, 4.0])


def test_the_most_frequent_unit_comes_first():
    trace = recorded([result(unit="chi2")], [result(unit="llr")], [result(unit="llr")])
    assert trace.checks[0].units == ("llr", "chi2")


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        (None, {}),
        ("", {}),
        ("unknown", {}),
        ("0.04 m", {"m": 0.04}),
        ("1e-05 m jump, 3 m/s drift", {"m jump": 1e-5, "m/s drift": 3.0}),
        ("inf m", {}),
    ],
)
def test_floors(text, numbers):
    assert parse_floor(text) == numbers


def test_reasons_that_differ_in_numbers_are_one():
    assert without_numbers("dark: mean gray value 3") == without_numbers("dark: mean gray value 12.5")
    assert without_numbers("not judged: first frame") == "not judged: first frame"


def test_frames_are_found_by_stamp():
    trace = recorded([], [], [])
    assert [trace.frame_at(stamp) for stamp in (-50, 4, 6, 999)] == [0, 0, 1, 2]


def test_a_check_of_objects_is_one_column_of_the_worst_object():
    hiding = {"check": "hiding", "source": "/d"}
    bad = {"status": Status.CONTRADICTED}
    trace = recorded(
        [result(1.0, object="3", **hiding)],
        [result(5.0, object="3", **hiding, **bad), result(9.0, object="7", **hiding, **bad)],
        [result(0.0, **hiding)],
    )
    (check,) = trace.checks
    assert check.statistic.tolist() == [1.0, 9.0, 0.0]


def test_reasons_of_one_kind_count_as_one_and_keep_their_ranges():
    recorder = TraceRecorder()
    for k, reason in enumerate(
        ("car 3 is missing: too small: 22 px", "car 12 is missing: too small: 9 px", "dark")
    ):
        at = {"stamp_ns": k, "received_ns": k}
        result = CheckResult(check="hiding", source="/d", status=Status.UNDECIDED, reason=reason)
        recorder.add(
            Step(frame=Frame(camera="/image", image=np.zeros((2, 2), np.uint8), **at)),
            Verdict(frame=k, stamp_ns=k, status=Status.UNDECIDED, latency_ms=1.0, checks=(result,)),
        )
    (check,) = recorder.finish().checks
    assert check.undecided == {"some car is missing: too small: 9 to 22 px": 2, "dark": 1}
    assert check.never_decided


def test_a_detectors_words_cannot_steer_a_terminal():
    forged = Detection(label="car\x1b[2J", score=0.9, track_id="7\0", box_px=[5, 5, 6, 6])
    assert (forged.label, forged.track_id) == ("car\\x1b[2J", "7\\x00")
    reasons = Reasons()  # its mark for numbers is a NUL
    reasons.add(f"{forged.label} {forged.track_id} is missing: too small: 3 px")
    assert reasons.counted().total() == 1
    assert Detection(label="stop sign, größer", score=0.9).label == "stop sign, größer"
