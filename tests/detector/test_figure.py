"""People who walk before a standing camera: no corner of theirs lasts, what they hide of the background does."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
from object_tools import BLANK, FRAME_NS, HEIGHT, MODEL, WIDTH

from belie.detector import Config
from belie.detector.alerts import AlertBook
from belie.detector.objects import ObjectStage
from belie.geometry import SE3
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
