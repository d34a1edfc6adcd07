"""A vehicle that drives on its claims: what a lie does to it, and what an alert saves."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from belie.evaluation.closed_loop import ClosedLoop
from belie.geometry import SE3
from belie.simulation.driven import off_lane_m
from belie.simulation.driver import ClaimedState, Driver, DriverSettings
from belie.simulation.scenario import load_scenario
from belie.simulation.simulate import SimulatedRecording
from belie.simulation.vehicle import Vehicle, VehicleSettings
from belie.types import Detection, DetectionClaim, PoseClaim, PositionClaim

PULL = "odometry-offset:axis=left,rate=0.2,start=40"
SENSORS = load_scenario("closed-loop").sensors.model_dump()


def loop(made, specs, *, guarded, world=None, seconds=8.0, **changes):
    scenario = made.scenario(duration_s=seconds, sensors=SENSORS, **changes)
    simulated = SimulatedRecording(scenario, world=world or made.world, stage_opener=made.open_stage)
    return ClosedLoop(scenario, specs, guarded=guarded, simulated=simulated)


@pytest.mark.slow
def test_without_a_lie_it_keeps_its_lane_and_belie_is_silent(made):
    outcome = loop(made, [], guarded=True).run()
    assert outcome.safe
    assert outcome.alert is None
    assert outcome.most_off_lane_m < 0.5
    assert outcome.driven_s == pytest.approx(7.9)


@pytest.mark.slow
def test_a_lie_steers_it_off_and_an_alert_saves_it(made):
    without = loop(made, [PULL], guarded=False)
    steps = list(without.steps())
    lost = without.outcome()
    assert not lost.safe
    assert lost.collision_s > 4.0
    assert len(steps) < 80
    assert "without belie: " in lost.in_words()
    saved = loop(made, [PULL], guarded=True).run()
    assert saved.safe
    assert saved.alert == "odometry_spoofing of /odom"
    assert 4.0 < saved.alert_s < lost.collision_s
    assert saved.stopped_s is not None
    assert saved.to_json()["safe"] is True


@pytest.mark.slow
def test_it_hits_what_stands_in_its_way_and_stops_for_what_it_sees(made):
    blind = {**SENSORS, "object_detector": {"rate_hz": 0}}
    world = made.make_world(made.make_actor(9, 45.0, 0.0))
    scenario = made.scenario(duration_s=8.0, sensors=blind)
    simulated = SimulatedRecording(scenario, world=world, stage_opener=made.open_stage)
    outcome = ClosedLoop(scenario, [], guarded=False, simulated=simulated).run()
    assert outcome.collision == "hit car 9"
    assert outcome.collision_s == pytest.approx((45.0 - 2.1 - 3.6) / 8.0, abs=0.1)
    assert loop(made, [], guarded=False, world=world).run().safe


def test_labels_of_a_drive_need_no_second_one(made):
    from belie.attacks import attack

    drive = loop(made, [PULL], guarded=False)
    for _ in drive.steps():
        pass
    (label,) = attack(drive.replayed(), [PULL]).labels
    assert label.start_frame == 40
    assert len(made.opened) == 1


# -- its parts -------------------------------------------------------------------------------------------


def test_the_vehicle_turns_on_the_circle_that_its_steering_asks_for():
    vehicle = Vehicle(VehicleSettings(), SE3.identity(), speed_m_s=5.0)
    for k in range(1, 200):
        vehicle.drive(0.1 * k, steer_rad=math.radians(10), acceleration_m_s2=0.0)
    linear, angular = vehicle.twist(15.0)
    radius = 2.7 / math.tan(math.radians(10))
    assert angular[2] == pytest.approx(5.0 / radius, rel=1e-6)
    points = np.array([vehicle.T_world_body(t).t[:2] for t in np.linspace(5, 15, 50)])
    a, b = points - points.mean(axis=0), (points**2).sum(axis=1)
    middle, *_ = np.linalg.lstsq(2 * a, b - b.mean(), rcond=None)
    assert np.linalg.norm(points - middle, axis=1).std() < 0.02
    step = vehicle.T_world_body(10.0).inverse() @ vehicle.T_world_body(10.001)
    np.testing.assert_allclose(step.t / 0.001, linear, atol=0.02)
    with pytest.raises(ValueError, match="has been driven to"):
        vehicle.T_world_body(30.0)


def test_the_vehicle_brakes_to_a_standstill_and_no_further():
    vehicle = Vehicle(VehicleSettings(), SE3.identity(), speed_m_s=7.0)
    vehicle.drive(3.0, steer_rad=0.0, acceleration_m_s2=-100.0)
    assert vehicle.speed_m_s == 0.0
    assert vehicle.T_world_body(3.0).t[0] == pytest.approx(3.5, abs=0.05)


def odometry(t, x, y=0.0):
    return PoseClaim(
        source="/odom",
        frame_id="odom",
        stamp_ns=round(t * 1e9),
        received_ns=round(t * 1e9),
        T_odom_body=SE3.from_translation([x, y, 0.0]),
    )


def position(t, x, y):
    return PositionClaim(
        source="/loc",
        frame_id="map",
        kind="localisation",
        stamp_ns=round(t * 1e9),
        received_ns=round(t * 1e9),
        position_m=[x, y, 0.0],
    )


def test_positions_correct_what_the_odometry_gets_wrong():
    state = ClaimedState(SE3.from_translation([0.0, 1.0, 0.0]), speed_m_s=10.0, correction_s=2.0)
    for k in range(300):
        t = 0.05 * k
        state.take([odometry(t, 10.0 * t), position(t, 10.0 * t, 0.0)])
    assert abs(state.T_world_body.t[1]) < 0.05
    assert abs(math.degrees(state.T_world_body.log()[5])) < 0.1
    assert state.speed_m_s == pytest.approx(10.0, abs=0.01)


def test_a_distrusted_odometry_is_taken_back_and_not_heard_again():
    state = ClaimedState(SE3.identity(), speed_m_s=10.0, correction_s=2.0)
    for k in range(20):
        lie = 0.0 if k < 15 else 0.2 * (k - 14)
        state.take([odometry(0.05 * k, 0.5 * k, lie)])
    assert state.T_world_body.t[1] == pytest.approx(1.0)
    state.distrust("/odom", round(0.74 * 1e9))
    assert state.T_world_body.t[1] == 0.0
    state.take([odometry(1.0, 10.0, 5.0)])
    assert state.T_world_body.t[1] == 0.0


def test_the_driver_stops_behind_a_standing_car():
    lane = np.column_stack([np.linspace(0.0, 300.0, 301), np.zeros(301), np.zeros(301)])
    driver = Driver(DriverSettings(), lane, target_m_s=10.0, wheelbase_m=2.7, T_body_cam=SE3.identity())
    vehicle = Vehicle(VehicleSettings(), SE3.identity(), speed_m_s=10.0)
    for k in range(1, 300):
        seen = Detection(
            label="car", score=1, position_m=[100.0 - vehicle.T_world_body(vehicle.now_s).t[0], 0, 0]
        )
        driver.see(
            [DetectionClaim(source="/d", stamp_ns=k * 10**8, received_ns=k * 10**8, detections=(seen,))]
        )
        steer, acceleration = driver.command(vehicle.T_world_body(vehicle.now_s), speed_m_s=vehicle.speed_m_s)
        vehicle.drive(0.1 * k, steer_rad=steer, acceleration_m_s2=acceleration)
    assert vehicle.speed_m_s < 0.3
    assert 88.0 < vehicle.T_world_body(vehicle.now_s).t[0] + 3.6 < 97.9


def test_distance_from_a_lane_that_bends():
    angle = np.linspace(0, np.pi / 2, 200)
    lane = np.column_stack([50 * np.sin(angle), 50 - 50 * np.cos(angle), 0 * angle])
    assert off_lane_m(lane, np.array([0.0, 3.0])) == pytest.approx(3.0, abs=0.02)
    assert off_lane_m(lane, np.array([0.0, 50.0])) == pytest.approx(50.0, abs=0.02)


def test_a_world_without_actors_is_fine(made):
    world = SimpleNamespace(**{**vars(made.world), "actors": ()})
    assert loop(made, [], guarded=False, world=world, seconds=1.0).run().safe
