"""Detectors that are late, fast, slow, without ids, without boxes, or blind together with the camera."""

from __future__ import annotations

import numpy as np
import pytest
from object_tools import BACKGROUND, COVER, FRAME_NS, HEIGHT, MODEL, PATCH, SIDE, WIDTH, Scene, place, texture

from belie.detector import Config
from belie.detector.alerts import AlertBook
from belie.detector.object_shares import ObjectShares
from belie.detector.objects import ObjectStage
from belie.detector.scene_witness import SceneWitness
from belie.types import Detection, DetectionClaim, Frame, Status


def told(box, name="7", label="car", score=0.9):
    return Detection(label=label, score=score, track_id=name, box_px=np.asarray(box, dtype=float))


def message(stamp_ns, *detections):
    return DetectionClaim(
        source="/detections", stamp_ns=stamp_ns, received_ns=stamp_ns, detections=detections
    )


class Watch:
    """An `ObjectStage` with the alerts it raised: (frame, type, object)."""

    def __init__(self):
        config = Config()
        self.stage, self.book = ObjectStage(MODEL, config.objects, config.tracking, 0.1), AlertBook()
        self.rng, self.alerts, self.answers = np.random.default_rng(7), [], []

    def near(self, box, sigma=1.0):
        return np.asarray(box, dtype=float) + self.rng.normal(0.0, sigma, 4)

    def step(self, k, image, *messages, frame_ns=FRAME_NS, doubted=""):
        self.stage.take(messages, k * frame_ns)
        frame = Frame(camera="/image", stamp_ns=k * frame_ns, received_ns=k * frame_ns, image=image)
        judgements = self.stage.update(frame, doubted=doubted)
        self.alerts += [(k, a.type.value, a.object) for a in self.book.raise_new(judgements, frame.stamp_ns)]
        self.answers.append({j.result.check: j.result for j in judgements})

    @property
    def stream(self):
        return self.stage.streams["/detections"]


