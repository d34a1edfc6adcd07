"""Position attacks: the claim's own coordinates, and the vehicle's directions."""

import numpy as np
import pytest

from belie.attacks import attack
from belie.geometry import SE3
from belie.types import AttackError, PoseClaim, PositionClaim, Step

SPAN = "start=10,stop=20"


@pytest.fixture
def positions(curve, claims_of):
    """True positions before the span, then true and claimed ones within it."""

    def collect(text, **options):
        source = curve(**options)
        stamps = source.frame_stamps_ns()
        true = claims_of(source, PositionClaim)
        lied = claims_of(attack(source, text), PositionClaim)
        inside = [i for i, claim in enumerate(true) if stamps[10] <= claim.stamp_ns < stamps[20]]
        assert inside == list(range(10, 20))
        return (
            np.array([c.position_m for c in true[:10]]),
            np.array([true[i].position_m for i in inside]),
            np.array([lied[i].position_m for i in inside]),
        )

    return collect


def test_the_papers_attack_sets_x_to_one(positions):
    _, true, lied = positions("paper-position:start=10")
    assert lied == pytest.approx(np.column_stack([np.ones(10), true[:, 1:]]))


def test_jump(positions):
    _, true, lied = positions(f"position-offset:magnitude=2,{SPAN}")
    assert lied - true == pytest.approx(np.tile([2.0, 0, 0], (10, 1)))


@pytest.mark.parametrize("axes", ["flu", "rdf"])
def test_drag_off_to_the_left_of_the_odometrys_heading(positions, curve, axes):
    text = f"position-ramp:rate=0.5,axis=left,{SPAN}"
    _, true, lied = positions(text, position_frame="odom", body_axes=axes)
    R = curve(body_axes=axes).pose(1_033_000_000)[0].R
    left = R @ np.array({"flu": [0, 1, 0], "rdf": [-1, 0, 0]}[axes])
    away = lied - true
    assert np.linalg.norm(away, axis=1) == pytest.approx(0.05 * np.arange(1, 11), abs=1e-6)
    assert away[-1] @ left / np.linalg.norm(away[-1]) == pytest.approx(1.0, abs=1e-3)


def test_drag_off_to_the_left_of_the_course(positions):
    before, true, lied = positions(f"position-ramp:rate=0.5,axis=left,{SPAN}")
    course = true[0] - before[0]
    away = lied[-1] - true[-1]
    assert np.linalg.norm(away) == pytest.approx(0.5, abs=1e-6)
    assert away[2] == 0.0
    assert away[:2] @ course[:2] == pytest.approx(0.0, abs=1e-6)
    assert course[0] * away[1] - course[1] * away[0] > 0.0


def test_course_needs_motion_but_coordinates_do_not(curve, claims_of):
    class Standing:
        def __init__(self):
            source = curve()
            self.cameras, self.body_axes, self.frame_stamps_ns = source.cameras, "flu", source.frame_stamps_ns

        def steps(self):
            for step in curve().steps():
                stamp = step.frame.stamp_ns
                here = PositionClaim(
                    source="/gps",
                    frame_id="enu",
                    kind="gnss",
                    stamp_ns=stamp,
                    received_ns=stamp,
                    position_m=np.zeros(3),
                )
                yield Step(frame=step.frame, claims=(here,))

    with pytest.raises(AttackError, match=r"/gps moved 0\.0 m before the onset.*use axis=x, y or z"):
        list(attack(Standing(), f"position-ramp:rate=0.5,axis=left,{SPAN}").steps())
    for axis, direction in (("up", [0, 0, 1]), ("y", [0, 1, 0])):
        lied = claims_of(attack(Standing(), f"position-offset:magnitude=3,axis={axis},{SPAN}"), PositionClaim)
        assert lied[12].position_m == pytest.approx(3.0 * np.array(direction))


def test_scale_flip_freeze(positions):
    before, true, lied = positions(f"position-scale:factor=1.2,{SPAN}")
    assert lied - before[-1] == pytest.approx(1.2 * (true - before[-1]))
    before, true, lied = positions(f"position-flip:axis=y,{SPAN}")
    assert lied - before[-1] == pytest.approx((true - before[-1]) * [1, -1, 1])
    before, true, lied = positions(f"position-freeze:{SPAN}")
    assert np.array_equal(lied, np.tile(before[-1], (10, 1)))


def test_replay_delay_noise_sinusoid_bias(positions):
    before, true, lied = positions(f"position-replay:delay=5,{SPAN}")
    assert np.array_equal(lied, np.concatenate([before[5:], true[:5]]))
    before, true, lied = positions(f"position-delay:delay=0.5s,{SPAN}")
    assert np.array_equal(lied, np.concatenate([np.tile(before[-1], (4, 1)), before[-1:], true[:5]]))
    _, true, lied = positions(f"position-noise:sigma=3,seed=4,{SPAN}")
    assert 1.5 < (lied - true).std() < 4.5
    _, true, lied = positions(f"position-sinusoid:amplitude=3,period=0.4,axis=z,{SPAN}")
    assert (lied - true)[:, 2] == pytest.approx(3.0 * np.tile([1, 0, -1, 0], 3)[:10], abs=1e-5)
    _, true, lied = positions(f"position-bias:rate=0.3,axis=y,{SPAN}")
    assert (lied - true)[:, 1] == pytest.approx(0.3 * np.arange(1, 11), abs=1e-6)


def test_heading_may_itself_be_forged(curve, claims_of):
    """Composition order: the position attack sees the odometry as the first attack left it."""
    source = curve(position_frame="odom")
    specs = [
        "odometry-offset:axis=yaw,magnitude=90,start=9,stop=21",
        f"position-offset:magnitude=1,axis=forward,{SPAN}",
    ]
    turned = claims_of(attack(source, specs), PositionClaim)[12].position_m
    plain = claims_of(attack(source, specs[::-1]), PositionClaim)[12].position_m
    true = claims_of(source, PositionClaim)[12].position_m
    assert (turned - true) @ (plain - true) == pytest.approx(0.0, abs=1e-9)
    assert isinstance(claims_of(source, PoseClaim)[0].T_odom_body, SE3)
