import numpy as np
import pytest

from belie.checks import ImuCheck, OdometryCheck
from belie.geometry import SE3
from belie.types import Status, VisualEstimate

STEP = SE3.exp([0.02, 0.0, 0.8, 0.0, 0.004, 0.0])
COVARIANCE = np.diag([0.002, 0.002, 0.004, 1e-4, 1e-4, 1e-4]) ** 2


def estimate(i, T=STEP, unit=0.25, rng=None, **changes):
    noisy = T if rng is None else T @ SE3.exp(rng.normal(size=6) * np.sqrt(np.diag(COVARIANCE)))
    values = {
        "stamp_ns": i * 10**8, "previous_stamp_ns": (i - 1) * 10**8, "T_prev_cur": SE3(noisy.R, noisy.t * unit),
        "covariance": COVARIANCE * np.outer([unit] * 3 + [1] * 3, [unit] * 3 + [1] * 3),
        "corners": 400, "matches": 400, "inliers": 380, "parallax_px": 9.0,
    }  # fmt: skip
    return VisualEstimate(**(values | changes))


def run(check, lie, frames=30, start=60):
    rng = np.random.default_rng(0)
    statuses = []
    for i in range(1, start + frames):
        T = STEP if i < start else lie(i - start + 1)
        statuses.append(check.update(estimate(i, rng=rng), T).status)
    return statuses[: start - 1], statuses[start - 1 :]


def odometry():
    return OdometryCheck("/odom", "odometry", tests=4)


LIES = {
    "sideways": lambda k: SE3(STEP.R, STEP.t + np.array([0.2, 0.0, 0.0])),
    "slowly sideways": lambda k: SE3(STEP.R, STEP.t + np.array([0.05, 0.0, 0.0])),
    "scale": lambda k: SE3(STEP.R, 1.2 * STEP.t),
    "frozen": lambda k: SE3.identity(),
    "backwards": lambda k: STEP.inverse(),
    "yaw": lambda k: STEP @ SE3.exp([0, 0, 0, 0, np.radians(0.2), 0]),
}


@pytest.mark.parametrize("name", LIES)
def test_lies_are_found_and_honest_frames_are_not_accused(name):
    before, after = run(odometry(), LIES[name])
    assert Status.CONTRADICTED not in before
    assert before[-1] is Status.CONSISTENT
    assert after.index(Status.CONTRADICTED) < 10


def test_a_constant_scale_from_the_start_cannot_be_seen():
    """The absolute scale of one camera is not observable; the verdict says whose scale it used."""
    check, rng = odometry(), np.random.default_rng(0)
    for i in range(1, 60):
        result = check.update(estimate(i, rng=rng), SE3(STEP.R, 1.5 * STEP.t))
    assert result.status is Status.CONSISTENT
    assert "scale" in result.reason
    assert check.metres_per_unit == pytest.approx(1.5 / 0.25, rel=0.05)


def test_camera_that_sits_askew_is_no_lie():
    askew = SE3.exp([0.05, 0.0, 0.02, 0.02, 0.03, -0.02])
    check, rng = odometry(), np.random.default_rng(0)
    for i in range(1, 150):
        turn = SE3.exp([0.02, 0.0, 0.8, 0.0, 0.03 * np.sin(i / 8), 0.0])
        result = check.update(estimate(i, T=turn, rng=rng), askew @ turn @ askew.inverse())
        assert result.status is not Status.CONTRADICTED, i
    assert result.status is Status.CONSISTENT


def test_no_baseline_checks_rotation_only():
    check, rng = odometry(), np.random.default_rng(0)
    for i in range(1, 40):
        seen = estimate(i, T=SE3.identity(), rng=rng, reason="no baseline yet")
        result = check.update(seen, SE3.identity())
    assert result.status is Status.UNDECIDED
    assert "baseline" in result.reason
    for i in range(40, 50):
        seen = estimate(i, T=SE3.identity(), rng=rng, reason="no baseline yet")
        result = check.update(seen, SE3.exp([0, 0, 0, 0, np.radians(0.5), 0]))
    assert result.status is Status.CONTRADICTED


def test_blind_camera_and_missing_claim_are_undecided():
    check = odometry()
    assert check.update(estimate(1, inliers=0, reason="dark: mean gray value 3"), STEP).reason.startswith(
        "dark"
    )
    assert check.update(estimate(2), None).status is Status.UNDECIDED


def test_imu_bias_at_power_on_is_no_lie_but_its_change_is():
    check, rng = ImuCheck("/imu", tests=4), np.random.default_rng(0)
    bias = np.radians([0.3, -0.4, 0.2])
    rotation = SE3.exp([0, 0, 0, 0.0, 0.004, 0.0]).R

    def claimed(rate):
        return rotation @ SE3.exp([0, 0, 0, *(rate * 0.1)]).R

    for i in range(1, 100):
        result = check.update(estimate(i, rng=rng), claimed(bias))
        assert result.status is not Status.CONTRADICTED
    assert result.status is Status.CONSISTENT
    statuses = [
        check.update(estimate(i, rng=rng), claimed(bias + np.radians([0, 0.5, 0]))).status
        for i in range(100, 115)
    ]
    assert Status.CONTRADICTED in statuses[:10]


def test_a_new_map_with_another_unit_is_no_lie():
    check, rng = odometry(), np.random.default_rng(0)
    for i in range(1, 60):
        check.update(estimate(i, rng=rng), STEP)
    statuses = [check.update(estimate(i, unit=0.02, rng=rng, map_id=1), STEP).status for i in range(60, 120)]
    assert Status.CONTRADICTED not in statuses
    assert statuses[-1] is Status.CONSISTENT


