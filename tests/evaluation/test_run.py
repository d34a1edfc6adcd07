"""Runs: traces, alerts with their ends, verdicts for the score, streaming, flat memory."""

import gc
import weakref

import numpy as np
import pytest

from belie.attacks import AttackLabel
from belie.evaluation.run import run_detector
from belie.types import AlertType, Frame, RecordingError, Settings, Status, Step

FRAME_NS = 100_000_000


def test_trace_of_a_run(made_run):
    run = made_run(60, onset=30, end=40)
    (odometry,) = run.trace.checks
    assert np.isnan(odometry.ratio[:5]).all()
    assert odometry.ratio[5] == pytest.approx(0.25)
    assert np.flatnonzero(odometry.ratio > 1.0).tolist() == list(range(32, 40))
    assert odometry.floors["m/s"] == pytest.approx(0.1)
    assert odometry.units == ("llr",)
    assert run.trace.share(Status.UNDECIDED) == pytest.approx(5 / 60)
    assert run.undecided_reasons() == [("odometry /odom", "learning: 1 to 5 more frames", 5)]
    assert run.trace.seconds[-1] == pytest.approx(5.9)
    assert run.trace.decode_ms.tolist() == [2.0] * 60
    assert run.trace.claimed_m[10].tolist() == [0.0, 0.0, 5.0]
    assert run.trace.seen_m[35] == pytest.approx([1.2, 0.0, 17.5])
    assert run.join_counts == {"late": {"/gnss": 1}}
    (gnss,) = run.trace.positions
    assert gnss.position_m.shape == (60, 3)


def test_alerts_know_their_end_and_reason(made_run):
    (alert,) = made_run(60, onset=30, end=40).alerts
    assert (alert.raised.frame, alert.check, alert.reason) == (32, "odometry", "sideways")
    assert alert.delay_ns == 2 * FRAME_NS
    assert alert.end_ns - alert.raised.stamp_ns == 7 * FRAME_NS
    (open_end,) = made_run(60, onset=30).alerts
    assert open_end.end_ns - open_end.raised.stamp_ns == 27 * FRAME_NS


def test_score_of_a_run(made_run, made):
    label = AttackLabel(
        name="odometry-freeze", text="odometry-freeze:start=30", stream="odometry", sources=("/odom",),
        alert=AlertType.ODOMETRY_SPOOFING, start_frame=30, stop_frame=40, seed=0,
        start_ns=made.start_ns + 30 * FRAME_NS, onset_ns=made.start_ns + 30 * FRAME_NS,
        end_ns=made.start_ns + 40 * FRAME_NS,
    )  # fmt: skip
    result = made_run(60, onset=30, end=40).score([label])
    assert (result.hits, result.labels[0].delay_frames, len(result.false_alerts)) == (1, 2, 0)


def test_verdicts_are_streamed(made_run):
    seen = []
    made_run(7, on_verdict=seen.append)
    assert [verdict.frame for verdict in seen] == list(range(7))


def test_images_are_let_go(made):
    images: list[weakref.ref] = []
    most = 0

    class Fresh(made.Recording):
        """Every frame has an image of its own."""

        def steps(self):
            for step in super().steps():
                image = np.array(step.frame.image)
                images.append(weakref.ref(image))
                at = {"stamp_ns": step.frame.stamp_ns, "received_ns": 0}
                yield Step(frame=Frame(camera="/image", image=image, **at), claims=step.claims)

    def count(verdict):
        nonlocal most
        if verdict.frame % 25 == 24:
            gc.collect()
            most = max(most, sum(image() is not None for image in images))

    run_detector(Fresh(80), Settings(), detector=made.Detector(onset=30), on_verdict=count)
    assert most <= 24  # the ring, the frame nearest to an alert, and the one in hand


def test_a_recording_without_frames_is_an_error(made):
    with pytest.raises(RecordingError, match="holds no frame"):
        run_detector(made.Recording(0), Settings(), detector=made.Detector())


def test_the_source_is_closed_when_the_detector_fails(made):
    closed = []

    class Closing(made.Recording):
        def steps(self):
            try:
                yield from super().steps()
            finally:
                closed.append(True)

    class Failing(made.Detector):
        def update(self, frame, claims):
            raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        run_detector(Closing(5), Settings(), detector=Failing())
    assert closed == [True]
