"""The paper's thresholds, to the letter, and three answers."""

import numpy as np
import pytest

from belie.checks.paper import PaperThresholds, odometry_check, position_check, position_step_m2
from belie.geometry import SE3
from belie.types import PositionClaim, Status, VisualEstimate

SETTINGS = PaperThresholds()


def estimate(error_px2, reason=None):
    return VisualEstimate(
        stamp_ns=2, previous_stamp_ns=1, T_prev_cur=SE3.identity(), covariance=np.eye(6), corners=900,
        matches=400, inliers=300, parallax_px=9.0, error_px2=error_px2, reason=reason,
    )  # fmt: skip


def fix(position_m, stamp_ns=2, source="/gnss"):
    return PositionClaim(
        source=source, frame_id="enu", kind="gnss", stamp_ns=stamp_ns, received_ns=0, position_m=position_m
    )


BEFORE = fix([10.0, 20.0, 30.0], stamp_ns=1)


def test_thresholds_are_the_papers():
    assert (SETTINGS.odometry_error_px2, SETTINGS.vouched_error_px2, SETTINGS.position_step_m2) == (
        40,
        20,
        20,
    )


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (0.0, Status.CONSISTENT),
        (40.0, Status.CONSISTENT),
        (40.001, Status.CONTRADICTED),
        (132.0, Status.CONTRADICTED),
        (float("inf"), Status.CONTRADICTED),
    ],
)
def test_odometry_lies_above_t1(error, status):
    result = odometry_check(estimate(error), "/odom", SETTINGS)
    assert (result.status, result.statistic, result.threshold, result.unit) == (status, error, 40.0, "px2")
    assert (result.check, result.source) == ("odometry", "/odom")


def test_odometry_without_evidence_is_undecided():
    result = odometry_check(estimate(None, "too dark"), "/odom", SETTINGS)
    assert (result.status, result.reason, result.statistic) == (Status.UNDECIDED, "too dark", None)
    # An estimate that doubts itself is never an accusation, whatever its number.
    assert odometry_check(estimate(500.0, "too dark"), "/odom", SETTINGS).status is Status.UNDECIDED


def test_step_is_the_mean_over_three_coordinates():
    assert position_step_m2(np.array([1.0, 2.0, 3.0]), np.array([4.0, 2.0, 9.0])) == pytest.approx(
        (9 + 36) / 3
    )


@pytest.mark.parametrize(
    ("error", "step_m", "status"),
    [
        (5.0, 7.7, Status.CONSISTENT),  # 7.7² / 3 = 19.8
        (5.0, 7.8, Status.CONTRADICTED),  # 20.3
        (19.9, 100.0, Status.CONTRADICTED),
        (20.0, 100.0, Status.UNDECIDED),  # T2: the odometry itself is in doubt
        (132.0, 100.0, Status.UNDECIDED),
        (132.0, 1.0, Status.CONSISTENT),
    ],
)
def test_position_lies_when_it_jumps_and_the_odometry_is_sound(error, step_m, status):
    for axis in range(3):
        moved = BEFORE.position_m + step_m * np.eye(3)[axis]
        result = position_check(estimate(error), BEFORE, fix(moved), SETTINGS)
        assert (result.status, result.unit, result.check) == (status, "m2", "position")
        assert result.statistic == pytest.approx(step_m**2 / 3)


def test_position_without_evidence_is_undecided():
    far = fix(BEFORE.position_m + 100.0)
    assert position_check(estimate(5.0), None, far, SETTINGS).status is Status.UNDECIDED
    blind = position_check(estimate(None, "blank wall"), BEFORE, far, SETTINGS)
    assert blind.status is Status.UNDECIDED
    assert "blank wall" in blind.reason


def test_position_claims_must_be_consecutive_and_of_one_source():
    with pytest.raises(ValueError, match="one source"):
        position_check(estimate(5.0), fix([0, 0, 0], 1, "/other"), fix([0, 0, 0]), SETTINGS)
    with pytest.raises(ValueError, match="consecutive"):
        position_check(estimate(5.0), fix([0, 0, 0], 9), fix([0, 0, 0], 2), SETTINGS)


def test_every_answer_has_a_reason_for_a_person():
    results = [
        odometry_check(estimate(9.0), "/odom", SETTINGS),
        odometry_check(estimate(99.0), "/odom", SETTINGS),
        position_check(estimate(5.0), None, BEFORE, SETTINGS),
        position_check(estimate(5.0), BEFORE, fix(BEFORE.position_m + 1), SETTINGS),
        position_check(estimate(5.0), BEFORE, fix(BEFORE.position_m + 50), SETTINGS),
    ]
    assert all(len(result.reason) > 10 for result in results)
    assert len({result.reason for result in results}) == len(results)
