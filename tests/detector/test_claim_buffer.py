import numpy as np
import pytest

from belie.detector.claim_buffer import ClaimBuffer, motion_between, pose_at
from belie.geometry import SE3, so3_log
from belie.types import MotionClaim, PoseClaim

MS = 10**6


def pose(stamp_ms, x):
    return PoseClaim(
        source="/odom", frame_id="odom", stamp_ns=stamp_ms * MS, received_ns=0,
        T_odom_body=SE3.from_translation([x, 0, 0]),
    )  # fmt: skip


def rate(stamp_ms, yaw, speed=None):
    return MotionClaim(
        source="/imu", kind="imu" if speed is None else "twist", stamp_ns=stamp_ms * MS, received_ns=0,
        angular_rad_s=np.array([0, 0, yaw]), linear_m_s=None if speed is None else np.array([speed, 0, 0]),
    )  # fmt: skip


def buffer(*claims):
    result = ClaimBuffer()
    for claim in claims:
        result.add(claim)
    return result


def x_at(b, stamp_ms):
    T = pose_at(b, stamp_ms * MS)
    return None if T is None else float(T.t[0])


def test_poses_are_interpolated_whatever_order_they_came_in():
    b = buffer(pose(40, 4.0), pose(0, 0.0), pose(20, 2.0))
    assert x_at(b, 30) == pytest.approx(3.0)
    assert x_at(b, 20) == 2.0


def test_extrapolation_reaches_one_period_and_no_further():
    b = buffer(pose(0, 0.0), pose(20, 2.0))
    assert x_at(b, 35) == pytest.approx(3.5)
    assert x_at(b, 45) is None
    assert x_at(b, -1) is None


def test_no_interpolation_over_a_long_gap():
    assert x_at(buffer(pose(0, 0.0), pose(900, 9.0)), 400) is None


def test_a_longer_gap_can_be_allowed_but_nothing_is_extrapolated_over_it():
    b = ClaimBuffer(250 * MS)
    for i in range(4):
        b.add(pose(200 * i, 2.0 * i))
    assert b.period_ns() == 200 * MS
    assert x_at(b, 300) == pytest.approx(3.0)
    assert x_at(b, 610) is None


def test_a_repeated_stamp_replaces_and_old_claims_go():
    b = buffer(pose(0, 0.0), pose(0, 5.0))
    assert len(b) == 1
    assert x_at(b, 0) == 5.0
    for i in range(1, 40):
        b.add(pose(i, 0.0))
    b.add(pose(10_000, 1.0))
    assert len(b) == 1 + 20, "a few stay: what was said before a gap"


def test_rates_are_integrated_exactly_for_a_linear_rate():
    # yaw rate 0.1 t rad/s: the angle from 0 to 1 s is 0.05 rad
    b = buffer(*(rate(i * 5, 0.1 * i * 0.005) for i in range(220)))
    R, t = motion_between(b, 0, 1000 * MS)
    assert so3_log(R)[2] == pytest.approx(0.05, abs=1e-9)
    assert t is None


def test_interval_ends_between_samples_count_in_part():
    b = buffer(*(rate(i * 10, 1.0, 2.0) for i in range(20)))
    R, t = motion_between(b, 13 * MS, 57 * MS)
    assert so3_log(R)[2] == pytest.approx(0.044)
    # a circle: chord of radius 2 m over 0.044 rad
    assert np.linalg.norm(t) == pytest.approx(2 * 2.0 * np.sin(0.022), rel=1e-4)


def test_rates_far_apart_are_integrated_between_them_and_no_further():
    b = ClaimBuffer(250 * MS)
    for i in range(4):
        b.add(rate(200 * i, 0.1 * i))
    assert so3_log(motion_between(b, 0, 600 * MS)[0])[2] == pytest.approx(0.09)
    assert motion_between(b, 500 * MS, 610 * MS) is None


@pytest.mark.parametrize("stamps", [[], [50], range(0, 40, 10), [0, 700, 1400]])
def test_streams_that_do_not_cover_the_interval_give_nothing(stamps):
    b = buffer(*(rate(s, 1.0) for s in stamps))
    assert motion_between(b, 0, 100 * MS) is None
