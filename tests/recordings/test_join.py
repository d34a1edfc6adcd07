"""Joining by stamp: delays, disorder, slow streams, gaps and clocks; and reading ahead."""

import threading

import numpy as np
import pytest

from belie.geometry import SE3
from belie.recordings.join import DecodedFrame, join
from belie.recordings.join_counts import JoinCounts
from belie.recordings.join_settings import JoinSettings
from belie.recordings.prefetch import prefetch
from belie.types import Frame, MotionClaim, PoseClaim, PositionClaim, RecordingError

MS = 1_000_000
PIXELS = np.zeros((4, 4), np.uint8)


def frame(stamp_ms, delay_ms=0.0, index=0):
    stamp_ns = round(stamp_ms * MS)
    made = Frame(camera="/cam", stamp_ns=stamp_ns, received_ns=stamp_ns + round(delay_ms * MS), image=PIXELS)
    return DecodedFrame(frame=made, index=index)


def pose(stamp_ms, delay_ms=0.0, source="/odom"):
    stamp_ns = round(stamp_ms * MS)
    return PoseClaim(
        source=source,
        frame_id="odom",
        stamp_ns=stamp_ns,
        received_ns=stamp_ns + round(delay_ms * MS),
        T_odom_body=SE3.identity(),
    )


def twist(stamp_ms, delay_ms=0.0):
    claim = pose(stamp_ms, delay_ms)
    return MotionClaim(
        source="/odom",
        kind="twist",
        stamp_ns=claim.stamp_ns,
        received_ns=claim.received_ns,
        linear_m_s=np.zeros(3),
    )


def fix(stamp_ms, delay_ms=0.0):
    claim = pose(stamp_ms, delay_ms)
    return PositionClaim(
        source="/fix",
        frame_id="enu",
        kind="gnss",
        stamp_ns=claim.stamp_ns,
        received_ns=claim.received_ns,
        position_m=np.zeros(3),
    )


def received(arrival):
    return arrival.frame.received_ns if isinstance(arrival, DecodedFrame) else arrival.received_ns


def joined(arrivals, counts=None, in_order=True, periods_ns=None, **settings):
    ordered = sorted(arrivals, key=received) if in_order else arrivals
    counts = JoinCounts() if counts is None else counts
    return list(join(ordered, settings=JoinSettings(**settings), counts=counts, periods_ns=periods_ns))


