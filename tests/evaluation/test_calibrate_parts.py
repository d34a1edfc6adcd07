"""What calibration says of clocks, detectors and tails, where the truth is known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from belie.detector import Config
from belie.evaluation.calibrate_objects import object_habits
from belie.evaluation.calibrate_part import TeachingPart, changed
from belie.evaluation.calibrate_streams import stream_notes
from belie.evaluation.calibrate_tail import Tail, rate_at, tails, tightened
from belie.geometry import SE3, CameraModel
from belie.types import Detection, DetectionClaim, Frame, MotionClaim, MountedCamera, Step

CAMERA = MountedCamera(
    model=CameraModel(width=640, height=480, fx=400, fy=400, cx=319.5, cy=239.5), T_body_cam=SE3.identity()
)


def part_of(steps, cameras):
    stamps = np.array([step.frame.stamp_ns for step in steps])
    recording = SimpleNamespace(
        path="made", cameras=cameras, frame_stamps_ns=lambda: stamps, steps=lambda: iter(steps)
    )
    return TeachingPart(recording=recording, until_ns=int(stamps[-1]) + 1, learnt_s=0.0, held_out_s=0.0)


@pytest.mark.parametrize("late_ms", [0, 40])
def test_a_clock_that_is_off_is_told_with_its_uncertainty(data_dir, late_ms):
    from belie.evaluation.bench.made_claims import made_recording
    from belie.evaluation.bench.recorded import real_drive

    recording = made_recording(real_drive(data_dir / "kitti00"), "noisy", 0)
    late_ns = late_ms * 1_000_000

    def shifted(claim):
        is_imu = isinstance(claim, MotionClaim) and claim.kind == "imu"
        return replace(claim, stamp_ns=claim.stamp_ns + late_ns) if is_imu else claim

    steps = [replace(s, claims=tuple(shifted(c) for c in s.claims)) for s in recording.joined]
    notes = {
        note.check: note for note in stream_notes([part_of(steps, recording.cameras)], Config(), lambda: None)
    }
    imu, odometry = notes["imu"], notes["odometry"]
    assert imu.offset_s is not None
    assert abs(imu.offset_s - odometry.offset_s - late_ms * 1e-3) < 0.008
    assert 0.0 < imu.sigma_s < 0.01
    assert "imu /imu: stamps" in imu.in_words()


def messages(count, miss, confuse, seed=0, interval_ns=100_000_000):
    """Three cars that stand in plain view of a detector with those habits; misses are independent."""
    rng = np.random.default_rng(seed)
    steps = []
    for k in range(count):
        told = [
            Detection(
                label="bird" if rng.random() < confuse else "car",
                score=0.9,
                track_id=str(i),
                box_px=np.array([100.0 + 150 * i, 200, 180 + 150 * i, 260]),
            )
            for i in range(3)
            if rng.random() >= miss
        ]
        at = {"stamp_ns": k * interval_ns, "received_ns": k * interval_ns}
        frame = Frame(camera="/image", image=np.zeros((480, 640), np.uint8), **at)
        steps.append(
            Step(frame=frame, claims=(DetectionClaim(source="/detections", detections=tuple(told), **at),))
        )
    return part_of(steps, {"/image": CAMERA})


def test_the_detectors_habits_are_found_and_erred_towards_patience():
    changes, notes, words = object_habits([messages(800, miss=0.05, confuse=0.01)], Config())
    assert 0.05 < changes["objects", "miss_rate"] < 0.07
    assert 0.01 < changes["objects", "confusion_rate"] < 0.02
    assert changes["objects", "persistence_s"] < 0.06  # independent misses share no cause
    assert set(notes) == {"objects.miss_rate", "objects.confusion_rate", "objects.persistence_s"}
    assert "objects in plain view" in words[0]
    changed(Config(), changes)  # they are settings that the detector takes


def test_the_accused_are_no_witnesses():
    part = messages(800, miss=0.05, confuse=0.0)
    changes, _, words = object_habits([part], Config(), without={("/detections", "0"), ("/detections", "1")})
    assert 0.05 < changes["objects", "miss_rate"] < 0.09  # of one object only: less is known
    assert object_habits([part], Config(), without={("/other", "0")})[2] != words


def test_a_short_look_at_a_detector_changes_nothing():
    changes, _, words = object_habits([messages(30, miss=0.05, confuse=0.0)], Config())
    assert changes == {}
    assert "say too little" in words[0]


def test_a_detector_without_track_ids_is_not_judged():
    part = messages(300, miss=0.05, confuse=0.0)
    bare = []
    for step in part.steps():
        unnamed = tuple(replace(d, track_id="") for d in step.claims[0].detections)
        bare.append(replace(step, claims=(replace(step.claims[0], detections=unnamed),)))
    assert object_habits([part_of(bare, {"/image": CAMERA})], Config()) == ({}, {}, [])


def test_the_rate_of_an_exponential_tail_is_found_within_its_interval():
    rng = np.random.default_rng(1)
    maxima = rng.exponential(0.08, 1800)  # an hour of blocks of two seconds
    rate, slope = rate_at(maxima, 1.0)
    assert slope == pytest.approx(0.08, rel=0.12)
    assert 0.1 < rate / (1800 * np.exp(-1.0 / 0.08)) < 10.0


def run_with(ratios, seconds_a_frame=0.1):
    check = SimpleNamespace(
        check="imu", source="/imu", ratio=np.asarray(ratios), threshold=np.full(len(ratios), 18.0)
    )
    trace = SimpleNamespace(checks=(check,), seconds=np.arange(len(ratios)) * seconds_a_frame)
    return SimpleNamespace(trace=trace)


def test_longer_driving_narrows_the_interval():
    rng = np.random.default_rng(2)
    (short,) = tails([run_with(rng.exponential(0.05, 600))])
    (long,) = tails([run_with(rng.exponential(0.05, 60_000))])
    assert np.log(long.high / long.low) < 0.5 * np.log(short.high / short.low)
    assert tails([run_with(rng.exponential(0.05, 100))]) == []  # ten seconds say nothing of a tail


def test_thresholds_tighten_only_as_far_as_the_tail_asks():
    quiet = Tail(name="imu /imu", per_hour=1e-4, low=1e-6, high=1e-2, slope=0.05, threshold=18.0)
    assert tightened([quiet], Config()) == ({}, {})
    noisy = replace(quiet, per_hour=1.0)
    changes, notes = tightened([noisy], Config())
    (stated,) = changes.values()
    # Ten times too many: up by slope x ln 10 of the threshold of 18 nats.
    assert stated == pytest.approx(0.1 * np.exp(-18.0 * 0.05 * np.log(10.0)), rel=0.05)
    assert "imu /imu needs it" in notes["sequential.false_alarms_per_hour"]
