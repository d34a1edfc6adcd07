"""Sensors: their errors are as large as stated, arrive when stated, and are the same for the same seed."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from belie.geometry import SE3, CameraModel, so3_exp
from belie.simulation.sensors import (
    Arrival,
    GnssSettings,
    Imu,
    ImuSettings,
    LocalisationSettings,
    ObjectDetector,
    ObjectDetectorSettings,
    WheelOdometry,
    WheelOdometrySettings,
    gnss,
    localisation,
)

START_NS = 1_700_000_000_000_000_000
CAMERA = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)


class Circling:
    """On a circle about (0, 20), at 10 m/s and 0.5 rad/s, anticlockwise."""

    speed_m_s, yaw_rate = 10.0, 0.5

    def T_world_body(self, t_s):
        yaw, radius = self.yaw_rate * t_s, self.speed_m_s / self.yaw_rate
        t = [radius * math.sin(yaw), radius * (1 - math.cos(yaw)), 0.0]
        return SE3(so3_exp(np.array([0.0, 0.0, yaw])), np.array(t))

    def twist(self, t_s):
        return np.array([self.speed_m_s, 0.0, 0.0]), np.array([0.0, 0.0, self.yaw_rate])


SENSORS = [
    (Imu, ImuSettings()),
    (WheelOdometry, WheelOdometrySettings()),
    (gnss, GnssSettings()),
    (localisation, LocalisationSettings()),
]


@pytest.mark.parametrize(("sensor", "settings"), SENSORS, ids=[s.__name__ for s, _ in SENSORS])
def test_rates_delays_and_seeds(sensor, settings):
    def claims(seed, stops):
        one = sensor(settings, start_ns=START_NS, seed=seed)
        return [claim for stop in stops for claim in one.claims_until(Circling(), stop)]

    at_once = claims(3, [2.0])
    stamps = sorted({claim.stamp_ns for claim in at_once})
    assert len(stamps) == round(2.0 * settings.rate_hz) + 1
    assert stamps[0] == START_NS
    assert stamps[-1] == START_NS + 2 * 10**9
    delays_ms = np.array([(claim.received_ns - claim.stamp_ns) / 1e6 for claim in at_once])
    assert delays_ms.min() >= 1.0
    assert delays_ms.max() <= 60.0
    assert abs(delays_ms.mean() - settings.arrival.delay_ms) < settings.arrival.jitter_ms
    piecemeal = claims(3, np.linspace(0.0, 2.0, 41))
    for a, b, other in zip(at_once, piecemeal, claims(4, [2.0]), strict=True):
        numbers = [_numbers(claim) for claim in (a, b, other)]
        np.testing.assert_array_equal(numbers[0], numbers[1])
        assert (a.stamp_ns, a.received_ns) == (b.stamp_ns, b.received_ns)
    assert not np.array_equal(_numbers(at_once[-1]), _numbers(claims(4, [2.0])[-1]))
    off = sensor(settings.model_copy(update={"rate_hz": 0.0}), start_ns=START_NS, seed=3)
    assert off.claims_until(Circling(), 2.0) == []


def _numbers(claim):
    for name in ("angular_rad_s", "position_m"):
        value = getattr(claim, name, None)
        if value is not None:
            return value
    return claim.T_odom_body.t


def test_the_imu_feels_gravity_and_the_turn():
    exact = ImuSettings(accelerometer_bias_m_s2=0, accelerometer_noise_m_s2_rt_hz=0)
    force = Imu(exact, start_ns=0, seed=1).claims_until(Circling(), 1.0)[-1].acceleration_m_s2
    np.testing.assert_allclose(force, [0.0, 10.0 * 0.5, 9.80665], atol=2e-2)
    claims = Imu(ImuSettings(), start_ns=0, seed=1).claims_until(Circling(), 30.0)
    rates = np.array([claim.angular_rad_s for claim in claims]) - [0.0, 0.0, 0.5]
    expected = math.radians(0.014) * math.sqrt(200.0)
    np.testing.assert_allclose(np.diff(rates, axis=0).std(axis=0) / math.sqrt(2), expected, rtol=0.05)
    assert np.abs(rates.mean(axis=0)).max() < math.radians(1.5)
    np.testing.assert_allclose(claims[0].covariance[3:, 3:], expected**2 * np.eye(3))


def test_wheel_odometry_drifts_as_stated():
    errors = []
    for seed in range(12):
        claims = WheelOdometry(WheelOdometrySettings(), start_ns=0, seed=seed).claims_until(Circling(), 10.0)
        pose, twist = claims[-2], claims[-1]
        true = Circling().T_world_body(10.0)
        errors.append(float(np.linalg.norm(pose.T_odom_body.t - true.t)))
        assert pose.T_odom_body.t[2] == 0.0
        assert twist.linear_m_s[0] == pytest.approx(10.0, rel=0.03)
        assert (twist.source, twist.stamp_ns, twist.received_ns) == (
            pose.source,
            pose.stamp_ns,
            pose.received_ns,
        )
    assert 0.2 < np.median(errors) < 2.0  # 100 m and 5 rad: half a per cent of each


def test_a_planar_odometry_sees_no_pitch_and_a_full_one_does():
    class Nodding:
        def T_world_body(self, t_s):
            return SE3(so3_exp(np.array([0.0, 0.1 * t_s, 0.0])), np.array([t_s, 0.0, 2.0 * t_s]))

        def twist(self, t_s):
            return np.array([1.0, 0.0, 2.0]), np.array([0.0, 0.1, 0.0])

    flat = WheelOdometry(WheelOdometrySettings(), start_ns=0, seed=1).claims_until(Nodding(), 1.0)[-2]
    assert flat.T_odom_body.t[2] == 0.0
    full_settings = WheelOdometrySettings(planar=False)
    full = WheelOdometry(full_settings, start_ns=0, seed=1).claims_until(Nodding(), 1.0)[-2]
    assert full.T_odom_body.t[2] == pytest.approx(2.0, abs=0.1)
    assert full.T_odom_body.log()[4] == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize("sensor", [gnss, localisation])
def test_positions_err_as_their_covariance_says(sensor):
    settings = GnssSettings() if sensor is gnss else LocalisationSettings()
    last = []
    for seed in range(300):
        claim = sensor(settings, start_ns=0, seed=seed).claims_until(Circling(), 1.0)[-1]
        true = Circling().T_world_body(1.0)
        lever = np.zeros(3) if claim.lever_m is None else claim.lever_m
        last.append(claim.position_m - true.t - true.R @ lever)
    sigma = np.sqrt(np.diag(claim.covariance))
    np.testing.assert_allclose(np.std(last, axis=0), sigma, rtol=0.15)


def test_an_arrival_is_never_before_the_measurement():
    with pytest.raises(ValueError, match="jitter_ms must be less"):
        Arrival(delay_ms=5, jitter_ms=5)


# -- the object detector ---------------------------------------------------------------------------------


def label(id=1, name="car", height=60.0, visible=1.0, distance=12.0):
    box = np.array([300.0, 240.0 - height / 2, 300 + 1.3 * height, 240.0 + height / 2])
    T = SE3.from_translation([0.5, 1.0, distance])
    return SimpleNamespace(id=id, label=name, box_px=box, visible=visible, distance_m=distance, T_cam_obj=T)


def watch(labels, frames=1000, visibility_m=None, is_dark=False, seed=1, patched=frozenset(), **changes):
    detector = ObjectDetector(
        ObjectDetectorSettings(**changes), CAMERA, visibility_m=visibility_m, is_dark=is_dark, seed=seed
    )
    return [detector.look(labels, 0.1 * k, k * 10**8, patched=patched) for k in range(frames)]


def share_seen(claims):
    return np.mean([bool(claim.detections) for claim in claims])


def test_misses_grow_with_distance_fog_darkness_and_occlusion():
    def seen(visibility_m=None, is_dark=False, **kwargs):
        settings = ObjectDetectorSettings(false_positives=0.0)
        one = ObjectDetector(settings, CAMERA, visibility_m=visibility_m, is_dark=is_dark, seed=0)
        return 1.0 - one.miss_probability(label(**kwargs))

    assert seen() == pytest.approx(0.98, abs=0.005)
    assert seen(is_dark=True) == pytest.approx(0.92, abs=0.005)
    assert seen(height=25.0) == pytest.approx(0.93, abs=0.02)
    assert seen(height=16.0) == pytest.approx(0.49, abs=0.02)
    assert seen(height=8.0) < 0.1
    assert seen(visible=0.25) == pytest.approx(0.49, abs=0.02)
    in_fog = [seen(visibility_m=45.0, distance=d) for d in (10.0, 20.0, 35.0, 45.0)]
    assert in_fog == sorted(in_fog, reverse=True)
    assert in_fog[0] > 0.9
    assert in_fog[-1] < 0.2


def lengths_of_gaps(height):
    claims = watch([label(height=height)], frames=15_000, false_positives=0.0)
    missed = np.array([not claim.detections for claim in claims])
    return missed.mean(), np.diff(np.flatnonzero(np.diff(np.r_[0, missed, 0])))[::2].mean()


def test_misses_in_plain_view_are_chance_and_those_of_the_half_seen_last():
    share, length = lengths_of_gaps(60.0)
    assert share == pytest.approx(0.02, abs=0.01)
    assert length == pytest.approx(1.3, rel=0.15)
    share, length = lengths_of_gaps(16.0)
    assert share == pytest.approx(0.51, abs=0.04)
    assert length == pytest.approx(4.1, rel=0.15)


def test_tracks_last_and_labels_flicker():
    claims = watch([label(), label(2, "pedestrian")], frames=5000, false_positives=0.0)
    names = [d.label for claim in claims for d in claim.detections if d.label in ("car", "van")]
    assert names.count("van") / len(names) == pytest.approx(0.02, abs=0.012)
    first = [d.track_id for claim in claims[:20] for d in claim.detections]
    assert set(first) == {"1", "2"}


def test_boxes_and_positions_are_near_the_truth():
    claims = watch([label()], frames=4000, false_positives=0.0, confusion=0.0)
    boxes = np.array([d.box_px for claim in claims for d in claim.detections])
    np.testing.assert_allclose(boxes.mean(axis=0), label().box_px, atol=0.2)
    np.testing.assert_allclose(boxes.std(axis=0), [1.56, 1.2, 1.56, 1.2], rtol=0.1)
    positions = np.array([d.position_m for claim in claims for d in claim.detections])
    np.testing.assert_allclose(positions.std(axis=0), 0.135, rtol=0.15)
    far = watch([label(distance=100.0)], frames=3, miss=0.0, false_positives=0.0)
    assert all(d.position_m is None for claim in far for d in claim.detections)


def test_things_that_are_not_there_are_few_and_short():
    claims = watch([], frames=10_000, false_positives=0.03, false_positive_frames=1.5)
    lives = {}
    for claim in claims:
        for detection in claim.detections:
            lives[detection.track_id] = lives.get(detection.track_id, 0) + 1
            assert (detection.box_px >= 0).all()
            assert (detection.box_px <= [640, 480, 640, 480]).all()
    assert len(lives) / len(claims) == pytest.approx(0.03, rel=0.15)
    assert np.mean(list(lives.values())) == pytest.approx(1.5, rel=0.1)


@pytest.mark.parametrize("effect", ["hide", "relabel", "none"])
def test_a_patch_hides_or_relabels(effect):
    claims = watch(
        [label(5, "stop sign")],
        patched=frozenset({5}),
        patch=effect,
        miss=0.0,
        confusion=0.0,
        false_positives=0,
    )
    found = [d.label for claim in claims for d in claim.detections]
    if effect == "hide":
        assert share_seen(claims) == pytest.approx(0.1, abs=0.03)
    elif effect == "relabel":
        assert found.count("bird") / len(found) == pytest.approx(0.9, abs=0.03)
    else:
        assert found == ["stop sign"] * 1000


def test_the_same_seed_sees_the_same():
    a, b, c = (watch([label()], frames=50, seed=seed) for seed in (1, 1, 2))

    def flat(claims):
        return [(d.label, d.score, *d.box_px) for claim in claims for d in claim.detections]

    assert flat(a) == flat(b) != flat(c)