def stamps_ms(step):
    return [claim.stamp_ns // MS for claim in step.claims]


def test_claims_delayed_each_by_its_own_delay_reach_their_frame():
    rng = np.random.default_rng(3)
    arrivals = [frame(100 * i, rng.uniform(1, 60)) for i in range(20)]
    arrivals += [pose(20 * i, rng.uniform(1, 60)) for i in range(100)]
    arrivals += [fix(50 * i + 3, rng.uniform(1, 60)) for i in range(38)]
    counts = JoinCounts()
    steps = joined(arrivals, counts)
    handed = [(claim.source, claim.stamp_ns) for step in steps for claim in step.claims]
    assert len(handed) == len(set(handed))
    for index, step in enumerate(steps):
        t = 100 * index
        odom = [c.stamp_ns // MS for c in step.claims if c.source == "/odom"]
        assert odom == [s for s in range(t - 80, t + 1, 20) if s >= 0]  # a claim at the frame: none after it
        fixes = [c.stamp_ns // MS for c in step.claims if c.source == "/fix"]
        expected = [3] if index == 0 else [t - 47, t + 3]
        assert fixes == [s for s in expected if s <= 50 * 37 + 3]
        assert stamps_ms(step) == sorted(stamps_ms(step))
    assert not counts.late
    assert counts.out_of_order["/odom"] > 0


def test_the_claim_after_comes_once_and_slow_streams_are_waited_for():
    arrivals = [frame(100 * i) for i in range(31)] + [fix(1000 * i + 50) for i in range(4)]
    steps = joined(arrivals)
    assert stamps_ms(steps[0]) == [50]
    assert stamps_ms(steps[1]) == [1050]
    assert all(stamps_ms(step) == [] for step in steps[2:11])
    assert stamps_ms(steps[11]) == [2050]


def test_a_stream_that_falls_silent_does_not_hold_frames_for_ever():
    arrivals = [frame(100 * i) for i in range(60)] + [pose(100 * i) for i in range(10)]
    emitted_at = {}
    clock = 0

    def watched():
        nonlocal clock
        for arrival in sorted(arrivals, key=received):
            clock = received(arrival) // MS
            yield arrival

    for step in join(watched(), settings=JoinSettings(), counts=JoinCounts()):
        emitted_at[step.frame.stamp_ns // MS] = clock
    assert emitted_at[500] == 800  # the window: 200 ms have passed
    assert emitted_at[2000] == 3600  # patience: 1500 ms have passed


def test_pose_and_twist_of_one_message_stay_together():
    arrivals = [frame(0), frame(100), pose(0), pose(150), twist(150), pose(250), twist(250), frame(200)]
    steps = joined(arrivals)
    for step in steps:
        poses = {c.stamp_ns for c in step.claims if isinstance(c, PoseClaim)}
        assert {c.stamp_ns for c in step.claims if isinstance(c, MotionClaim)} <= poses
    assert [stamps_ms(step) for step in steps] == [[0], [150, 150], [250, 250]]


def test_later_than_the_window_is_late_and_goes_with_the_next_frame():
    counts = JoinCounts()
    arrivals = [frame(100 * i) for i in range(40)] + [pose(100 * i) for i in range(40)] + [fix(500, 600)]
    steps = joined(arrivals, counts)
    assert counts.late == {"/fix": 1}
    holder = next(step for step in steps if any(c.source == "/fix" for c in step.claims))
    assert holder.frame.stamp_ns == 900 * MS  # 500 to 800 had gone by 1100 ms


def test_claims_without_a_frame_left_are_counted():
    counts = JoinCounts()
    joined([frame(0), *(pose(10 * i) for i in range(10))], counts)
    assert counts.dropped_late == {"/odom": 9}


def test_frames_in_disorder_within_the_window_are_sorted():
    counts = JoinCounts()
    steps = joined([frame(0), frame(200, 1), frame(100, 150), frame(300), frame(600)], counts)
    assert [step.frame.stamp_ns // MS for step in steps] == [0, 100, 200, 300, 600]
    assert counts.out_of_order == {"/cam": 1}


def test_frames_beyond_the_window_are_refused():
    with pytest.raises(RecordingError, match="run backwards at message 7"):
        joined([frame(0), frame(1000), frame(700, 310, index=7)])
    with pytest.raises(RecordingError, match="run backwards at message 2"):
        joined([frame(1000, index=0), frame(900, 250, index=1), frame(500, 700, index=2)])


def test_duplicates_missing_and_clock_jumps_are_counted():
    counts = JoinCounts()
    arrivals = [frame(100 * i) for i in range(30) if i not in (5, 6)] + [frame(1000, 20)]
    arrivals += [pose(100 * i) for i in range(30) if not 10 <= i < 20]
    arrivals += [pose(0, 2250)]
    steps = joined(arrivals, counts, periods_ns={"/cam": 100 * MS, "/odom": 100 * MS})
    assert len(steps) == 28
    assert counts.duplicates == {"/cam": 1}
    assert counts.missing["/cam"] == 2
    assert counts.missing["/odom"] == 6  # those of 1200 to 1700 ms
    assert counts.clock_jumps == {"/odom": 1}
    assert counts.late == {"/odom": 1}


@pytest.mark.parametrize("offset_ms", [3_600_000, -3_600_000])
def test_a_stream_on_another_clock_is_refused(offset_ms):
    arrivals = [frame(100 * i) for i in range(20)] + [
        pose(100 * i + offset_ms, -offset_ms) for i in range(20)
    ]
    with pytest.raises(RecordingError, match=r"stamps of /odom are [+-]3600\.0 s off those of the images"):
        joined(arrivals)
    one_wild_stamp = [frame(100 * i) for i in range(20)] + [pose(100 * i) for i in range(20)]
    assert len(joined([*one_wild_stamp, pose(50 + offset_ms, -offset_ms)])) == 20


def test_a_clock_somewhat_ahead_is_joined_by_stamp():
    arrivals = [frame(100 * i) for i in range(60)] + [pose(100 * i + 2000, -2000) for i in range(60)]
    steps = joined(arrivals)
    assert stamps_ms(steps[0]) == [2000]
    assert stamps_ms(steps[25]) == [2500]


def test_waiting_claims_are_bounded():
    arrivals = [frame(0)] + [pose(30_000 + i, -30_000) for i in range(50)]
    with pytest.raises(RecordingError, match="more than 20 claims of /odom wait for their images"):
        joined(arrivals, max_waiting_claims=20)


def test_waiting_frames_are_bounded():
    given = 0

    def source():
        nonlocal given
        for index in range(300):
            given += 1
            yield frame(index)

    settings = JoinSettings(reorder_window_ms=1e9, patience_ms=1e9, max_waiting_frames=10)
    for count, _ in enumerate(join(source(), settings=settings, counts=JoinCounts()), start=1):
        assert given <= count + 12
    assert count == 300


def test_steps_do_not_depend_on_the_order_of_ties():
    arrivals = [frame(100 * i, 5) for i in range(10)] + [pose(50 * i + 5, 0) for i in range(20)]
    forward = joined(arrivals)
    backward = joined(arrivals[::-1])
    assert [stamps_ms(a) for a in forward] == [stamps_ms(b) for b in backward]


def test_prefetch_stays_a_bounded_number_of_frames_ahead():
    made = []

    def source():
        for index in range(100):
            made.append(index)
            yield frame(index)

    ahead = prefetch(source(), depth=3)
    for count, _ in enumerate(ahead, start=1):
        assert len(made) <= count + 3 + 2  # the queue, one in hand, one in the making
    assert count == 100


def test_prefetch_raises_what_the_source_raises_and_closes_it():
    closed = threading.Event()

    def source():
        try:
            yield 1
            raise RecordingError("the disk is gone")
        finally:
            closed.set()

    with pytest.raises(RecordingError, match="the disk is gone"):
        list(prefetch(source()))
    assert closed.is_set()

    def endless():
        try:
            while True:
                yield frame(1)
        finally:
            stopped.set()

    stopped = threading.Event()
    ahead = prefetch(endless())
    next(ahead)
    ahead.close()
    assert stopped.is_set()
