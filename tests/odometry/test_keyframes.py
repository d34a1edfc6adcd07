"""Keyframe choice: by motion of the view, never while standing."""

import numpy as np

from belie.odometry.keyframes import KeyframeSettings, keyframe_reason

SETTINGS = KeyframeSettings()
FOCAL_PX = 700.0


def reason(motion_px, tracked=800, before=1000):
    return keyframe_reason(np.full(tracked, float(motion_px)), before, FOCAL_PX, SETTINGS)


def test_first_frame_is_kept():
    assert keyframe_reason(np.empty(0), 0, FOCAL_PX, SETTINGS) == "first keyframe"


def test_motion_makes_a_keyframe():
    threshold_px = SETTINGS.min_motion_rad * FOCAL_PX
    assert reason(1.05 * threshold_px) is not None
    assert reason(0.95 * threshold_px) is None


def test_standing_keeps_the_map_even_when_corners_flicker():
    assert reason(0.5, tracked=200) is None


def test_lost_corners_make_a_keyframe():
    assert "% of the last keyframe" in reason(5.0, tracked=200)
    assert reason(5.0, tracked=2) == "the last keyframe is out of sight"
    assert reason(0.0, tracked=0) == "the last keyframe is out of sight"
