"""Odometry attacks: what the pose says, and whether the twist agrees with it."""

from itertools import pairwise

import numpy as np
import pytest

from belie.attacks import attack
from belie.geometry import SE3, so3_log
from belie.types import AttackError, MotionClaim, PoseClaim, Step

START, STOP = 10, 20
SPAN = f"start={START},stop={STOP}"
NS = 1e9


@pytest.fixture
def poses(curve, claims_of):
    """True and claimed poses of an attack, by stamp, and the stamps of the span."""

    def collect(text, **options):
        source = curve(**options)
        true = {c.stamp_ns: c.T_odom_body for c in claims_of(source, PoseClaim)}
        lied = {c.stamp_ns: c.T_odom_body for c in claims_of(attack(source, text), PoseClaim)}
        stamps = source.frame_stamps_ns()
        inside = [s for s in true if stamps[START] <= s < stamps[STOP]]
        return true, lied, inside

    return collect


def shifts(true, lied, stamps):
    return np.array([lied[s].t - true[s].t for s in stamps])


def test_the_papers_attack_to_the_letter(curve, claims_of):
    source = curve(frames=120, odometry_ms=100)
    true = claims_of(source, PoseClaim)
    lied = claims_of(attack(source, "paper-odometry:axis=y"), PoseClaim)
    y = np.array([b.T_odom_body.t[1] - a.T_odom_body.t[1] for a, b in zip(true, lied, strict=True)])
    assert y[100:110] == pytest.approx(0.2 * np.arange(1, 11), abs=1e-9)
    assert not y[:100].any()
    assert not y[110:].any()


@pytest.mark.parametrize("axes", ["flu", "rdf"])
def test_the_papers_attack_is_lateral(poses, axes):
    true, lied, inside = poses(f"paper-odometry:start={START}", body_axes=axes, odometry_ms=100)
    left = {"flu": np.array([0.0, 1.0, 0.0]), "rdf": np.array([-1.0, 0.0, 0.0])}[axes]
    wanted = np.outer(0.2 * np.arange(1, 11), true[inside[0]].R @ left)
    assert shifts(true, lied, inside) == pytest.approx(wanted, abs=1e-9)


def test_between_frames_the_error_grows_without_a_jump(poses):
    true, lied, inside = poses(f"odometry-offset:axis=x,rate=0.2,{SPAN}")
    x = shifts(true, lied, inside)[:, 0]
    assert x == pytest.approx(0.04 * np.arange(1, len(x) + 1), abs=1e-6)


def test_constant_offset_and_ramp(poses):
    true, lied, inside = poses(f"odometry-offset:axis=z,magnitude=1.5,{SPAN}")
    assert shifts(true, lied, inside) == pytest.approx(np.tile([0, 0, 1.5], (len(inside), 1)))
    true, lied, inside = poses(f"odometry-ramp:axis=z,rate=0.5,{SPAN}")
    elapsed = (np.array(inside) - inside[0]) / NS + 0.02
    assert shifts(true, lied, inside)[:, 2] == pytest.approx(0.5 * elapsed, abs=1e-6)


@pytest.mark.parametrize(("axis", "flu"), [("roll", [1, 0, 0]), ("pitch", [0, 1, 0]), ("yaw", [0, 0, 1])])
@pytest.mark.parametrize("axes", ["flu", "rdf"])
def test_attitude_offset_turns_about_the_vehicles_axes(poses, axis, flu, axes):
    true, lied, inside = poses(f"odometry-offset:axis={axis},magnitude=5,{SPAN}", body_axes=axes)
    spin = np.array(flu) if axes == "flu" else np.array([-flu[1], -flu[2], flu[0]])
    for stamp in inside:
        turn = so3_log(true[stamp].R.T @ lied[stamp].R)
        assert turn == pytest.approx(np.radians(5) * spin, abs=1e-9)
        assert np.array_equal(true[stamp].t, lied[stamp].t)


def test_yaw_bias_bends_the_path(poses):
    true, lied, inside = poses(f"odometry-bias:rate=1,{SPAN}")
    last = inside[-1]
    turn = so3_log(true[last].R.T @ lied[last].R)
    assert np.linalg.norm(turn) == pytest.approx(np.radians(10), rel=1e-2)
    # Ten frames of 1 degree: 5 m to 6 m a second times the mean angle of 5 degrees, sideways.
    left = true[inside[0]].R @ np.array([0.0, 1.0, 0.0])
    assert float(shifts(true, lied, [last])[0] @ left) == pytest.approx(0.5, abs=0.1)


