"""What the still scene tells of boxes: what passes through them, and what only seems to."""

from __future__ import annotations

import numpy as np
import pytest

from belie.checks.objects import ErrorTest, Habit
from belie.detector.edge_noise import EdgeNoise
from belie.detector.object_track import ObjectTrack
from belie.detector.places import places_in
from belie.detector.scene_witness import SceneWitness
from belie.geometry import SE3, CameraModel
from belie.types import VisualEstimate

CAMERA = CameraModel(width=1240, height=376, fx=700, fy=700, cx=619.5, cy=185.0)
HEIGHT = 1.65  # of the camera, map units
STEP = SE3.from_translation([0.0, 0.0, 1.0])  # ahead, a message
# On a wall 16 ahead that reaches above the horizon, and lower on the same wall.
HIGH, LOW = np.array([150.0, 40.0, 240.0, 110.0]), np.array([150.0, 185.0, 240.0, 255.0])


def scene_of(points):
    """Corners of a scene as the camera's motion tells them: undistorted places, 1/Z, deviations."""
    ahead = points[:, 2] > 1.0
    x, y, z = points[ahead].T
    return np.column_stack([x / z, y / z]), 1.0 / z, 0.01 / z


def still_scene(wall_z=16.0, wall=True):
    rng = np.random.default_rng(4)
    ground = np.column_stack([rng.uniform(-6, 6, 300), np.full(300, HEIGHT), rng.uniform(4, 25, 300)])
    front = np.column_stack(
        [rng.uniform(-14, 14, 1500), rng.uniform(-5, HEIGHT, 1500), np.full(1500, wall_z)]
    )
    return np.concatenate([ground, front]) if wall else ground


def moved(points, frames):
    return points - [0.0, 0.0, float(frames)]


def estimate():
    return VisualEstimate(
        stamp_ns=1, previous_stamp_ns=0, T_prev_cur=STEP, covariance=np.eye(6), corners=100, matches=100, inliers=90,
        parallax_px=5.0,
    )  # fmt: skip


def track_of(told):
    habit = Habit(rate=0.03, persistence_s=0.02, prior_messages=40, prior_gaps=10)
    track = ObjectTrack(
        name="7", track_id="7", label="car", box_px=told, hiding=ErrorTest(habit), naming=ErrorTest(habit)
    )
    track.told_px = track.carried_px = told
    return track


def with_corners(witness, track, points, *, born, box_then, told):
    """Give it corners on points of a still scene that were found a while ago, in a box that was told then."""
    then_px, now_px = (CAMERA.project(moved(points, k)) for k in (born, witness.frame))
    track.corners.born_px, track.corners.px = then_px, now_px
    track.corners.births, track.corners.ages = np.full(len(points), born), np.full(len(points), 3)
    track.corners.born_places, track.corners.places = places_in(box_then, then_px), places_in(told, now_px)
    track.history.extend((k, box_then) for k in range(3))


def watched(points, frames=5, shown=None):
    """A witness that has driven ahead; `shown`: points whose depths it keeps (all)."""
    witness = SceneWitness(CAMERA)
    for k in range(1, frames + 1):
        witness.move(estimate(), scene_of(moved(points if shown is None else shown, k)))
    return witness


def on_wall(box, wall_z, frames, n=6):
    """Points of a wall that lie in a box's middle after some frames."""
    rng = np.random.default_rng(2)
    low, high = box[:2] + 0.3 * (box[2:] - box[:2]), box[2:] - 0.3 * (box[2:] - box[:2])
    px = rng.uniform(low, high, (n, 2))
    z = wall_z - frames
    return moved(np.column_stack([CAMERA.normalize(px) * z, np.full(n, z)]), -frames)


def passing(witness, track):
    return witness.evidence(track)[0]


def test_what_was_in_the_middle_and_has_left_the_box_passed_through_it():
    scene = still_scene()
    witness = watched(scene, shown=still_scene(wall=False))
    track = track_of(HIGH)
    with_corners(witness, track, on_wall(HIGH, 14.0, 3), born=3, box_then=HIGH, told=HIGH)
    assert (places_in(HIGH, track.corners.px)[:, 0] < 0.2).all()  # now none is in the middle
    assert passing(witness, track) > 5.0