def with_noise(image, k):
    noise = np.random.default_rng(1000 + k).normal(0.0, 1.5, image.shape)
    return np.clip(image + noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("late", [1, 3, 6])
def test_late_corrections_do_not_add_up(late):
    watch, scene, frame_ns = Watch(), Scene(speed=0.0), FRAME_NS // 3
    for k in range(90):
        messages = [message((k - late) * frame_ns, told(watch.near(scene.box(k))))] if k >= late else []
        watch.step(k, scene.image(k), *messages, frame_ns=frame_ns)
        if k > 20:
            (track,) = watch.stream.tracks
            assert np.abs(track.box_px - scene.box(k)).max() < 4.0
    assert watch.alerts == []


def test_many_messages_to_one_image_do_not_add_up():
    watch, scene = Watch(), Scene(speed=1.0)
    for k in range(40):
        stamps = [k * FRAME_NS - i * FRAME_NS // 6 for i in range(5, -1, -1)]
        watch.step(k, scene.image(k), *(message(t, told(watch.near(scene.box(k)))) for t in stamps))
    (track,) = watch.stream.tracks
    assert np.abs(track.box_px - scene.box(39)).max() < 4.0
    assert watch.alerts == []


@pytest.mark.parametrize("blind", [6, 20])
def test_what_is_told_of_a_blind_image_tells_nothing(blind):
    watch, scene = Watch(), Scene(speed=1.0)
    for k in range(20 + blind + 20):
        dark = 20 <= k < 20 + blind
        detections = () if dark else (told(watch.near(scene.box(k))),)
        watch.step(k, scene.image(k), message(k * FRAME_NS, *detections), doubted="too dark" if dark else "")
    assert watch.alerts == []
    assert watch.stream.waiting == []


def test_where_no_object_is_told_of_it_is_said_what_cannot_be_seen():
    watch, scene = Watch(), Scene()
    for k in range(10):
        watch.step(k, scene.image(k), message(k * FRAME_NS))
    assert "hidden from the first image on" in watch.answers[-1]["hiding"].reason


@pytest.mark.parametrize("name", ["-1", "0"])
def test_one_id_for_all_objects_is_no_id(name):
    watch, image = Watch(), BACKGROUND[:, :WIDTH].copy()
    boxes = [np.array([x, 130.0, x + 50, 180.0]) for x in (40.0, 200.0, 360.0)]
    for i, box in enumerate(boxes):
        place(image, texture(10 + i, 50, 50), box[0], 130)
    for k in range(30):
        watch.step(
            k, with_noise(image, k), message(k * FRAME_NS, *(told(watch.near(b), name) for b in boxes))
        )
    assert watch.alerts == []


def test_one_image_is_one_piece_of_evidence(monkeypatch):
    watch, scene = Watch(), Scene(speed=1.0)
    monkeypatch.setattr(
        SceneWitness, "evidence", lambda *_, **__: (None, 6.0 if len(watch.answers) in (20, 21) else -6.0)
    )
    for k in range(30):
        stamps = [k * FRAME_NS - i * FRAME_NS // 3 for i in (2, 1, 0)]
        watch.step(k, scene.image(k), *(message(t, told(watch.near(scene.box(k)))) for t in stamps))
    assert watch.alerts == []


@pytest.mark.parametrize("interval", [15, 20])
def test_a_slow_detector_is_accused_too(interval):
    watch, scene = Watch(), Scene(speed=0.0)
    for k in range(22 * interval):
        detections = (told(watch.near(scene.box(k))),) if k < 12 * interval else ()
        watch.step(k, scene.image(k), *([] if k % interval else [message(k * FRAME_NS, *detections)]))
    assert [alert[1:] for alert in watch.alerts] == [("obstacle_hiding", "7")]


def test_a_small_object_is_kept_until_a_slow_detector_can_be_accused_of_hiding_it():
    watch, patch, interval = Watch(), texture(1, 28, 28), 10
    for k in range(20 * interval):
        image = BACKGROUND[:, :WIDTH].copy()
        place(image, patch, 200, 150)
        there = [told(watch.near([200, 150, 228, 178], 0.3))] if k < 10 * interval else []
        watch.step(
            k, with_noise(image, k), *([message(k * FRAME_NS, *there)] if k % interval == 0 else []),
            frame_ns=FRAME_NS,
        )  # fmt: skip
    assert [kind for _, kind, _ in watch.alerts] == ["obstacle_hiding"]


def test_nobody_asks_how_long_an_object_may_be_missing_that_is_told_of(monkeypatch):
    watch, asked = Watch(), []
    for k in range(6):
        watch.step(k, with_noise(BACKGROUND[:, :WIDTH], k), message(k * FRAME_NS, told([100, 100, 160, 160])))
    threshold = ObjectShares.threshold
    monkeypatch.setattr(ObjectShares, "threshold", lambda *args: asked.append(1) or threshold(*args))
    monkeypatch.setattr("belie.detector.objects.answer", lambda *_: [])
    watch.step(6, with_noise(BACKGROUND[:, :WIDTH], 6), message(6 * FRAME_NS, told([100, 100, 160, 160])))
    assert not asked


def test_a_near_object_is_followed_before_many_small_ones():
    watch, image = Watch(), BACKGROUND[:, :WIDTH].copy()
    place(image, texture(11, 120, 120), 180, 180)
    small = [
        [10 + 28 * (i % 16), 5 + 28 * (i // 16), 30 + 28 * (i % 16), 25 + 28 * (i // 16)] for i in range(70)
    ]
    for k in range(60):
        detections = [told(watch.near(b, 0.3), f"s{i}", "person", 0.3) for i, b in enumerate(small)]
        if 5 <= k < 40:
            detections.append(told(watch.near([180, 180, 300, 300]), "near"))
        watch.step(k, with_noise(image, k), message(k * FRAME_NS, *detections))
    assert [alert[1:] for alert in watch.alerts] == [("obstacle_hiding", "near")]
    assert "7 smaller ones are not followed" in watch.answers[20]["hiding"].reason


def test_one_lie_under_running_ids_is_one_alert():
    watch, scene = Watch(), Scene(speed=1.0)
    for k in range(40):
        label = "bird" if k >= 20 else "car"
        watch.step(k, scene.image(k), message(k * FRAME_NS, told(watch.near(scene.box(k)), str(k), label)))
    assert [alert[1] for alert in watch.alerts] == ["object_misclassification"]


@pytest.mark.parametrize("hidden_from", [20, 40])
def test_detections_that_nobody_can_place_are_not_judged(hidden_from):
    watch, scene = Watch(), Scene()
    ahead = Detection(label="car", score=0.9, track_id="7", position_m=np.array([0.0, 0.0, 10.0]))
    for k in range(40):
        watch.step(k, scene.image(k), message(k * FRAME_NS, *([ahead] if k < hidden_from else [])))
    assert {result.status for result in watch.answers[-1].values()} == {"undecided"}
    assert "neither an image box nor a size" in watch.answers[-1]["hiding"].reason


def test_what_is_accused_is_not_acquitted_by_what_passes_before_it():
    watch, image = Watch(), BACKGROUND[:, :WIDTH].copy()
    place(image, PATCH, 60, 130)
    for k in range(45):
        seen = image.copy()
        if k == 34:
            place(seen, COVER, 30, 100)
        box = [60.0, 130.0, 60.0 + SIDE, 130.0 + SIDE]
        detections = (told(watch.near(box)),) if k < 20 else ()
        watch.step(k, with_noise(seen, k), message(k * FRAME_NS, *detections))
    assert [alert[1:] for alert in watch.alerts] == [("obstacle_hiding", "7")]
    assert watch.answers[34]["hiding"].status == "undecided"


def test_a_shifted_box_that_comes_back_leaves_no_object_behind():
    watch, image = Watch(), BACKGROUND[:, :WIDTH].copy()
    place(image, PATCH, 60, 130)
    place(image, texture(9, SIDE, SIDE), 300, 130)
    for k in range(60):
        x = 300.0 if 20 <= k < 35 else 60.0
        box = [x, 130.0, x + SIDE, 130.0 + SIDE]
        watch.step(k, with_noise(image, k), message(k * FRAME_NS, told(watch.near(box))))
    assert [alert[1:] for alert in watch.alerts] == [("obstacle_hiding", "7")]
    assert watch.answers[50]["hiding"].status == "consistent"


def test_an_image_without_pixels_in_the_boxes_is_survived():
    watch = Watch()
    blank = np.full((HEIGHT, WIDTH), 120, np.uint8)
    for k in range(30):
        watch.step(
            k, blank, message(k * FRAME_NS, told([-50, -50, 2, 2]), told([WIDTH - 1, 0, WIDTH + 90, 90], "8"))
        )
    assert watch.alerts == []


def test_who_takes_a_hidden_object_s_id_is_not_forgotten_with_it():
    watch, image = Watch(), BACKGROUND[:, :WIDTH].copy()
    place(image, PATCH, 60, 130)
    place(image, texture(9, SIDE, SIDE), 300, 130)
    x, y = ([left, 130.0, left + SIDE, 130.0 + SIDE] for left in (60.0, 300.0))
    for k in range(40):
        if k < 20:
            detections = [told(watch.near(x), "5"), told(watch.near(y), "6")]
        else:
            detections = [told(watch.near(y if k == 20 else x), "5")]
        watch.step(k, with_noise(image, k), message(k * FRAME_NS, *detections))
    assert [alert[1] for alert in watch.alerts] == ["obstacle_hiding"]
    assert np.abs(next(t for t in watch.stream.tracks if t.hiding.accused).box_px - y).max() < 8.0


def test_a_flood_of_boxes_makes_nothing_forgotten():
    watch, scene = Watch(), Scene(speed=0.0)
    for k in range(40):
        detections = [told(watch.near(scene.box(k)))] if k < 20 else []
        if k == 20:
            detections = [told([2 * i, 10, 2 * i + 200, 210], f"f{i}") for i in range(70)]
        watch.step(k, scene.image(k), message(k * FRAME_NS, *detections))
    assert ("obstacle_hiding", "7") in [alert[1:] for alert in watch.alerts]


@pytest.mark.parametrize("first_ns", [-5_000_000_000, -1_000_000])
def test_the_rate_of_messages_is_that_of_most(first_ns):
    watch, scene = Watch(), Scene(speed=1.0)
    for k in range(12):
        stamps = [first_ns, 0] if k == 0 else [k * FRAME_NS]
        watch.step(k, scene.image(k), *(message(t, told(watch.near(scene.box(k)))) for t in stamps))
    assert watch.stream.interval_s == pytest.approx(0.1)


def shrunk(box, share):
    """A box of so large a share of the sides, about the same middle."""
    middle, half = 0.5 * (box[:2] + box[2:]), 0.5 * share * (box[2:] - box[:2])
    return np.concatenate([middle - half, middle + half])


def test_a_box_that_shrinks_to_a_tenth_is_no_longer_its_objects():
    watch, scene = Watch(), Scene(speed=1.0)
    for k in range(40):
        box = watch.near(scene.box(k)) if k < 20 else shrunk(scene.box(k), 0.3)
        watch.step(k, scene.image(k), message(k * FRAME_NS, told(box)))
    assert [(kind, name) for _, kind, name in watch.alerts] == [("obstacle_hiding", "7")]
    assert watch.alerts[0][0] - 20 < 6


def test_a_box_that_jumps_with_its_object_is_its_objects():
    """From one message to the next it moves on by two thirds of its side, as at 2 Hz; its id stays."""
    watch, scene = Watch(), Scene(speed=48.0, start=0.0)
    for k in range(8):
        watch.step(
            k,
            scene.image(k),
            message(5 * k * FRAME_NS, told(watch.near(scene.box(k)))),
            frame_ns=5 * FRAME_NS,
        )
    assert len(watch.stream.tracks) == 1
    assert watch.alerts == []


def test_what_was_told_in_the_stead_of_a_hidden_object_is_hidden_by_nobody():
    watch, scene = Watch(), Scene(speed=0.0, start=300.0)
    for k in range(45):
        background = np.array([120.0 - k, 40.0, 192.0 - k, 112.0])  # goes along with what is seen there
        boxes = (scene.box(k),) if k < 15 else (background,) if k < 30 else ()
        watch.step(k, scene.image(k), message(k * FRAME_NS, *(told(watch.near(box)) for box in boxes)))
    assert watch.alerts == [(19, "obstacle_hiding", "7")]


def test_a_phantom_that_is_not_told_of_is_no_lie_of_that_message(monkeypatch):
    watch, scene = Watch(), Scene(speed=1.0)
    monkeypatch.setattr(SceneWitness, "evidence", lambda *_, **__: (None, 6.0))
    for k in range(30):
        detections = (told(watch.near(scene.box(k))),) if k not in (20, 21) and k < 25 else ()
        watch.step(k, scene.image(k), message(k * FRAME_NS, *detections))
    assert [alert[1:] for alert in watch.alerts] == [("obstacle_injection", "7")]
    lies = [
        k for k, answers in enumerate(watch.answers) if answers["injection"].status is Status.CONTRADICTED
    ]
    assert lies == [*range(lies[0], 20), *range(22, 25)]


@pytest.mark.parametrize("every", [(1, 5), (1, 10), (5, 1)])
@pytest.mark.parametrize("speed", [0.0, 2.0])
def test_a_rate_of_messages_that_changes_is_no_attack(every, speed):
    """From 10 Hz to 2 or 1 Hz and the other way; one message in seven misses the object."""
    watch, scene, before = Watch(), Scene(speed=speed), 60
    for k in range(130):
        messages, n = [], every[k >= before]
        if k % n == 0:
            found = [told(watch.near(scene.box(k)))] if (k // n) % 7 != 6 else []
            messages = [message(k * FRAME_NS, *found)]
        watch.step(k, scene.image(k), *messages)
    assert watch.alerts == []
    assert len(watch.stream.tracks) == 1


@pytest.mark.parametrize("ids", [("7", "7"), ("7", "31"), ("", "")])
@pytest.mark.parametrize("every", [1, 3])
def test_two_detectors_that_tell_of_the_same_object_are_judged_each_by_itself(ids, every):
    """Each has boxes, names, errors and a rate of its own; one of them then hides the object."""
    watch, scene = Watch(), Scene(speed=1.0)
    raised = []
    for k in range(60):
        stamp_ns, box = k * FRAME_NS, scene.box(k)
        first = [told(watch.near(box), ids[0])] if k % 9 != 8 else []
        swung = told(watch.near(box, 4.0), ids[1], "truck")
        claims = [
            DetectionClaim(source="/first", stamp_ns=stamp_ns, received_ns=stamp_ns, detections=tuple(first))
        ]
        if k % every == 0:
            second = (swung,) if k < 30 else ()
            claims.append(
                DetectionClaim(source="/second", stamp_ns=stamp_ns, received_ns=stamp_ns, detections=second)
            )
        watch.stage.take(tuple(claims), stamp_ns)
        frame = Frame(camera="/image", stamp_ns=stamp_ns, received_ns=stamp_ns, image=scene.image(k))
        raised += [
            (k, a.type.value, a.source) for a in watch.book.raise_new(watch.stage.update(frame), stamp_ns)
        ]
        assert k >= 30 or not raised
    assert [alert[1:] for alert in raised] == [("obstacle_hiding", "/second")]
    first, second = (watch.stage.streams[source] for source in ("/first", "/second"))
    assert {id(track.edges) for track in second.tracks} == {id(second.edges)}
    assert second.edges is not first.edges