def test_a_liar_does_not_get_to_set_the_scale_of_a_new_map():
    check, rng = odometry(), np.random.default_rng(0)
    for i in range(1, 60):
        check.update(estimate(i, rng=rng), STEP)
    lie = SE3(STEP.R, 3.0 * STEP.t)
    assert check.update(estimate(60, rng=rng), lie).status is Status.CONTRADICTED
    unit = check.metres_per_unit
    check.update(estimate(61, rng=rng, map_id=1), lie)
    assert check.metres_per_unit == unit


def test_standing_first_does_not_teach_the_noise_of_driving():
    still = SE3.identity()
    for seed in range(5):
        check, rng = odometry(), np.random.default_rng(seed)
        for i in range(1, 60):
            check.update(estimate(i, T=still, rng=rng, reason="no baseline yet"), still)
        for i in range(60, 140):
            noisy = SE3(STEP.R, STEP.t + rng.normal(0, 2.5 * 0.01 * 0.8, 3))
            assert check.update(estimate(i, rng=rng), noisy).status is not Status.CONTRADICTED


@pytest.mark.parametrize("rate_hz", [10, 60, 100])
def test_a_heading_jump_is_caught_at_any_rate(rate_hz):
    check, rng = odometry(), np.random.default_rng(0)
    for i in range(1, 300):
        stamps = {"stamp_ns": i * 10**9 // rate_hz, "previous_stamp_ns": (i - 1) * 10**9 // rate_hz}
        check.update(estimate(i, rng=rng, **stamps), STEP)
    jumped = STEP @ SE3.exp([0, 0, 0, 0, 2.0, 0])
    stamps = {"stamp_ns": 300 * 10**9 // rate_hz, "previous_stamp_ns": 299 * 10**9 // rate_hz}
    assert check.update(estimate(300, rng=rng, **stamps), jumped).status is Status.CONTRADICTED


@pytest.mark.parametrize("still", [50, 300])
def test_a_stop_forgets_neither_scale_nor_noise(still):
    """What creeps by a fraction of a millimetre in a standing picture says nothing of the map's unit."""
    rng, check = np.random.default_rng(1), odometry()
    stopped = np.diag([0.0014, 0.0014, 0.0014, 2e-5, 2e-5, 2e-5]) ** 2
    answers = []
    for i in range(1, 60 + still + 60):
        if 60 <= i < 60 + still:
            creep = SE3.exp(np.concatenate([rng.normal(0.0, 3e-4, 3), rng.normal(0.0, 1e-5, 3)]))
            answers.append(check.update(estimate(i, creep, covariance=stopped), SE3.identity()))
        else:
            answers.append(check.update(estimate(i, rng=rng), STEP))
        if i == 59 + still:
            assert check.metres_per_unit == pytest.approx(4.0, rel=0.05)
            assert min(check.noise_scales().values()) >= 1.0
    assert Status.CONTRADICTED not in [answer.status for answer in answers]
    assert answers[-1].status is Status.CONSISTENT


def test_what_a_weak_picture_errs_by_in_rotation_is_no_lie():
    """Thirty frames of yaw that are off together by what the camera itself says that it may be off by."""
    rng, check = np.random.default_rng(2), odometry()
    weak = np.diag([0.01, 0.01, 0.02, 1e-3, 1e-3, 1e-3]) ** 2
    off = SE3.exp([0.0, 0.0, 0.0, 0.0, 1e-3, 0.0])
    answers = []
    for i in range(1, 90):
        T = STEP @ off if i >= 60 else STEP
        answers.append(check.update(estimate(i, T, rng=rng, covariance=weak), STEP).status)
    assert Status.CONTRADICTED not in answers


@pytest.mark.parametrize("lie_deg", [0.0, 1.0])
def test_a_wheel_odometry_claims_no_pitch(lie_deg):
    """A body that pitches on its springs while it drives, beside a claim that only ever turns about one axis."""
    rng, check, answers = np.random.default_rng(3), odometry(), []
    for i in range(1, 300):
        driving = not 90 <= i < 210  # creeping, it does not pitch, and noise would be forgotten
        pitch = rng.normal(0.0, 3e-3) if driving else 0.0
        yaw = rng.normal(0.0, 2e-3)
        seen = SE3.exp([0.0, 0.0, 0.8 if driving else 0.1, pitch, yaw, 0.0])
        claimed = SE3.exp(
            [0.0, 0.0, 0.8 if driving else 0.1, 0.0, yaw + np.radians(lie_deg) * (i >= 250), 0.0]
        )
        answers.append(check.update(estimate(i, seen), claimed).status)
    assert Status.CONTRADICTED not in answers[:249]
    assert (Status.CONTRADICTED in answers[249:260]) == (lie_deg > 0.0)


def test_a_pitch_that_is_not_claimed_is_no_gain_of_the_camera():
    """Learned as one, it was expected of the next curve, and honest odometry accused there."""
    rng, check = np.random.default_rng(5), odometry()
    for i in range(1, 260):
        yaw = rng.normal(0.0, 2e-4) + (0.02 if i >= 200 else 0.0)
        seen = SE3.exp([0.0, 0.0, 0.8, rng.normal(0.0, 6e-3), yaw, 0.0])
        answer = check.update(estimate(i, seen), SE3.exp([0.0, 0.0, 0.8, 0.0, yaw, 0.0]))
        assert answer.status is not Status.CONTRADICTED, i
    assert abs(check.test.errors.mean[6]) < 0.02  # of the visual rotation