def test_corners_too_young_to_have_strayed_take_nothing_back():
    witness = watched(still_scene(), shown=still_scene(wall=False))
    track = track_of(HIGH)
    old, young = on_wall(HIGH, 30.0, 1, 4), on_wall(HIGH, 30.0, 5, 4)
    with_corners(witness, track, old, born=1, box_then=HIGH, told=HIGH)
    alone = passing(witness, track)
    then_px, now_px = (CAMERA.project(moved(young, k)) for k in (4, 5))
    track.corners.born_px, track.corners.px = (
        np.concatenate(p) for p in ((track.corners.born_px, then_px), (track.corners.px, now_px))
    )
    track.corners.births, track.corners.ages = np.append(track.corners.births, [4] * 4), np.full(8, 3)
    track.corners.born_places = np.concatenate([track.corners.born_places, places_in(HIGH, then_px)])
    strayed = np.abs(places_in(HIGH, track.corners.px) - track.corners.born_places).max(axis=1)
    assert strayed[:4].min() > 0.2 > strayed[4:].max()
    assert passing(witness, track) == alone > 5.0


def test_corners_that_go_where_the_box_goes_take_back_what_passed():
    """A box that jumped to something else, and is back."""
    witness = watched(still_scene(), shown=still_scene(wall=False))
    car = on_wall(LOW, 14.0, 5)
    then = LOW - np.array([120.0, 0.0, 120.0, 0.0])
    track = track_of(LOW)
    track.phantom.add(6.0, None, 15.0, 0)
    with_corners(witness, track, car, born=3, box_then=then, told=LOW)
    track.corners.born_places = track.corners.places
    track.corners.born_px = track.corners.px - 120.0
    assert passing(witness, track) is None  # that it rides does not say that it stands there
    assert track.phantom.statistic == 0.0


def test_an_edge_at_the_image_border_is_no_place_to_hold_corners_against():
    """A car leaves to the left: its box shrinks, what is seen of it shifts within."""
    witness = watched(still_scene(), shown=still_scene(wall=False))
    told, then = np.array([2.0, 40.0, 60.0, 110.0]), np.array([2.0, 40.0, 75.0, 110.0])
    track = track_of(told)
    with_corners(witness, track, on_wall(told, 22.0, 5, 6), born=4, box_then=then, told=told)
    strayed = np.abs(places_in(told, track.corners.px) - track.corners.born_places)
    assert (strayed[:, 0] > 0.2).all()
    assert passing(witness, track) is None


@pytest.mark.parametrize(
    ("jitter", "own", "passes"), [(0.03, True, True), (0.1, True, False), (0.1, False, True)]
)
def test_a_detector_whose_boxes_swing_is_not_held_to_one_whose_boxes_do_not(jitter, own, passes):
    """Nor does it shield another detector's: each stream learns its own."""
    witness, edges = watched(still_scene(), shown=still_scene(wall=False)), EdgeNoise()
    rng = np.random.default_rng(6)
    honest = track_of(HIGH)
    honest.motion, honest.edges = type("Motion", (), {"box_px": HIGH, "error_px2": 1.0})(), edges
    honest.history.extend((k, HIGH) for k in range(3))
    for _ in range(60):
        honest.told_before = witness.frame - 1, honest.carried_px
        honest.carried_px = HIGH + jitter * rng.normal(size=4) * np.tile(HIGH[2:] - HIGH[:2], 2)
        witness.evidence(honest, sees_foot=False)
    assert edges.deviation == pytest.approx(max(jitter, 0.035), abs=0.03)
    track = track_of(HIGH)
    track.edges = edges if own else EdgeNoise()
    with_corners(witness, track, on_wall(HIGH, 20.0, 4), born=4, box_then=HIGH, told=HIGH)
    strayed = np.abs(places_in(HIGH, track.corners.px) - track.corners.born_places).max(axis=1)
    assert ((strayed > 0.25) & (strayed < 0.4)).all()
    assert (passing(witness, track) is not None) == passes


