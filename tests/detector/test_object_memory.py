"""How long objects are kept, and what those that have gone teach of their detector."""

from __future__ import annotations

import numpy as np
import pytest
from object_tools import BACKGROUND, COVER, FRAME_NS, MODEL, PATCH, SIDE, WIDTH, Scene, place, texture

from belie.detector import Config
from belie.detector.alerts import AlertBook
from belie.detector.objects import ObjectStage
from belie.types import Detection, DetectionClaim, Frame

NOBODY_ACCUSED = 1e-200  # false alarms an hour, as `belie calibrate` measures


class Watch:
    """An `ObjectStage` that is told boxes by id; `alerts`: (type, object)."""

    def __init__(self, rate=0.1):
        config = Config()
        self.stage, self.book = ObjectStage(MODEL, config.objects, config.tracking, rate), AlertBook()
        self.rng, self.alerts, self.frames, self.hiding = np.random.default_rng(7), [], 0, ""

    def step(self, image, boxes):
        stamp_ns = self.frames * FRAME_NS
        detections = tuple(
            Detection(label="car", score=0.9, track_id=name, box_px=np.asarray(box) + self.rng.normal(0.0, 1.0, 4))
            for name, box in boxes.items()
        )  # fmt: skip
        claim = DetectionClaim(
            source="/detections", stamp_ns=stamp_ns, received_ns=stamp_ns, detections=detections
        )
        self.stage.take((claim,), stamp_ns)
        image = image + np.random.default_rng(1000 + self.frames).normal(0.0, 1.5, image.shape)
        image = np.clip(image, 0, 255).astype(np.uint8)
        judgements = self.stage.update(
            Frame(camera="/image", stamp_ns=stamp_ns, received_ns=stamp_ns, image=image)
        )
        self.alerts += [(a.type.value, a.object) for a in self.book.raise_new(judgements, stamp_ns)]
        self.hiding = next(j.result.status for j in judgements if j.result.check == "hiding")
        self.frames += 1

    @property
    def habits(self):
        return self.stage.habits()["/detections"]


def seen_of(scene, missed, rate=NOBODY_ACCUSED):
    watch = Watch(rate)
    for k in range(scene.frames):
        box = scene.box(k)
        watch.step(scene.image(k), {} if k in missed or box is None else {"7": box})
    return watch


@pytest.mark.parametrize("frames", [60, 48])
def test_who_loses_objects_before_they_leave_is_known_for_it(frames):
    """It is fully in view up to frame 49, and a quarter of it is gone in 53: as it leaves, nobody is to blame."""
    scene = Scene(frames=frames, speed=6.0, start=WIDTH - SIDE - 300.0)
    habits = seen_of(scene, range(38, 60)).habits
    assert habits.missed.begun == pytest.approx(1.0)
    assert habits.missed.lasted == (9.0 if frames == 48 else pytest.approx(11.0, abs=1.0))
    assert habits.missed.chances == pytest.approx(habits.missed.lasted)  # nobody saw it end
    assert [went_on for _, went_on in habits.steps] == [True] * round(habits.missed.lasted)
    assert sum(own.lasted for own in habits.objects) == pytest.approx(habits.missed.lasted)


def test_what_is_accused_or_passes_behind_something_teaches_nothing():
    accused = seen_of(Scene(frames=60, speed=6.0, start=WIDTH - SIDE - 300.0), range(38, 60), rate=0.1)
    assert accused.alerts == [("obstacle_hiding", "7")]
    cover = Scene(36, speed=1.0, start=150.0, cover=lambda k: max(150.0 + k - 10, 420.0 - 14.0 * k))
    covered = seen_of(cover, range(13, 36))
    for watch in (accused, covered):
        assert watch.habits.missed.wrong == 0.0
        assert watch.habits.steps == ()


def parked(covered):
    image = BACKGROUND[:, :WIDTH].copy()
    place(image, PATCH, 160, 130)
    if covered:
        place(image, COVER, 160 + 2 * SIDE // 3 - COVER.shape[1], 100)
    return image


def test_an_accusation_lasts_as_long_as_its_pixels_and_not_for_ever():
    """A lorry stops before two thirds of a parked car; what can still be followed of it does not keep it for ever."""
    watch, box = Watch(), [160.0, 130.0, 160.0 + SIDE, 130.0 + SIDE]
    for _ in range(20):
        watch.step(parked(False), {"7": box})
    for _ in range(200):
        watch.step(parked(False), {})
    assert watch.hiding == "contradicted"
    for k in range(100):
        watch.step(parked(True), {})
        assert watch.hiding != "contradicted" or k < 3
        assert watch.hiding == "undecided" or k < 3 or k > 45  # not acquitted at once
    assert watch.hiding == "consistent"
    assert watch.stage.views == ()
    assert watch.alerts == [("obstacle_hiding", "7")]


def test_a_parked_car_that_something_unseen_stops_before_is_not_hidden():
    """What is found in its box from then on is not its own."""
    watch, box = Watch(), [160.0, 130.0, 160.0 + SIDE, 130.0 + SIDE]
    for k in range(50):
        watch.step(parked(k >= 20), {"7": box} if k < 20 else {})
    assert watch.alerts == []


def other_place(k):
    image = BACKGROUND[:, :WIDTH].copy()
    place(image, PATCH, 60, 130)
    place(image, texture(9, SIDE, SIDE), 300, 130)
    x = 300.0 if 20 <= k < 35 else 60.0
    return image, {"7": [x, 130.0, x + SIDE, 130.0 + SIDE]}


def new_id(k):
    scene, cover = Scene(speed=0.0), np.array([24.0, 140.0, 60.0 + 0.5 * SIDE, 220.0])
    box, off = scene.box(k), 0.39 * SIDE * np.array([1.0, 0.0, 1.0, 0.0])
    image = scene.image(k)
    place(image, texture(5, 72, 80), 24, 140)
    return image, {"9": cover} | ({"7": box} if k < 20 else {"8": box + off} if k > 22 else {})


def flood(k):
    image, boxes = BACKGROUND[:, :WIDTH].copy(), {}
    place(image, texture(11, 120, 120), 180, 180)
    for i in range(64):
        x, y = 10 + 28 * (i % 16), 5 + 28 * (i // 16)
        boxes[f"s{i}"] = [x, y, x + 20.0, y + 20.0]
    return image, boxes | ({"near": [180.0, 180.0, 300.0, 300.0]} if k > 5 else {})


@pytest.mark.parametrize("told", [other_place, new_id, flood])
def test_what_was_seen_of_dropped_objects_is_kept(told):
    watch, met = Watch(), set()
    for k in range(60 if told is other_place else 30):
        watch.step(*told(k))
        met |= {view.name for view in watch.stage.views}
    assert len(watch.habits.objects) > len(watch.stage.views)
    assert sum(own.right for own in watch.habits.objects) == pytest.approx(watch.habits.missed.right)
