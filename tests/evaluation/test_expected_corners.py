"""Corners under a claim: a lie of known size must move them by a known number of pixels."""

import cv2
import numpy as np
import pytest

from belie.detector import ObjectView
from belie.evaluation.expected_corners import View, corners_under_claim
from belie.evaluation.followed import FollowedObject
from belie.evaluation.snapshots import SnapshotRecorder
from belie.geometry import SE3, CameraModel, so3_exp
from belie.types import (
    Alert,
    AlertType,
    CheckResult,
    Frame,
    MountedCamera,
    Status,
    Verdict,
    VisualEstimate,
)

CAMERA = CameraModel(width=320, height=240, fx=200, fy=200, cx=159.5, cy=119.5)
DEPTH_M, STEP_M = 5.0, 0.1


@pytest.fixture(scope="module")
def frames():
    """A camera that moves to the right before a wall."""
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(
        np.kron(rng.integers(0, 256, (80, 120)), np.ones((5, 5))).astype(np.uint8), (5, 5), 1.2
    )
    made = []
    for k in range(6):
        shift = np.array([[1.0, 0.0, -CAMERA.fx * STEP_M * k / DEPTH_M - 40.0], [0.0, 1.0, -40.0]])
        image = cv2.warpAffine(wall, shift, (320, 240))
        made.append(Frame(camera="/image", stamp_ns=k * 10**8, received_ns=0, image=image))
    return made


def views(frames, lie=None):
    """The claim adds `lie` to every step of the true motion."""
    claimed = seen = SE3.identity()
    found = []
    for k, frame in enumerate(frames):
        found.append(View(number=k, frame=frame, T_odom_cam_claimed=claimed, T_odom_cam_seen=seen))
        step = SE3.from_translation([STEP_M, 0.0, 0.0])
        seen, claimed = seen @ step, claimed @ step @ (lie or SE3.identity())
    return found


@pytest.fixture(scope="module")
def corners(frames):
    px = cv2.goodFeaturesToTrack(frames[-1].image, 60, 0.05, 12).reshape(-1, 2).astype(float)
    return px[(px[:, 0] < 280) & (px[:, 0] > 20) & (np.abs(px[:, 1] - 120) < 90)]


def test_a_true_claim_puts_corners_where_they_are(frames, corners):
    observed, expected = corners_under_claim(views(frames), CAMERA, corners)
    assert len(observed) > 20
    assert np.median(np.abs(expected - observed)) < 0.3


def test_a_false_step_moves_them_by_its_parallax(frames, corners):
    lie = SE3.from_translation([0.0, 0.05, 0.0])
    observed, expected = corners_under_claim(views(frames, lie), CAMERA, corners)
    moved = np.median(expected - observed, axis=0)
    # Five steps of 5 cm downwards: all corners go up in the image by f * 0.25 m / 5 m.
    assert moved == pytest.approx([0.0, -CAMERA.fy * 0.25 / DEPTH_M], abs=0.7)


def test_a_false_turn_moves_them_without_any_depth(frames, corners):
    still = [frames[-1]] * 3
    lie = SE3(so3_exp(np.array([0.0, 0.01, 0.0])), np.zeros(3))
    made = [
        View(
            number=k,
            frame=frame,
            T_odom_cam_claimed=SE3.exp(np.array(lie.log()) * k),
            T_odom_cam_seen=SE3.identity(),
        )
        for k, frame in enumerate(still)
    ]
    observed, expected = corners_under_claim(made, CAMERA, corners)
    centre = np.abs(observed[:, 0] - CAMERA.cx) < 80
    assert np.median((expected - observed)[centre, 0]) == pytest.approx(-CAMERA.fx * 0.02, rel=0.1)


def test_without_poses_or_corners_there_is_nothing_to_draw(frames, corners):
    unknown = [View(number=0, frame=f, T_odom_cam_claimed=None, T_odom_cam_seen=None) for f in frames]
    assert corners_under_claim(unknown, CAMERA, corners) is None
    assert corners_under_claim(views(frames), CAMERA, np.empty((0, 2))) is None
    assert corners_under_claim(views(frames)[:1], CAMERA, corners) is None


@pytest.mark.parametrize("followed", [True, False])
def test_a_snapshot_of_an_object_shows_the_object(frames, corners, followed):
    recorder = SnapshotRecorder({}, claims_predict=False)
    alert = Alert(type=AlertType.OBSTACLE_HIDING, source="/detections", onset_ns=0, object="7")
    car = ObjectView(
        source="/detections", name="7", label="car", told_label="car", misnamed=False,
        box_px=np.array([40.0, 30.0, 80.0, 50.0]), detected_px=None, told_ns=0, predicted_px=corners[:3] + 1.0,
        observed_px=corners[:3], error_px2=0.1, status="missing",
    )  # fmt: skip
    (view, *_) = views(frames)
    verdict = Verdict(
        frame=0, stamp_ns=view.frame.stamp_ns, status=Status.CONTRADICTED, latency_ms=1.0, alerts=(alert,)
    )
    recorder.add(view, verdict, None, (FollowedObject(view=car),) if followed else ())
    (snapshot,) = recorder.finish()
    assert snapshot.basis == "object"
    assert snapshot.object is (car if followed else None)
    assert len(snapshot.observed_px) == (3 if followed else 0)


def test_a_snapshot_begins_before_the_lie(frames, corners):
    recorder = SnapshotRecorder(
        {"/image": MountedCamera(model=CAMERA, T_body_cam=SE3.identity())}, claims_predict=False
    )
    alert = Alert(type=AlertType.ODOMETRY_SPOOFING, source="/odom", onset_ns=3 * 10**8)
    for view in views(frames, SE3.from_translation([0.0, 0.05, 0.0])):
        last = view.number == 5
        check = CheckResult(check="odometry", source="/odom", status=Status.CONSISTENT)
        estimate = VisualEstimate(
            stamp_ns=view.frame.stamp_ns, previous_stamp_ns=0, T_prev_cur=SE3.identity(),
            covariance=np.eye(6), corners=9, matches=9, inliers=9, parallax_px=1.0,
            observed_px=corners, predicted_px=corners,
        )  # fmt: skip
        verdict = Verdict(
            frame=view.number, stamp_ns=view.frame.stamp_ns, status=Status.CONSISTENT, latency_ms=1.0,
            checks=(check,), alerts=(alert,) if last else (),
        )  # fmt: skip
        recorder.add(view, verdict, estimate)
    (snapshot,) = recorder.finish()
    assert (snapshot.number, snapshot.basis, snapshot.since_ns) == (5, "claim", 2 * 10**8)
    assert snapshot.displacement_px == pytest.approx(CAMERA.fy * 0.15 / DEPTH_M, abs=0.7)
