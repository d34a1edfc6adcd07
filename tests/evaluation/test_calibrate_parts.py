"""What calibration says of clocks, detectors and tails, where the truth is known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from belie.checks.objects import Counts, ObjectSettings
from belie.detector import Config
from belie.detector.object_habits import ObjectHabits
from belie.evaluation.calibrate_habits import fitted
from belie.evaluation.calibrate_objects import learn_habits
from belie.evaluation.calibrate_part import TeachingPart
from belie.evaluation.calibrate_streams import SHIFTS_S, clock_offset, stream_notes
from belie.evaluation.calibrate_tail import Tail, rate_at, tails, tightened
from belie.geometry import SE3, CameraModel
from belie.types import Frame, MotionClaim, MountedCamera, Step

CAMERA = MountedCamera(
    model=CameraModel(width=640, height=480, fx=400, fy=400, cx=319.5, cy=239.5), T_body_cam=SE3.identity()
)


def part_of(steps, cameras):
    stamps = np.array([step.frame.stamp_ns for step in steps])
    recording = SimpleNamespace(
        path="made", cameras=cameras, frame_stamps_ns=lambda: stamps, steps=lambda: iter(steps)
    )
    return TeachingPart(recording=recording, until_ns=int(stamps[-1]) + 1, learnt_s=0.0, held_out_s=0.0)


@pytest.mark.parametrize("late_ms", [0, 20])
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


@pytest.mark.parametrize("late_s", [0.0, 0.02])
def test_the_stated_uncertainty_of_a_clock_holds_where_errors_last(late_s):
    found = []
    t = 0.1 * np.arange(150)
    for seed in range(60):
        rng = np.random.default_rng(seed)
        gyro = rng.normal(0.0, 0.002, (150, 45, 3)).cumsum(axis=1)  # ten samples a frame, of those around it
        claimed = np.stack([(gyro[:, k + 20] - gyro[:, k + 10]) / 10.0 for k in range(len(SHIFTS_S))], axis=1)
        for shift_s, rates in zip(SHIFTS_S, claimed.swapaxes(0, 1), strict=True):
            rates[:, 1] += 0.056 * np.cos(0.7 * (t + shift_s - late_s))
        seen = rng.normal(0.0, 0.001, (150, 3))
        for k in range(1, 150):
            seen[k] += 0.6 * seen[k - 1]
        seen[:, 1] += 0.056 * np.cos(0.7 * t)
        accelerations = (seen[2:] - seen[:-2]) / 0.2
        offset = clock_offset((claimed - seen[:, None])[1:-1], accelerations)
        if offset is not None:
            found.append(((offset[0] - late_s) / offset[1], offset[0] - late_s))
    assert len(found) > 50
    z, error_s = np.array(found).T
    assert abs(error_s.mean()) < 0.003
    assert np.sqrt(np.mean(z**2)) < 1.6


class HeardDetector:
    """Stands in for the detector: reports scripted habits, and under which stated rate it was run."""

    rates: list = []  # noqa: RUF012

    def __init__(self, cameras, config):
        self.rates.append(config.sequential.false_alarms_per_hour)

    def update(self, frame, claims):
        pass

    def object_habits(self):
        return {"/detections": shows(800.0, 0.05), "/rare": shows(30.0, 0.9)}


def test_habits_become_settings_with_the_interval_that_they_are_known_to(monkeypatch):
    monkeypatch.setattr("belie.evaluation.calibrate_objects.Detector", HeardDetector)
    monkeypatch.setattr(HeardDetector, "rates", [])
    part = part_of([step_at(k) for k in range(3)], {"/image": CAMERA})
    learnt = learn_habits([part], Config(), lambda: None)
    # 40 of 800, and 1.2 of 40 as expected before; what was heard too seldom does not count.
    assert learnt.config.objects.miss_rate == pytest.approx(41.2 / 840.0, abs=1e-4)
    assert learnt.config.objects.prior_messages == 400.0  # half of them
    assert learnt.config.sequential == Config().sequential
    assert learnt.words == (
        "/detections: misses 5.00 % (3.69 to 6.74 %) and misnames 1.00 % (0.51 to 1.96 %) of 800 messages about "
        "objects that it should see",
        "/rare: its misses and misnamings were not learned: 30 messages about objects that it should see, 200 are "
        "needed; the settings stay as they were",
    )
    learn_habits([part], Config(), lambda: None, from_accused=False)
    assert HeardDetector.rates[0] < 1e-100  # nobody is accused, so that all errors teach
    assert HeardDetector.rates[1] == 0.1  # what is accused does not teach


def heard(**several):
    """A detector whose habits are those of one recording after the other, by name of the topic."""
    told = iter(zip(*several.values(), strict=True))

    class Heard(HeardDetector):
        def object_habits(self):
            return {f"/{name}": habits for name, habits in zip(several, next(told), strict=True)}

    return Heard


def shows(messages, miss_rate):
    wrong = messages * miss_rate
    missed = Counts(right=messages - wrong, begun=0.9 * wrong, lasted=0.1 * wrong)
    misnamed = Counts(right=0.99 * messages, begun=0.01 * messages)
    return ObjectHabits(interval_s=0.1, missed=missed, misnamed=misnamed)


def test_recordings_that_show_little_are_put_together(monkeypatch):
    part = part_of([step_at(k) for k in range(3)], {"/image": CAMERA})
    rare = shows(20.0, 0.5)
    detector = heard(detections=[shows(150.0, 0.08), shows(90.0, 0.05)], rare=[rare, rare])
    monkeypatch.setattr("belie.evaluation.calibrate_objects.Detector", detector)
    learnt = learn_habits([part, part], Config(), lambda: None)
    # 12 of 150 and 4.5 of 90, and 1.2 of 40 as expected before.
    assert learnt.config.objects.miss_rate == pytest.approx(17.7 / 280.0, abs=1e-3)
    assert learnt.words == (
        "/detections: misses 6.67 % (4.14 to 10.55 %) and misnames 0.83 % (0.23 to 2.99 %) of 240 messages about "
        "objects that it should see, in 2 recordings",
        "/rare: its misses and misnamings were not learned: 40 messages about objects that it should see, 200 are "
        "needed; the settings stay as they were",
    )


def test_a_recording_that_alone_shows_more_misses_is_not_watered_down(monkeypatch):
    part = part_of([step_at(k) for k in range(3)], {"/image": CAMERA})
    monkeypatch.setattr(
        "belie.evaluation.calibrate_objects.Detector",
        heard(detections=[shows(900.0, 0.02), shows(300.0, 0.1)]),
    )
    learnt = learn_habits([part, part], Config(), lambda: None)
    assert learnt.config.objects.miss_rate == pytest.approx(31.2 / 340.0, abs=1e-3)
    assert learnt.words[0].endswith("of 1200 messages about objects that it should see, in 2 recordings")
    assert learnt.words[1].startswith("/detections: one of them alone misses 10.00 % (7.09 to 13.92 %)")


def test_recordings_that_differ_by_chance_are_not_told_apart(monkeypatch):
    part = part_of([step_at(k) for k in range(3)], {"/image": CAMERA})
    monkeypatch.setattr(
        "belie.evaluation.calibrate_objects.Detector",
        heard(detections=[shows(900.0, 0.02), shows(300.0, 0.03)]),
    )
    learnt = learn_habits([part, part], Config(), lambda: None)
    assert learnt.config.objects.miss_rate < 0.025
    assert len(learnt.words) == 1


def test_small_objects_are_told_from_a_detector_whose_misses_last():
    rng, sides = np.random.default_rng(4), np.geomspace(14.0, 120.0, 400)
    small = tuple((float(s), bool(rng.random() < 1.0 / (1.0 + (s / 28.0) ** 4))) for s in sides)
    lasting = tuple((float(s), bool(rng.random() < 0.6)) for s in sides)
    found = [
        fitted([replace(shows(4000.0, 0.05), steps=steps)], ObjectSettings()) for steps in (small, lasting)
    ]
    assert found[0]["half_seen_px"] == pytest.approx(28.0, rel=0.15)
    assert found[0]["persistence_s"] < 0.04 < 0.15 < found[1]["persistence_s"]


def test_one_persistence_fits_recordings_of_several_rates():
    rng, share, tau_s = np.random.default_rng(6), 0.05, 0.2
    each = []
    for interval_s in (0.1, 1.0 / 30.0):
        lasts = share + (1.0 - share) * np.exp(-interval_s / tau_s)
        steps = tuple((200.0, bool(rng.random() < lasts)) for _ in range(3000))
        each.append(replace(shows(4000.0, share), interval_s=interval_s, steps=steps))
    assert fitted(each, ObjectSettings())["persistence_s"] == pytest.approx(tau_s, rel=0.15)


def test_objects_that_err_alike_are_given_no_habits_of_their_own():
    rng = np.random.default_rng(5)

    def of(shares):
        counts = []
        for share in shares:
            begun = rng.binomial(200, share)
            counts.append(Counts(right=200.0 - begun, begun=float(begun)))
        return replace(shows(4000.0, 0.05), objects=tuple(counts))

    alike = fitted([of(np.full(80, 0.05))], ObjectSettings())
    each_its_own = fitted([of(rng.beta(0.5, 9.5, 80))], ObjectSettings())
    assert each_its_own["object_messages"] < 20.0 < 100.0 < alike["object_messages"]


def step_at(k):
    at = {"stamp_ns": k * 100_000_000, "received_ns": k * 100_000_000}
    return Step(frame=Frame(camera="/image", image=np.zeros((480, 640), np.uint8), **at))


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
