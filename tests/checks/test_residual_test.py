import numpy as np
import pytest

from belie.checks.noise_scale import NoiseScale, NoiseScaleSettings
from belie.checks.residual_test import ResidualTest
from belie.checks.sequential import SequentialSettings
from belie.checks.systematic import SystematicErrors


def test_scale_learns_size_offset_and_correlation():
    rng = np.random.default_rng(0)
    scale = NoiseScale(1, NoiseScaleSettings(memory_frames=400, recent_frames=400, prior_frames=1))
    x = 0.0
    for _ in range(400):
        x = 0.7 * x + rng.normal() * np.sqrt(1 - 0.49)
        scale.learn(np.array([3.0 * x + 1.0]))
    assert scale.value[0] == pytest.approx(3.0, rel=0.2)
    assert scale.correlation[0] == pytest.approx(0.65, abs=0.12)


def test_scale_falls_again_after_a_noisy_start():
    rng = np.random.default_rng(0)
    scale = NoiseScale(1, NoiseScaleSettings())
    for _ in range(15):
        scale.learn(rng.normal(size=1) * 10.0)
    for _ in range(30):
        scale.learn(rng.normal(size=1))
    assert scale.value[0] < 3.0


def test_systematic_errors_ignore_outliers():
    errors = SystematicErrors(np.array([1.0]), np.array([0.0]))
    rng, H, noise = np.random.default_rng(0), np.eye(1), np.array([[0.01]])
    for i in range(200):
        r = np.array([0.2 + rng.normal(0, 0.1) + (5.0 if i % 7 == 0 and i > 20 else 0.0)])
        innovation, S = errors.innovation(r, H, noise)
        errors.learn(innovation, S, H)
    assert errors.mean[0] == pytest.approx(0.2, abs=0.05)


def test_walk_never_exceeds_the_prior():
    errors = SystematicErrors(np.array([0.5]), np.array([10.0]))
    errors.predict(100.0)
    assert errors.covariance[0, 0] == pytest.approx(0.25)


def make_test():
    errors = SystematicErrors(np.array([0.02]), np.array([0.0]))
    return ResidualTest(1, errors, SequentialSettings(), NoiseScaleSettings(), tests=1)


def feed(test, values, start=0):
    H, noise = np.eye(1), np.array([[1e-4]])
    return [
        test.update(np.array([v]), H, noise, (start + i) * 10**8, 0.1).contradicted
        for i, v in enumerate(values)
    ]


def test_lie_is_found_and_never_learned():
    rng, test = np.random.default_rng(3), make_test()
    assert not any(feed(test, rng.normal(0, 0.01, 300)))
    found = feed(test, rng.normal(0.05, 0.01, 600), 300)
    assert found.index(True) < 10
    assert all(found[10:])  # after a minute it is still a lie


@pytest.mark.parametrize("noise", [1.0, 3.0])
def test_noise_larger_than_its_model_makes_no_alarm(noise):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        assert not any(feed(make_test(), rng.normal(0, 0.01 * noise, 600)))


def test_floor_is_what_is_found():
    rng, test = np.random.default_rng(4), make_test()
    feed(test, rng.normal(0, 0.01, 300))
    lie = 1.2 * float(test.floor()[0])
    found = feed(test, rng.normal(lie, 0.01, 15), 300)
    assert any(found)


@pytest.mark.parametrize("onset", [20, 22, 24, 28])
def test_a_lie_right_after_learning_is_one_lie(onset):
    rng, test = np.random.default_rng(5), make_test()
    feed(test, rng.normal(0, 0.01, onset))
    found = feed(test, rng.normal(0.1, 0.01, 100), onset)
    assert all(found[found.index(True) :])
