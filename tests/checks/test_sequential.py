import numpy as np
import pytest

from belie.checks.sequential import CusumBank, SequentialSettings, cusum_threshold


def run_length(rng, shift, threshold, limit):
    """Frames until a one-sided CUSUM crosses, for many walks at once."""
    sums = np.zeros(2000)
    alive = np.ones(2000, bool)
    length = np.full(2000, limit)
    for i in range(limit):
        sums = np.maximum(0.0, sums + shift * rng.normal(size=2000) - 0.5 * shift * shift)
        crossed = alive & (sums > threshold)
        length[crossed] = i + 1
        alive &= ~crossed
        if not alive.any():
            break
    return length


@pytest.mark.parametrize("shift", [0.5, 1.0, 2.0])
def test_threshold_keeps_the_mean_time_between_false_alarms(shift):
    wanted = 300.0
    lengths = run_length(np.random.default_rng(1), shift, cusum_threshold(shift, wanted), 6000)
    assert lengths.mean() == pytest.approx(wanted, rel=0.15)


def test_bank_keeps_its_promise_on_white_noise():
    settings = SequentialSettings(false_alarms_per_hour=20.0)
    rng = np.random.default_rng(2)
    bank, alarms, standing = CusumBank(2, settings), 0, False
    hours = 4
    for i in range(hours * 36000):
        now = bank.update(rng.normal(size=2), i * 10**8, 0.1).contradicted
        alarms += now and not standing
        standing = now
    assert 0 < alarms <= 1.3 * 20 * hours  # Bonferroni makes it fewer than promised, never many more


def test_one_outlier_is_no_lie_but_a_jump_is():
    bank = CusumBank(1, SequentialSettings())
    assert not bank.update(np.array([8.0]), 0, 0.1).contradicted
    assert bank.update(np.array([-16.0]), 10**8, 0.1).contradicted


def test_onset_is_when_the_evidence_began():
    bank, rng = CusumBank(1, SequentialSettings()), np.random.default_rng(0)
    for i in range(100):
        bank.update(rng.normal(size=1), i * 10**8, 0.1)
    i, evidence = 100, None
    while evidence is None or not evidence.contradicted:
        evidence = bank.update(rng.normal(size=1) + 3.0, i * 10**8, 0.1)
        i += 1
    assert abs(evidence.onset_ns - 100 * 10**8) <= 3 * 10**8


def test_a_contradiction_ends_a_while_after_the_lie():
    settings = SequentialSettings(release_s=1.0)
    bank, rng = CusumBank(1, settings), np.random.default_rng(0)
    for i in range(30):
        last = bank.update(np.array([5.0]), i * 10**8, 0.1)
    assert last.contradicted
    states = [bank.update(rng.normal(size=1), i * 10**8, 0.1).contradicted for i in range(30, 70)]
    assert states[0]
    assert not states[-1]
    assert states.index(False) < 30


def test_nothing_accumulates_while_only_jumps_count():
    bank = CusumBank(1, SequentialSettings())
    for i in range(100):
        evidence = bank.update(np.array([3.0]), i * 10**8, 0.1, jumps_only=True)
    assert not evidence.contradicted
    assert evidence.statistic == 0.0