def test_scale_multiplies_the_motion_and_does_not_jump(poses, curve):
    true, lied, inside = poses(f"odometry-scale:factor=1.2,{SPAN}")
    anchor = max(s for s in true if s < inside[0])
    for stamp in inside:
        assert lied[stamp].t - true[anchor].t == pytest.approx(1.2 * (true[stamp].t - true[anchor].t))
        assert np.array_equal(lied[stamp].R, true[stamp].R)


def test_scaled_turn(poses):
    true, lied, inside = poses(f"odometry-scale:factor=0,axis=yaw,{SPAN}")
    before = max(s for s in true if s < inside[0])
    turn = so3_log(lied[before].R.T @ lied[inside[-1]].R)
    assert abs(turn[2]) < 0.01 < abs(so3_log(true[before].R.T @ true[inside[-1]].R)[2])


def test_set_holds_one_coordinate(poses):
    true, lied, inside = poses(f"odometry-set:axis=y,value=1,{SPAN}")
    for stamp in inside:
        assert lied[stamp].t == pytest.approx([true[stamp].t[0], 1.0, true[stamp].t[2]])


@pytest.mark.parametrize("axes", ["flu", "rdf"])
def test_set_yaw_points_the_vehicle_one_way(poses, axes):
    _, lied, inside = poses(f"odometry-set:axis=yaw,value=30,{SPAN}", body_axes=axes)
    # Forward and left of the world: its own axes, named as the body's.
    forward, left = {"flu": ([1, 0, 0], [0, 1, 0]), "rdf": ([0, 0, 1], [-1, 0, 0])}[axes]
    for stamp in inside:
        nose = lied[stamp].R @ np.array(forward)
        assert np.degrees(np.arctan2(nose @ left, nose @ forward)) == pytest.approx(30.0)


def test_flip_reverses_one_direction(poses):
    true, lied, inside = poses(f"odometry-flip:axis=x,{SPAN}")
    anchor = max(s for s in true if s < inside[0])
    moved = np.array([true[s].t - true[anchor].t for s in inside])
    assert np.array([lied[s].t - true[anchor].t for s in inside]) == pytest.approx(moved * [-1, 1, 1])


def test_freeze_repeats_the_last_honest_pose(poses, curve, claims_of):
    true, lied, inside = poses(f"odometry-freeze:{SPAN}")
    last_honest = true[max(s for s in true if s < inside[0])]
    assert all(lied[s].is_close(last_honest, 0.0) for s in inside)
    twists = claims_of(attack(curve(), f"odometry-freeze:{SPAN}"), MotionClaim, "/odom")
    stopped = [c for c in twists if c.stamp_ns in set(inside)]
    assert len(stopped) == len(inside)
    assert not any(c.linear_m_s.any() or c.angular_rad_s.any() for c in stopped)


@pytest.mark.parametrize("lag", ["4", "0.4s"])
def test_replay_goes_back_and_delay_stalls(poses, lag):
    true, lied, inside = poses(f"odometry-replay:delay={lag},{SPAN}")
    assert all(lied[s].is_close(true[s - 400_000_000], 0.0) for s in inside)
    true, lied, inside = poses(f"odometry-delay:delay={lag},{SPAN}")
    last_honest = max(s for s in true if s < inside[0])
    assert all(lied[s].is_close(true[max(last_honest, s - 400_000_000)], 0.0) for s in inside)


def test_noise_has_its_sigma_on_all_axes(poses):
    true, lied, inside = poses(f"odometry-noise:sigma=0.1,{SPAN}")
    noise = shifts(true, lied, inside)
    assert noise.std(axis=0) == pytest.approx([0.1] * 3, rel=0.4)
    assert abs(np.corrcoef(noise.T)[0, 1]) < 0.4


def test_sinusoid_swings(poses):
    true, lied, inside = poses(f"odometry-sinusoid:axis=x,amplitude=2,period=1,{SPAN}")
    x = shifts(true, lied, inside)[:, 0]
    assert (x.max(), x.min()) == pytest.approx((2.0, -2.0), abs=0.02)


