"""People who walk before a standing camera: no corner of theirs lasts, what they hide of the background does."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
import pytest
from object_tools import BACKGROUND, BLANK, FRAME_NS, HEIGHT, MODEL, PATCH, SIDE, WIDTH, place

from belie.checks.objects import ErrorTest, Habit
from belie.detector import Config
from belie.detector.alerts import AlertBook
from belie.detector.figure import Figure
from belie.detector.looks import Looks
from belie.detector.object_track import ObjectTrack
from belie.detector.objects import ObjectStage
from belie.geometry import SE3
from belie.odometry.local_features import ImageStack
from belie.odometry.still_background import NO_DIFFERENCE
from belie.types import AlertType, CheckResult, Detection, DetectionClaim, Frame, Status, VisualEstimate

FRAMES, WIDE, TALL, STEP_PX = 85, 22, 52, 3.0
STREET = cv2.GaussianBlur(np.random.default_rng(1).uniform(0, 255, (HEIGHT, WIDTH)), (0, 0), 4.0)
STREET = np.clip(4.0 * (STREET - STREET.mean()) + 130.0, 0, 255)
STANDS = VisualEstimate(
    stamp_ns=1, previous_stamp_ns=0, T_prev_cur=SE3.identity(), covariance=np.eye(6) * 1e-8,
    corners=99, matches=99, inliers=90, parallax_px=0.02,
)  # fmt: skip


def box(k: int) -> np.ndarray:
    left, top = 20.0 + STEP_PX * k, 80.0
    return np.array([left, top, left + WIDE, top + TALL])


def image(k: int, walker: bool) -> np.ndarray:
    """The street, and who walks there: limbs and clothes swing, so that no patch of them is seen twice."""
    rng = np.random.default_rng(k)
    picture = STREET.copy()
    if walker:
        x, y = round(20.0 + STEP_PX * k), 80
        body = np.zeros((TALL, WIDE), np.uint8)
        swing = round(8.0 * np.sin(1.3 * k))
        for side in (-swing, swing):
            cv2.line(body, (WIDE // 2, 28), (WIDE // 2 + side, TALL - 1), 1, 4)
            cv2.line(body, (WIDE // 2, 14), (WIDE // 2 + side, 28), 1, 3)
        dx, dy, tilt = (int(v) for v in rng.integers(-2, 3, 3))
        cv2.ellipse(body, (WIDE // 2 - dx, 21 + dy), (5 + dy, 11), 6.0 * tilt, 0.0, 360.0, 1, -1)
        cv2.ellipse(body, (WIDE // 2 + dx, 6 + dy), (3 + abs(tilt), 4), 0.0, 0.0, 360.0, 1, -1)
        clothes = cv2.GaussianBlur(rng.uniform(-90, 90, (TALL, WIDE)), (0, 0), 1.5) + 35.0
        picture[y : y + TALL, x : x + WIDE][body > 0] = clothes[body > 0]
    return np.clip(picture + rng.normal(0.0, 1.0, picture.shape), 0, 255).astype(np.uint8)


def watch(
    *, hidden: Iterable[int] = (), gone: Iterable[int] = (), estimate: VisualEstimate | None = STANDS
) -> tuple[list[tuple[int, AlertType, str | None]], list[CheckResult]]:
    """Alerts as (frame, type, object), and what was answered about hiding."""
    config = Config()
    stage, book = ObjectStage(MODEL, config.objects, config.tracking, 0.1), AlertBook()
    rng = np.random.default_rng(7)
    hidden, gone = set(hidden), set(gone)
    alerts, answers = [], []
    for k in range(FRAMES):
        told = ()
        if k not in hidden | gone:
            told = (
                Detection(label="person", score=0.9, track_id="7", box_px=box(k) + rng.normal(0.0, 0.7, 4)),
            )
        claim = DetectionClaim(
            source="/detections", stamp_ns=k * FRAME_NS, received_ns=k * FRAME_NS, detections=told
        )
        stage.take((claim,), k * FRAME_NS)
        frame = Frame(
            camera="/image", stamp_ns=k * FRAME_NS, received_ns=k * FRAME_NS, image=image(k, k not in gone)
        )
        judgements = stage.update(frame, estimate, (BLANK, BLANK[:, 0], BLANK[:, 0]) if estimate else None)
        alerts += [(k, a.type, a.object) for a in book.raise_new(judgements, frame.stamp_ns)]
        answers += [j.result for j in judgements if j.result.check == "hiding"]
    return alerts, answers


def test_a_walking_person_who_is_hidden_is_named() -> None:
    alerts, answers = watch(hidden=range(50, 75))
    assert [a[1:] for a in alerts] == [(AlertType.OBSTACLE_HIDING, "7")]
    assert 50 <= alerts[0][0] < 65
    assert "differs in from the background is the same" in answers[alerts[0][0]].reason


def figure_of(box_px: np.ndarray) -> tuple[Figure, ImageStack, np.ndarray]:
    """A figure that has been met, what the image differs in from the background, and its way till now."""
    told = np.full((HEIGHT, WIDTH), NO_DIFFERENCE, np.uint8)
    x0, y0, x1, y1 = box_px.astype(int)
    cells = np.random.default_rng(5).uniform(-60.0, 60.0, (y1 - y0, x1 - x0))
    told[y0:y1, x0:x1] = NO_DIFFERENCE + cv2.GaussianBlur(cells, (0, 0), 2.0) * 3.0
    figure, difference = Figure(), ImageStack(told)
    figure.meet(0.0, float((box_px[2:] - box_px[:2]).max()))
    figure.learn(difference, box_px)
    return figure, difference, np.array([10.0, 0.0])


def test_an_image_is_asked_once() -> None:
    at = np.array([100.0, 80.0, 122.0, 132.0])
    figure, difference, way = figure_of(at)
    assert figure.look_for(difference, at, way, 1) is not None
    told = figure.evidence
    assert told > 0.0
    assert figure.is_there
    assert figure.look_for(difference, at, way, 1) is None
    assert figure.evidence == told
    assert figure.is_there, "the next message about this image misses it, too"
    assert figure.look_for(difference, at, way, 2) is not None
    assert figure.evidence > told


def test_who_is_off_its_path_does_not_vouch_for_it() -> None:
    at = np.array([100.0, 80.0, 122.0, 132.0])
    figure, difference, way = figure_of(at)
    for frame in range(1, 9):
        at = at - np.array([0.0, 4.0, 0.0, 4.0])
        if figure.look_for(difference, at, way, frame) is None:
            break
        at = at + np.tile(0.5 * figure.shift_px, 2)
    told = figure.evidence
    assert figure.shift_px[1] > 0.0
    assert not figure.is_there
    figure.look_for(difference, at, way, 99)
    assert figure.evidence == told


@pytest.mark.parametrize("after_ns", [1, 3_000_000, 40_000_000])
def test_a_detector_has_a_clock_of_its_own(after_ns: int) -> None:
    """How far a figure is off its place is divided by the time since it was last found, not by that difference."""
    at = np.array([100.0, 80.0, 122.0, 132.0])
    figure, difference, _ = figure_of(at)
    habit = Habit(rate=0.05, persistence_s=0.02, prior_messages=40, prior_gaps=10)
    behind = at - np.array([4.0, 0.0, 4.0, 0.0])
    track = ObjectTrack("7", "7", "person", behind, ErrorTest(habit), ErrorTest(habit))
    track.history.extend([(0, behind), (FRAME_NS, behind)])
    track.looks.figure, track.speed_px_s = figure, np.array([60.0, 0.0])
    track.last_found_ns = FRAME_NS  # some corners on it were followed till here
    track.look_for(difference, FRAME_NS + after_ns, 1)
    assert figure.is_there
    assert 60.0 < track.speed_px_s[0] < 70.0
    assert abs(track.speed_px_s[1]) < 5.0
    track.look_for(difference, FRAME_NS // 2, 2)
    assert track.last_found_ns == FRAME_NS + after_ns, "a late message takes nothing back"


def test_late_messages_do_not_teach_what_stands_where_it_went_away() -> None:
    at = np.array([100.0, 80.0, 122.0, 132.0])
    figure, _, _ = figure_of(at)
    lorry = figure_of(at + 7.0)[1]
    own = figure.picture
    assert own is not None
    for k in range(1, 3):  # messages two images late, the first that show the lorry
        figure.learn_late(lorry, at, (k - 2) * FRAME_NS, k * FRAME_NS)
        assert figure.picture is not None
        assert (figure.picture == own).all()
    figure.learn_late(lorry, at, FRAME_NS, 3 * FRAME_NS)  # it is told of where the lorry is
    assert figure.picture is not None
    assert not (figure.picture == own).all()


def test_a_few_corners_do_not_vouch_for_what_its_figure_denies() -> None:
    at, habit = np.array([100.0, 80.0, 122.0, 132.0]), Habit(0.05, 0.02, 40, 10)
    track = ObjectTrack("7", "7", "person", at, ErrorTest(habit), ErrorTest(habit), weight=9.0)
    track.corners.px = track.corners.places = np.full((4, 2), 110.0)
    track.corners.ages, track.corners_then = np.full(4, 5), 4
    assert track.absence((WIDTH, HEIGHT), Config().objects) == ""
    track.looks.figure.evidence = -4.0
    assert track.absence((WIDTH, HEIGHT), Config().objects).startswith("occluded or gone")


def test_what_is_told_of_and_not_looked_at_has_no_evidence_left() -> None:
    at = np.array([100.0, 80.0, 122.0, 132.0])
    for learn in (lambda looks, d: looks.learn(d, None, at, 0, 0), lambda looks, _: looks.forget()):
        looks = Looks()
        looks.figure, difference, way = figure_of(at)
        looks.figure.look_for(difference, at, way, 1)
        assert looks.figure.evidence != 0.0
        learn(looks, difference)
        assert looks.figure.evidence == 0.0
        assert not looks.figure.may_be_there


def test_keeps_no_image_of_what_is_not_looked_at() -> None:
    """Every object has few corners at first; 64 images of 1080p would stay with 64 cars."""
    config = Config()
    stage = ObjectStage(MODEL, config.objects, config.tracking, 0.1)
    at = np.array([60.0, 130.0, 60.0 + SIDE, 130.0 + SIDE])
    for k in range(20):
        picture = BACKGROUND[:, :WIDTH].copy()
        place(picture, PATCH, 60, 130)
        noise = np.random.default_rng(k).normal(0.0, 1.0, picture.shape)
        ns = k * FRAME_NS
        told = (Detection(label="car", score=0.9, track_id="7", box_px=at),) if k < 15 else ()
        stage.take((DetectionClaim(source="/d", stamp_ns=ns, received_ns=ns, detections=told),), ns)
        image_px = np.clip(picture + noise, 0, 255).astype(np.uint8)
        stage.update(Frame(camera="/image", stamp_ns=ns, received_ns=ns, image=image_px))
        (track,) = stage.streams["/d"].tracks
        assert isinstance(track, ObjectTrack)
        assert k < 5 or (not track.is_soft and track.looks.picture.seen is None)


def test_without_a_standing_camera_nobody_can_tell() -> None:
    alerts, answers = watch(hidden=range(50, 75), estimate=None)
    assert alerts == []
    assert answers[54].status is Status.UNDECIDED


def test_who_goes_out_of_sight_is_not_hidden() -> None:
    alerts, answers = watch(gone=range(50, FRAMES))
    assert alerts == []
    assert all(a.status is not Status.CONTRADICTED for a in answers)


def test_an_honest_detector_is_believed() -> None:
    alerts, _ = watch(hidden=(30, 44, 45, 58, 70))
    assert alerts == []


def ghost(estimate: VisualEstimate | None) -> list[tuple[int, AlertType]]:
    """A street without anybody, in which a detector sees a person for nine messages."""
    config = Config()
    stage, book = ObjectStage(MODEL, config.objects, config.tracking, 0.1), AlertBook()
    imagined = Detection(label="person", score=0.9, track_id="7", box_px=np.array([200.0, 100, 260, 190]))
    alerts = []
    for k in range(FRAMES):
        stamp_ns = k * FRAME_NS
        claim = DetectionClaim(
            source="/detections", stamp_ns=stamp_ns, received_ns=stamp_ns,
            detections=(imagined,) if 40 <= k < 49 else (),
        )  # fmt: skip
        stage.take((claim,), stamp_ns)
        frame = Frame(camera="/image", stamp_ns=stamp_ns, received_ns=stamp_ns, image=image(k, False))
        judgements = stage.update(frame, estimate, (BLANK, BLANK[:, 0], BLANK[:, 0]) if estimate else None)
        alerts += [(k, a.type) for a in book.raise_new(judgements, stamp_ns)]
    return alerts


def test_what_stood_there_all_the_time_untold_is_not_hidden_when_it_is_untold_again() -> None:
    assert ghost(STANDS) == []
    assert [a[1] for a in ghost(None)] == [AlertType.OBSTACLE_HIDING]  # who does not know that it stood there
