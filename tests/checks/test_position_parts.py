"""The parts of the position check, each by itself."""

import math

import numpy as np
import pytest

from belie.checks.alignment import Alignment
from belie.checks.innovation_test import InnovationTest
from belie.checks.position_noise import PositionNoise
from belie.checks.position_settings import PositionSettings
from belie.checks.return_test import Return
from belie.checks.running_scale import RunningScale
from belie.checks.sequential import Evidence, SequentialSettings
from belie.checks.unaligned import Unaligned
from belie.geometry import SE3, so3_exp

SETTINGS = PositionSettings()
UNIT = np.ones(3)


def test_running_scale_is_the_quantile_of_its_memory():
    rng = np.random.default_rng(0)
    scale = RunningScale(prior=3.0, least=0.0, memory=200, learning=20, waiting=0)
    x = rng.normal(size=1000) * np.repeat([5.0, 1.0], 500)
    for value in x:
        scale.learn(value)
    assert scale.count == 200
    assert scale.value == pytest.approx(np.quantile(np.abs(x[-200:]), 0.6827), rel=0.05)


def test_running_scale_sees_correlation_and_only_a_positive_one():
    rng = np.random.default_rng(1)
    for phi, expected in ((0.6, 0.6), (0.0, 0.0), (-0.5, 0.0)):
        scale = RunningScale(prior=1.0, least=0.0, memory=2000, learning=20, waiting=0)
        x = 0.0
        for e in rng.normal(size=2000):
            x = phi * x + e
            scale.learn(x)
        assert scale.correlation == pytest.approx(expected, abs=0.12)


def test_what_waits_can_be_dropped():
    scale = RunningScale(prior=3.0, least=0.0, memory=600, learning=20, waiting=50)
    for _ in range(100):
        scale.learn(1.0)
    for _ in range(50):
        scale.learn(100.0)
    scale.drop_waiting()
    for _ in range(60):
        scale.learn(1.0)
    assert scale.value == 1.0


def learned(sigma_m, time_s, declared, unit_m=UNIT, n=1200):
    rng = np.random.default_rng(3)
    noise = PositionNoise(SETTINGS, declared=declared)
    fade = math.exp(-0.1 / time_s) if time_s else 0.0
    x = np.zeros(3)
    for i in range(n):
        x = fade * x + math.sqrt(1.0 - fade**2) * sigma_m * rng.normal(size=3)
        noise.learn(i * 10**8, x, unit_m)
    return noise.fast_sigma_m(unit_m), noise.walk_m(unit_m)


def test_white_noise_does_not_wander():
    fast, walk = learned(0.5, 0.0, declared=False)
    assert fast == pytest.approx(0.5, rel=0.15)
    assert (walk < 0.3).all()


def test_slow_noise_wanders_at_its_rate():
    fast, walk = learned(1.0, 30.0, declared=False)
    assert (fast < 0.1).all()
    assert (walk > 0.8 * math.sqrt(2.0 / 30.0)).all()
    assert (walk < 2.0 * math.sqrt(2.0 / 30.0)).all()


def test_a_declared_covariance_is_a_promise():
    fast, walk = learned(0.01, 0.0, declared=True, unit_m=0.5 * UNIT)
    assert fast == pytest.approx(0.5)
    assert walk == pytest.approx(0.5 * math.sqrt(2.0 / SETTINGS.multipath_time_s))


def aligned(**more):
    return Alignment(
        SETTINGS, np.eye(3), np.full(3, 0.05), np.zeros(3), SE3.identity(), offset_sigma_m=0.1 * UNIT,
        lever_sigma_m=0.0, **more,
    )  # fmt: skip


def test_alignment_learns_yaw_and_scale():
    alignment = aligned()
    R, T = so3_exp(np.array([0.0, 0.0, 0.04])), SE3.identity()
    for i in range(300):
        T = SE3(np.eye(3), T.t + 0.5 * np.array([math.cos(0.02 * i), math.sin(0.02 * i), 0.0]))
        alignment.advance(T, 0.1, 0.01 * UNIT)
        H, noise = alignment.jacobian(), 1e-4 * np.eye(3)
        innovation, S = alignment.errors.innovation(alignment.residual(R @ T.t * 1.01), H, noise)
        alignment.errors.learn(innovation, S, H)
        alignment.settle()
    assert np.abs(innovation).max() < 0.01
    assert alignment.errors.mean[3] == pytest.approx(0.01, abs=0.005)
    assert alignment.heading_sigma_rad < 0.02


def test_a_lie_is_unlearned():
    alignment = aligned()
    T = SE3.identity()
    for i in range(60):
        T = SE3.from_translation([0.5 * i, 0.0, 0.0])
        alignment.advance(T, 0.1, 0.05 * UNIT)
        H = alignment.jacobian()
        lie = np.array([0.0, 0.1 * max(0, i - 40), 0.0])
        innovation, S = alignment.errors.innovation(alignment.residual(T.t + lie), H, 1e-2 * np.eye(3))
        alignment.errors.learn(innovation, S, H)
        alignment.settle()
        alignment.remember(i * 10**8)
    swallowed = alignment.residual(T.t) - H @ alignment.errors.mean
    alignment.take_back(40 * 10**8, 59 * 10**8, 0.05 * UNIT)
    honest = alignment.residual(T.t) - alignment.jacobian() @ alignment.errors.mean
    assert np.linalg.norm(swallowed) > 1.0
    assert np.linalg.norm(honest) < 0.05


def test_false_alarms_of_white_innovations_stay_rare():
    test = InnovationTest(
        9, SequentialSettings(false_alarms_per_hour=10.0), tests=1, memory=600, learning=20, waiting=50
    )
    rng = np.random.default_rng(0)
    x = rng.normal(size=(18000, 9))  # half an hour: five alarms are allowed
    hits = [test.update(v, np.eye(9), i * 10**8, 0.1).contradicted for i, v in enumerate(x)]
    assert np.sum(np.diff(np.array(hits, dtype=int)) == 1) <= 10


def test_return_needs_all_of_the_release_time():
    accusation = Evidence(
        contradicted=True, statistic=9.0, threshold=8.0, unit="llr", component=2, onset_ns=7
    )
    wait = Return(accusation, 1.0)
    e = [wait.update(np.zeros(3), np.eye(3), 0.5 * np.eye(3), i * 10**8) for i in range(12)]
    assert [v.contradicted for v in e] == [True] * 10 + [False] * 2
    assert (e[0].component, e[0].onset_ns) == (2, 7)


@pytest.mark.parametrize("yaw_deg", [-170.0, -30.0, 0.0, 90.0])
def test_heading_is_fitted_within_its_stated_error(yaw_deg):
    rng = np.random.default_rng(0)
    R = so3_exp(np.array([0.0, 0.0, math.radians(yaw_deg)]))
    noise = PositionNoise(SETTINGS, declared=True)
    unaligned = Unaligned(SETTINGS, SequentialSettings(), tests=1)
    for i in range(100):
        q = np.array([0.4 * i, 3.0 * math.sin(0.05 * i), 0.0])
        evidence = unaligned.update(i * 10**8, R @ q + rng.normal(0.0, 0.2, 3), q, noise, 0.2 * UNIT)
        assert not evidence.contradicted
    heading = unaligned.heading(noise, 0.2 * UNIT)
    error = (heading.yaw_rad - math.radians(yaw_deg) + math.pi) % (2.0 * math.pi) - math.pi
    assert abs(error) < 2.0 * heading.sigma_rad < math.radians(10.0)
