"""A camera over flat ground: two motions explain any two images, and no third thing stands out to tell."""

import numpy as np
import pytest

from belie.geometry import SE3, so3_log
from belie.odometry import VisualOdometry
from belie.types import Frame

from . import scenes
from .scenes import CAMERA, render, texture


@pytest.fixture
def flat_ground(monkeypatch):
    monkeypatch.setattr(scenes, "_PLANES", [((-40.0, 5.0, -40.0), (80.0, 0.0, 0.0), (0.0, 0.0, 80.0))])
    monkeypatch.setattr(scenes, "_TEXTURES", [texture(7, 3000)])


# The camera looks 45 to 68 degrees down; sideways flight and a descent, in the axes of the world (y down).
@pytest.mark.parametrize(
    ("pitch_deg", "step_m", "turn_deg"),
    [
        (-68.0, (0.02, 0.05, 0.2), (0.1, 0.3, 0.0)),
        (-45.0, (0.15, 0.08, -0.08), (0.4, 0.0, 0.3)),
        (-60.0, (-0.1, -0.1, 0.1), (0.0, 0.5, -0.2)),
        (-50.0, (0.0, 0.15, 0.1), (0.6, 0.1, 0.1)),
    ],
)
def test_over_flat_ground_no_motion_is_told_before_it_is_known_and_then_the_true_one(
    flat_ground, pitch_deg, step_m, turn_deg
):
    poses = [SE3.exp([0.0, 0.0, 0.0, np.radians(pitch_deg), 0.0, 0.0])]
    for _ in range(17):
        poses.append(poses[-1] @ SE3.exp([*(poses[-1].R.T @ step_m), *np.radians(turn_deg)]))
    odometry = VisualOdometry(CAMERA)
    told = 0
    for i, pose in enumerate(poses):
        estimate = odometry.update(Frame(camera="/c", stamp_ns=i * 10**8, received_ns=0, image=render(pose)))
        if i == 0:
            continue
        truth = poses[i - 1].inverse() @ pose
        # The rotation is given whatever is known: it may be off by what it says.
        wrong = so3_log(estimate.T_prev_cur.R.T @ truth.R)
        assert wrong @ np.linalg.solve(estimate.covariance[3:, 3:], wrong) < 25.0
        if estimate.reason is None:
            told += 1
            t = estimate.T_prev_cur.t / np.linalg.norm(estimate.T_prev_cur.t)
            assert t @ truth.t > 0.98 * np.linalg.norm(truth.t)
    assert told >= 8