@pytest.mark.parametrize("stands_there", [True, False])
def test_a_box_that_jumps_off_its_object_once_is_no_phantom(stands_there):
    """It jumps by a third of its side, and stays there; through a phantom the scene passes in every message."""
    scene, points = still_scene(wall=False), on_wall(HIGH, 24.0, 1, 8)
    edges = np.column_stack([CAMERA.normalize(HIGH.reshape(2, 2)), np.ones(2)]) * 23.0
    # Where the pixels that are in its box in frame 1 have gone.
    gone = [CAMERA.project(edges - [0.0, 0.0, k - 1.0]).ravel() for k in range(9)]
    witness, track, found, told = SceneWitness(CAMERA), track_of(HIGH), [], HIGH
    for k in range(1, 9):
        witness.move(estimate(), scene_of(moved(scene, k)))
        track.told_before = (k - 1, told) if k > 1 else None
        told = HIGH
        if stands_there:
            told = gone[k] + 0.33 * (k >= 5) * (gone[k][2] - gone[k][0]) * np.array([1.0, 0.0, 1.0, 0.0])
        if k == 1:
            with_corners(witness, track, points, born=1, box_then=told, told=told)
            track.history.clear()
        track.corners.px, track.told_px, track.carried_px = CAMERA.project(moved(points, k)), told, told
        expected = gone[k] if stands_there else HIGH + gone[k] - gone[k - 1]
        track.motion = type("Motion", (), {"box_px": expected, "error_px2": 1.0})()
        track.history.append((k, gone[k] if stands_there else HIGH))
        found.append(passing(witness, track))
    passed = [evidence for evidence in found[4:] if evidence is not None and evidence > 0.0]
    assert bool(passed) is not stands_there


def test_where_the_camera_is_lost_nothing_is_told():
    witness = watched(still_scene())
    track = track_of(HIGH)
    with_corners(witness, track, on_wall(HIGH, 14.0, 3), born=3, box_then=HIGH, told=HIGH)
    witness.move(None, None)
    assert witness.evidence(track) == (None, None)


def test_corners_that_stay_where_others_pass_are_the_objects():
    witness = watched(still_scene(), shown=still_scene(wall=False))
    track = track_of(HIGH)
    with_corners(witness, track, on_wall(HIGH, 30.0, 1, 3), born=1, box_then=HIGH, told=HIGH)
    alone = passing(witness, track)
    px = HIGH[:2] + np.array([0.4, 0.5, 0.6])[:, None] * (HIGH[2:] - HIGH[:2])
    track.corners.born_px, track.corners.px = (
        np.concatenate([p, px]) for p in (track.corners.born_px, track.corners.px)
    )
    track.corners.births, track.corners.ages = np.append(track.corners.births, [4] * 3), np.full(6, 3)
    track.corners.born_places = np.concatenate([track.corners.born_places, places_in(HIGH, px)])
    assert alone > 3.0 > 0.0 > passing(witness, track)


@pytest.mark.parametrize(("box", "aloft"), [(HIGH, True), (LOW, False)])
def test_a_box_in_the_air_is_told_from_one_on_the_ground(box, aloft):
    witness = watched(still_scene(), shown=still_scene(wall=False))
    track = track_of(box)
    with_corners(witness, track, on_wall(box, 14.0, 3), born=3, box_then=box, told=box)
    assert passing(witness, track) is not None
    assert track.phantom.aloft == aloft


@pytest.mark.parametrize("hides", [True, False])
def test_what_was_hidden_and_is_seen_beside_the_object_now_did_not_pass_through_it(hides):
    """Something crosses; its detector tells of it every third frame."""
    scene, then, now = still_scene(), 2, 5
    told = {then: HIGH, now: HIGH + np.array([110.0, 0.0, 110.0, 0.0])}
    witness = SceneWitness(CAMERA)
    for k in range(1, now + 1):
        points = moved(scene, k)
        if hides and k in told:
            px = CAMERA.project(points)
            points = points[~((px > told[k][:2]) & (px < told[k][2:])).all(axis=1)]
        witness.move(estimate(), scene_of(points))
    track = track_of(told[now])
    track.told_before = then, told[then]
    evidence = passing(witness, track)
    assert (evidence is None) == hides
    assert hides or evidence > 5.0


@pytest.mark.parametrize(("slope", "why"), [(0.0, ""), (0.02, ""), (0.1, "no ground is seen")])
def test_a_plane_that_the_camera_would_run_into_is_no_ground(slope, why):
    """Wheels and sills of parked cars lie on one, too."""
    points = still_scene(wall=False)
    points[:, 1] -= slope * points[:, 2]
    assert watched(points).why == why