@pytest.mark.parametrize("axes", ["flu", "rdf"])
@pytest.mark.parametrize(
    "text",
    [
        "odometry-offset:rate=0.2",
        "odometry-offset:magnitude=2,axis=x",
        "odometry-offset:magnitude=20,axis=pitch",
        "odometry-offset:rate=2,axis=yaw",
        "odometry-ramp:rate=1,axis=forward",
        "odometry-ramp:rate=20,axis=roll",
        "odometry-bias:rate=2",
        "odometry-bias:rate=1,axis=roll",
        "odometry-bias:rate=0.1,axis=up",
        "odometry-scale:factor=1.7",
        "odometry-scale:factor=1.7,axis=left",
        "odometry-scale:factor=-0.5,axis=yaw",
        "odometry-set:value=1",
        "odometry-set:value=40,axis=yaw",
        "odometry-set:value=-20,axis=roll",
        "odometry-set:value=10,axis=pitch",
        "odometry-flip:axis=forward",
        "odometry-flip:axis=yaw",
        "odometry-freeze",
        "odometry-replay:delay=5",
        "odometry-sinusoid:amplitude=1,period=2",
        "odometry-sinusoid:amplitude=10,period=2,axis=yaw",
    ],
)
def test_twist_is_the_derivative_of_the_pose(curve, claims_of, text, axes):
    source = curve(body_axes=axes)
    attacked = attack(source, f"{text}{',' if ':' in text else ':'}{SPAN}")
    stamps = source.frame_stamps_ns()
    lied = [c for c in claims_of(attacked, PoseClaim) if stamps[START] <= c.stamp_ns < stamps[STOP]]
    twists = {c.stamp_ns: c for c in claims_of(attacked, MotionClaim, "/odom")}
    true = {c.stamp_ns: c for c in claims_of(source, MotionClaim, "/odom")}
    assert len(lied) == 50
    for a, b in pairwise(lied):
        moved = (a.T_odom_body.inverse() @ b.T_odom_body).log() / ((b.stamp_ns - a.stamp_ns) / NS)
        claimed = np.mean(
            [[*twists[c.stamp_ns].linear_m_s, *twists[c.stamp_ns].angular_rad_s] for c in (a, b)], axis=0
        )
        assert claimed == pytest.approx(moved, abs=5e-3)
    # The test has teeth: the true twist would not do, except where only the onset jumps.
    if "magnitude=2," not in text:
        honest = true[lied[-1].stamp_ns]
        sent = twists[lied[-1].stamp_ns]
        change = np.abs(sent.linear_m_s - honest.linear_m_s).max()
        assert max(change, np.abs(sent.angular_rad_s - honest.angular_rad_s).max()) > 0.01


def test_noisy_poses_have_noisy_twists(curve, claims_of):
    attacked = attack(curve(), f"odometry-noise:sigma=0.05,axis=x,{SPAN}")
    stamps = curve().frame_stamps_ns()
    lied = [c for c in claims_of(attacked, PoseClaim) if stamps[START] <= c.stamp_ns < stamps[STOP]]
    twists = {c.stamp_ns: c for c in claims_of(attacked, MotionClaim, "/odom")}
    for a, b in pairwise(lied):
        moved = (b.T_odom_body.t - a.T_odom_body.t) / ((b.stamp_ns - a.stamp_ns) / NS)
        claimed = b.T_odom_body.R @ twists[b.stamp_ns].linear_m_s
        assert claimed == pytest.approx(moved, abs=0.1)


def test_covariance_is_left_alone(curve, claims_of):
    for claim in claims_of(attack(curve(), f"odometry-scale:factor=2,{SPAN}"), PoseClaim):
        assert np.array_equal(claim.covariance, np.eye(6) * 0.01)


@pytest.mark.parametrize(
    "text", ["odometry-offset:rate=0.2", "odometry-bias:rate=1", "odometry-freeze:seed=1"]
)
def test_without_restoring_the_error_stays_and_increments_are_honest(poses, text):
    true, lied, inside = poses(f"{text},restore=false,{SPAN}")
    after = [s for s in true if s > inside[-1]]
    error = lied[inside[-1]] @ true[inside[-1]].inverse()
    assert not error.is_close(SE3.identity(), 0.05)
    for a, b in zip([inside[-1], *after], after, strict=False):
        assert (lied[a].inverse() @ lied[b]).is_close(true[a].inverse() @ true[b], 1e-9)


def test_from_the_first_message_on(poses, curve, claims_of):
    source = curve(odometry_ms=100)
    lied = claims_of(attack(source, "odometry-offset:axis=x,rate=0.5,start=0"), PoseClaim)
    true = claims_of(source, PoseClaim)
    first = [b.T_odom_body.t[0] - a.T_odom_body.t[0] for a, b in zip(true, lied, strict=True)][:3]
    assert first == pytest.approx([0.5, 1.0, 1.5])


class TwistsOnly:
    """A recording whose odometry lost its poses."""

    def __init__(self, source):
        self.cameras, self.body_axes = source.cameras, source.body_axes
        self.frame_stamps_ns, self._source = source.frame_stamps_ns, source

    def steps(self):
        for step in self._source.steps():
            kept = tuple(claim for claim in step.claims if isinstance(claim, MotionClaim))
            yield Step(frame=step.frame, claims=kept)


def test_twists_without_poses_are_refused(curve):
    with pytest.raises(AttackError, match="/odom sends twists but no poses"):
        list(attack(TwistsOnly(curve()), f"odometry-offset:rate=1,{SPAN}").steps())
