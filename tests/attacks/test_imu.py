"""IMU attacks: angular rates and accelerations in body axes."""

import numpy as np
import pytest

from belie.attacks import attack
from belie.types import MotionClaim

SPAN = "start=10,stop=20"


@pytest.fixture
def samples(curve, claims_of):
    """True and claimed samples within the span, as arrays of rates and accelerations."""

    def collect(text, **options):
        source = curve(**options)
        stamps = source.frame_stamps_ns()
        pairs = zip(
            claims_of(source, MotionClaim, "/imu"),
            claims_of(attack(source, text), MotionClaim, "/imu"),
            strict=True,
        )
        inside = [(a, b) for a, b in pairs if stamps[10] <= a.stamp_ns < stamps[20]]
        assert len(inside) == 200
        return (
            np.array([a.angular_rad_s for a, _ in inside]),
            np.array([b.angular_rad_s for _, b in inside]),
            np.array([a.acceleration_m_s2 for a, _ in inside]),
            np.array([b.acceleration_m_s2 for _, b in inside]),
        )

    return collect


@pytest.mark.parametrize(("axes", "up"), [("flu", [0, 0, 1]), ("rdf", [0, -1, 0])])
@pytest.mark.parametrize("text", ["imu-bias:rate=0.5", "imu-offset:magnitude=0.5,axis=yaw"])
def test_yaw_bias_is_in_degrees_a_second_about_up(samples, axes, up, text):
    true, lied, true_acceleration, acceleration = samples(f"{text},{SPAN}", body_axes=axes)
    assert lied - true == pytest.approx(np.tile(np.radians(0.5) * np.array(up), (200, 1)), abs=1e-12)
    assert np.array_equal(acceleration, true_acceleration)


def test_coordinates_are_those_of_the_gyro(samples):
    true, lied, _, _ = samples(f"imu-bias:rate=1,axis=x,{SPAN}", body_axes="rdf")
    assert lied - true == pytest.approx(np.tile([np.radians(1), 0, 0], (200, 1)), abs=1e-12)


@pytest.mark.parametrize(("axes", "forward"), [("flu", [1, 0, 0]), ("rdf", [0, 0, 1])])
def test_vehicle_axes_mean_the_acceleration(samples, axes, forward):
    true, lied, true_acceleration, acceleration = samples(
        f"imu-bias:rate=0.3,axis=forward,{SPAN}", body_axes=axes
    )
    assert acceleration - true_acceleration == pytest.approx(np.tile(0.3 * np.array(forward), (200, 1)))
    assert np.array_equal(lied, true)


def test_ramp_grows_with_time_and_offset_rate_with_frames(samples):
    for text in ("imu-ramp:rate=10", "imu-offset:rate=1"):
        true, lied, _, _ = samples(f"{text},{SPAN}")
        assert (lied - true)[[0, -1], 2] == pytest.approx(np.radians([0.05, 10.0]), abs=1e-6)


def test_scale_flip_and_set(samples):
    true, lied, _, _ = samples(f"imu-scale:factor=1.2,{SPAN}")
    assert lied == pytest.approx(1.2 * true)
    true, lied, _, _ = samples(f"imu-scale:factor=3,axis=roll,{SPAN}")
    assert lied == pytest.approx(true * [3, 1, 1])
    true, lied, _, _ = samples(f"imu-flip:{SPAN}")
    assert lied == pytest.approx(true * [1, 1, -1])
    true, lied, _, _ = samples(f"imu-set:axis=pitch,value=2,{SPAN}")
    assert lied == pytest.approx(np.column_stack([true[:, 0], np.full(200, np.radians(2)), true[:, 2]]))


def test_noise_and_sinusoid(samples):
    true, lied, _, _ = samples(f"imu-noise:sigma=2,{SPAN}")
    assert (lied - true).std(axis=0) == pytest.approx([np.radians(2)] * 3, rel=0.2)
    true, lied, _, _ = samples(f"imu-noise:sigma=2,axis=yaw,{SPAN}")
    assert np.array_equal(lied[:, :2], true[:, :2])
    true, lied, _, _ = samples(f"imu-sinusoid:amplitude=3,period=0.5,{SPAN}")
    assert np.abs(lied - true).max() == pytest.approx(np.radians(3), rel=1e-2)


def test_freeze_replay_delay(samples):
    true, lied, _, acceleration = samples(f"imu-freeze:{SPAN}")
    assert np.ptp(lied, axis=0) == pytest.approx(0.0, abs=0.0)
    assert np.ptp(acceleration, axis=0) == pytest.approx(0.0, abs=0.0)
    true, lied, _, _ = samples(f"imu-replay:delay=0.2s,{SPAN}")
    assert np.array_equal(lied[40:], true[:-40])
    assert not np.array_equal(lied[0], lied[1])
    true, lied, _, _ = samples(f"imu-delay:delay=2,{SPAN}")
    assert np.array_equal(lied[40:], true[:-40])
    assert np.array_equal(lied[:40], np.tile(lied[0], (40, 1)))
