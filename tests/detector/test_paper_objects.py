"""Section III-C to the letter: a textured square that moves, is hidden, renamed, or really goes away."""

import cv2
import numpy as np
import pytest

from belie.detector import Config, Detector
from belie.detector.paper_objects import PaperObjectStage
from belie.geometry import SE3, CameraModel
from belie.odometry import LocalConsistency, PaperOdometrySettings, extract_features, image_pyramid
from belie.types import AlertType, Detection, DetectionClaim, Frame, MountedCamera, Status

CAMERA = CameraModel(width=480, height=320, fx=300, fy=300, cx=239.5, cy=159.5)
SETTINGS = PaperOdometrySettings()
SIDE = 90
STEP_NS = 100_000_000


def texture(seed, width, height):
    rng = np.random.default_rng(seed)
    image = sum(cv2.GaussianBlur(rng.normal(size=(height, width)), (0, 0), s) * s for s in (1.5, 4.0))
    return np.clip(128 + 90 * image, 0, 255).astype(np.uint8)


SQUARE, STREET = texture(1, SIDE, SIDE), np.full((320, 480), 100, np.uint8)


def box_at(k, step=4.0):
    return np.array([100 + step * k, 110, 100 + step * k + SIDE, 110 + SIDE], float)


def image_at(k, shown=True, step=4):
    image = STREET.copy()
    if shown:
        x = 100 + step * k
        image[110 : 110 + SIDE, x : x + SIDE] = SQUARE
    return image


def drive(frames):
    """Frames are (image, detections); the judgements of each."""
    stage, local, answers = PaperObjectStage(CAMERA, Config().paper), LocalConsistency(CAMERA, SETTINGS), []
    for k, (image, detections) in enumerate(frames):
        ns = k * STEP_NS
        if detections is not None:
            stage.take([DetectionClaim(source="/d", stamp_ns=ns, received_ns=ns, detections=detections)])
        pyramid = image_pyramid(image, SETTINGS.features)
        local.observe(pyramid, extract_features(pyramid, SETTINGS.features))
        answers.append({j.result.check: j for j in stage.update(ns, local)})
    return answers


def car(k, label="car", track_id="7", **more):
    return Detection(label=label, score=0.9, track_id=track_id, box_px=box_at(k), **more)


def seen(k, **more):
    return image_at(k), [car(k, **more)]


def test_an_object_that_is_detected_all_the_time_is_consistent():
    for answer in drive([seen(k) for k in range(8)]):
        assert {j.result.status for j in answer.values()} == {Status.CONSISTENT}


def test_hidden_while_its_pixels_stay_it_is_accused_at_the_first_missing_message():
    answers = drive([seen(k) if k < 5 else (image_at(k), []) for k in range(9)])
    assert answers[4]["hiding"].result.status is Status.CONSISTENT
    for k in range(5, 9):
        judgement = answers[k]["hiding"]
        assert judgement.result.status is Status.CONTRADICTED
        assert (judgement.result.object, judgement.result.unit) == ("7", "px2")
        assert judgement.result.statistic < 5.0
        assert judgement.onset_ns == 5 * STEP_NS


def test_an_object_that_leaves_no_pixels_is_not_accused_and_dropped():
    answers = drive([seen(k) if k < 5 else (image_at(k, shown=False), []) for k in range(7)])
    assert answers[5]["hiding"].result.status is Status.UNDECIDED
    assert "0 of" in answers[5]["hiding"].result.reason
    assert answers[6]["hiding"].result.reason == "0 objects, all detected"


def test_seen_once_and_gone_is_undecided():
    answers = drive([seen(0), (image_at(1), [])])
    assert answers[1]["hiding"].result.status is Status.UNDECIDED
    assert "one frame only" in answers[1]["hiding"].result.reason


def test_renamed_it_is_accused_until_the_name_returns():
    answers = drive([seen(k, label="bird" if 4 <= k < 7 else "car") for k in range(9)])
    statuses = [a["misclassification"].result.status for a in answers]
    assert statuses == [Status.CONSISTENT] * 4 + [Status.CONTRADICTED] * 3 + [Status.CONSISTENT] * 2
    assert answers[5]["misclassification"].result.object == "7"
    assert "car 7 is called bird" in answers[5]["misclassification"].result.reason
    assert answers[6]["misclassification"].onset_ns == 4 * STEP_NS


def test_without_track_ids_objects_are_numbered():
    answers = drive([(image_at(k), [car(k, track_id="")] if k < 4 else []) for k in range(6)])
    assert answers[5]["hiding"].result.object == "#1"


@pytest.mark.parametrize("wrong_m", [0.0, 1.2])
def test_the_motion_is_that_of_the_3d_positions_where_they_are_told(wrong_m):
    # 4 px a frame at 10 m is 0.133 m; a motion that is told wrongly predicts the box where the object is not.
    told = [(0.4 + (0.4 / 3.0 + wrong_m) * k, 0.0, 10.0) for k in range(5)]
    frames = [seen(k, position_m=told[k]) for k in range(5)]
    hiding = drive([*frames, (image_at(5), [])])[5]["hiding"].result
    assert (hiding.status is Status.CONTRADICTED) == (wrong_m == 0.0)


def test_an_object_that_approaches_is_followed():
    def grown(k):
        size = int(SIDE * 1.05**k)
        image, x = STREET.copy(), 240 - size // 2
        image[160 - size // 2 :, x : x + size][:size] = cv2.resize(SQUARE, (size, size))
        return image, np.array([x, 160 - size // 2, x + size, 160 - size // 2 + size], float)

    frames = []
    for k in range(8):
        image, box = grown(k)
        frames.append((image, [Detection(label="car", score=0.9, track_id="7", box_px=box)] if k < 5 else []))
    answers = drive(frames)
    assert [a["hiding"].result.status for a in answers[5:]] == [Status.CONTRADICTED] * 3


def test_frames_without_a_message_are_undecided_and_the_object_lives_on():
    answers = drive(
        [(image_at(k), [car(k)] if k % 2 == 0 and k < 6 else None if k % 2 else []) for k in range(9)]
    )
    assert answers[3]["hiding"].result.reason == "no message for this frame"
    assert answers[6]["hiding"].result.status is Status.CONTRADICTED


def test_the_detector_raises_each_alert_once():
    camera = MountedCamera(model=CAMERA, T_body_cam=SE3.identity())
    detector = Detector({"/image": camera}, Config(profile="paper"))
    raised = []
    for k in range(8):
        ns = k * STEP_NS
        told = [car(k, label="bird" if k == 3 else "car")] if k < 5 else []
        claim = DetectionClaim(source="/d", stamp_ns=ns, received_ns=ns, detections=told)
        frame = Frame(camera="/image", stamp_ns=ns, received_ns=ns, image=image_at(k))
        raised += [(k, a.type, a.object) for a in detector.update(frame, [claim]).alerts]
    assert raised == [(3, AlertType.OBJECT_MISCLASSIFICATION, "7"), (5, AlertType.OBSTACLE_HIDING, "7")]
