import numpy as np
import pytest

from belie.geometry import SE3
from belie.simulation.motion import Drive, Parked, Path, Ramp, SpeedProfile, Unrest, walk
from belie.simulation.scenes import corridor, flight, patch, street

_BEND = Path(np.array([[10.0 * k, 0.03 * (10.0 * k) ** 1.5, 0.0] for k in range(12)]))
_STOP = SpeedProfile(start_m_s=9.0, ramps=(Ramp(start_s=1.0, duration_s=3.0, change_m_s=-9.0),))


def test_way_is_the_integral_of_speed():
    t = np.linspace(0.0, 6.0, 6001)
    speed = np.array([_STOP.speed_m_s(s) for s in t])
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    assert np.allclose(way, [_STOP.travelled_m(s) for s in t], atol=1e-5)


def test_speed_of_a_drive_is_that_of_its_profile():
    drive = Drive(path=_BEND, speed=_STOP)
    for t in (0.5, 2.0, 2.7):
        assert np.linalg.norm(drive.twist(t)[0]) == pytest.approx(_STOP.speed_m_s(t), abs=2e-3)


def test_path_is_by_arc_length():
    ways = np.linspace(0.0, _BEND.length_m, 200)
    steps = np.linalg.norm(np.diff([_BEND.at(w) for w in ways], axis=0), axis=1)
    assert np.allclose(steps, ways[1] - ways[0], rtol=5e-3)


def test_path_refuses_too_few_points():
    with pytest.raises(ValueError, match="six points"):
        Path(np.zeros((3, 3)))


@pytest.mark.slow
@pytest.mark.parametrize("scene", [street, corridor, flight, patch])
def test_ego_is_smooth_enough_for_an_imu(scene):
    """Twist integrates to the pose, and acceleration does not jump."""
    for manoeuvre in scene.MANOEUVRES if scene is not street else ("highway",):
        ego = scene.build(seed=3, manoeuvre=manoeuvre, duration_s=1.0).ego
        times = np.arange(0.0, 1.2, 0.005)
        linear, angular = (np.array(v) for v in zip(*(ego.twist(t) for t in times), strict=True))
        assert np.abs(np.diff(linear, 2, axis=0)).max() < 0.01
        assert np.abs(np.diff(angular, 2, axis=0)).max() < 0.01
        T = ego.T_world_body(0.0)
        for t in times[:-1]:
            v, w = ego.twist(t + 0.0025)
            T = T @ SE3.exp(np.concatenate([v, w]) * 0.005)
        assert T.is_close(ego.T_world_body(times[-1]), 1e-3)


def test_unrest_rests_at_standstill():
    parked = Parked(T=SE3.from_translation([1.0, 2.0, 3.0]))
    assert Unrest(parked, seed=1).T_world_body(0.7).is_close(parked.T)


def test_a_walker_reaches_its_corners():
    motion = walk([(0.0, 0.0), (6.0, 0.0), (6.0, 6.0)], speed_m_s=1.0)
    assert np.allclose(motion.T_world_body(0.0).t, 0.0, atol=1e-6)
    assert np.linalg.norm(motion.T_world_body(12.0).t - [6.0, 6.0, 0.0]) < 0.8
