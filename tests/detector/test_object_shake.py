"""Objects under a camera that shakes: its rotation is known from the whole image."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from belie.detector import Config
from belie.detector.alerts import AlertBook
from belie.detector.objects import ObjectStage
from belie.detector.places import places_in
from belie.geometry import SE3, CameraModel
from belie.types import Detection, DetectionClaim, Frame, VisualEstimate

WIDTH, HEIGHT, FRAME_NS = 480, 320, 100_000_000
MODEL = CameraModel(width=WIDTH, height=HEIGHT, fx=400, fy=400, cx=239.5, cy=159.5)
BOX = np.array([210.0, 140.0, 254.0, 180.0])
SHAKE_PX = 14.0 * np.array([0.0, 1.0, -0.6, 0.8, -1.0, 0.3, -0.9])


def picture_at(k, rng):
    """A wall with something on it, seen by a camera that has yawed by so many pixels."""
    wall = np.random.default_rng(0).uniform(60.0, 180.0, (HEIGHT + 80, WIDTH + 80))
    wall = cv2.GaussianBlur(wall, (0, 0), 1.2)
    left, top, right, bottom = (BOX + 40).astype(int)
    thing = np.random.default_rng(1).uniform(40.0, 220.0, (bottom - top, right - left))
    wall[top:bottom, left:right] = cv2.GaussianBlur(thing, (0, 0), 1.2)
    shift = np.float64([[1, 0, shift_of(k) - 40], [0, 1, -40]])
    seen = cv2.warpAffine(wall, shift, (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR)
    return np.clip(np.round(seen + rng.normal(0.0, 1.5, seen.shape)), 0, 255).astype(np.uint8)


def shift_of(k):
    return float(SHAKE_PX[k % len(SHAKE_PX)])


def estimate_at(k):
    """A turn about the vertical axis shifts a point near the middle by f tan(angle)."""
    angle = np.arctan((shift_of(k) - shift_of(k - 1)) / MODEL.fx)
    T_cur_prev = SE3.exp([0.0, 0.0, 0.0, 0.0, angle, 0.0])
    return VisualEstimate(
        stamp_ns=k * FRAME_NS, previous_stamp_ns=(k - 1) * FRAME_NS, T_prev_cur=T_cur_prev.inverse(),
        covariance=1e-6 * np.eye(6), corners=100, matches=100, inliers=100, parallax_px=0.0, reason="no baseline yet",
    )  # fmt: skip


@pytest.mark.parametrize("knows_its_rotation", [True, False])
def test_what_hangs_on_a_wall_stays_there_under_a_shaking_camera(knows_its_rotation):
    config, rng = Config(), np.random.default_rng(2)
    stage, book = ObjectStage(MODEL, config.objects, config.tracking, 0.1), AlertBook()
    found = []
    for k in range(40):
        now = k * FRAME_NS
        box = BOX + shift_of(k) * np.array([1.0, 0.0, 1.0, 0.0]) + rng.normal(0.0, 1.0, 4)
        told = (Detection(label="car", score=0.9, track_id="7", box_px=box),) if k < 25 else ()
        claim = DetectionClaim(source="/detections", stamp_ns=now, received_ns=now, detections=told)
        stage.take((claim,), now)
        frame = Frame(camera="/image", stamp_ns=now, received_ns=now, image=picture_at(k, rng))
        judgements = stage.update(frame, estimate_at(k) if knows_its_rotation and k else None)
        found += [(k, a.type.value) for a in book.raise_new(judgements, now)]
    kinds = [kind for _, kind in found]
    assert kinds == (["obstacle_hiding"] if knows_its_rotation else [])


@pytest.mark.parametrize("late", [0, 2])
def test_what_hangs_on_a_wall_neither_moves_nor_leaves_its_box_however_late_it_is_told_of(late):
    config, rng = Config(), np.random.default_rng(2)
    stage, strays = ObjectStage(MODEL, config.objects, config.tracking, 0.1), []
    for k in range(20):
        now = k * FRAME_NS
        if k >= late:
            box = BOX + shift_of(k - late) * np.array([1.0, 0.0, 1.0, 0.0])
            told = (Detection(label="car", score=0.9, track_id="7", box_px=box),)
            stamp_ns = now - late * FRAME_NS
            stage.take(
                (DetectionClaim(source="/d", stamp_ns=stamp_ns, received_ns=now, detections=told),), now
            )
        frame = Frame(camera="/image", stamp_ns=now, received_ns=now, image=picture_at(k, rng))
        stage.update(frame, estimate_at(k) if k else None)
        if k > 10:
            (track,) = stage.streams["/d"].tracks
            strays.append(places_in(track.told_before[1], track.corners.px) - track.corners.born_places)
    assert np.abs(track.speed_px_s).max() < 15.0  # of 250 px/s that the camera shakes
    assert np.abs(np.concatenate(strays)).max() < 0.15  # of 0.6 that its image moves before it is told of


@pytest.mark.parametrize(
    ("distortion", "fx", "box"),
    [
        ((-0.01, 0.005, -0.003, 0.001), 250.0, [-280.0, 200, 60, 280]),  # middle beyond the image
        ((0.2, -0.1, 0.1, -0.1), 250.0, [0.0, 200, 40, 280]),  # beyond what the model tells
    ],
)
def test_what_a_fisheye_cannot_place_is_not_turned_far_away(distortion, fx, box):
    model = CameraModel(
        width=640, height=480, fx=fx, fy=fx, cx=319.5, cy=239.5, model="equidistant", distortion=distortion
    )
    config, rng = Config(), np.random.default_rng(2)
    stage = ObjectStage(model, config.objects, config.tracking, 0.1)
    told = (Detection(label="car", score=0.9, track_id="7", box_px=np.array([0.0, 200, 60, 280])),)
    stage.take((DetectionClaim(source="/d", stamp_ns=0, received_ns=0, detections=told),), 0)
    picture = rng.integers(40, 200, (480, 640)).astype(np.uint8)
    stage.update(Frame(camera="/image", stamp_ns=0, received_ns=0, image=picture))
    (track,) = stage.streams["/d"].tracks
    track.box_px = np.array(box)
    still = VisualEstimate(
        stamp_ns=FRAME_NS, previous_stamp_ns=0, T_prev_cur=SE3.identity(), covariance=1e-6 * np.eye(6),
        corners=100, matches=100, inliers=100, parallax_px=0.0,
    )  # fmt: skip
    stage.update(Frame(camera="/image", stamp_ns=FRAME_NS, received_ns=FRAME_NS, image=picture), still)
    (track,) = stage.streams["/d"].tracks
    assert np.abs(track.box_px - box).max() < 5.0
