"""Objects before and behind others, standing still, in fog, and coming nearer while they are hidden."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from belie.detector import Config
from belie.detector.alerts import AlertBook
from belie.detector.objects import ObjectStage
from belie.geometry import CameraModel
from belie.types import Detection, DetectionClaim, Frame, Status

WIDTH, HEIGHT, FRAME_NS = 480, 320, 100_000_000
MODEL = CameraModel(width=WIDTH, height=HEIGHT, fx=400, fy=400, cx=239.5, cy=159.5)


def texture(seed, width, height, contrast=60.0, cell=6):
    cells = np.random.default_rng(seed).uniform(-1.0, 1.0, (height // cell + 1, width // cell + 1))
    picture = np.kron(cells, np.ones((cell, cell)))[:height, :width]
    return 120.0 + contrast * cv2.GaussianBlur(picture, (3, 3), 0.8)


class Thing:
    """Something on the street: pasted at its box, told of under its id where `told` says so."""

    def __init__(self, name, picture, box, told=lambda k: True, label="car", off=0.0):
        self.off_px = np.array([off, 0.0, off, 0.0])
        self.name, self.picture, self.box, self.told, self.label = name, picture, box, told, label

    def paste(self, image, k):
        left, top, right, bottom = np.round(self.box(k)).astype(int)
        picture = cv2.resize(self.picture, (right - left, bottom - top), interpolation=cv2.INTER_AREA)
        x0, y0, x1, y1 = max(left, 0), max(top, 0), min(right, WIDTH), min(bottom, HEIGHT)
        if x1 > x0 and y1 > y0:
            image[y0:y1, x0:x1] = picture[y0 - top : y1 - top, x0 - left : x1 - left]


def stand(left, top, right, bottom):
    box = np.array([left, top, right, bottom], dtype=np.float64)
    return lambda k: box


def watch(things, frames, *, noise=1.5, jitter=1.0, backdrop=None):
    """Alerts as (frame, type, object), results and views by frame; `things` from the farthest to the nearest."""
    config = Config()
    stage, book = ObjectStage(MODEL, config.objects, config.tracking, 0.1), AlertBook()
    street = texture(0, WIDTH, HEIGHT, 25.0) if backdrop is None else backdrop
    rng, alerts, results, views = np.random.default_rng(3), [], [], []
    for k in range(frames):
        image = street.copy()
        told = []
        for thing in things:
            thing.paste(image, k)
            if thing.told(k):
                box = np.clip(
                    thing.box(k) + thing.off_px + rng.normal(0.0, jitter, 4), 0.0, [WIDTH, HEIGHT] * 2
                )
                told.append(Detection(label=thing.label, score=0.9, track_id=thing.name, box_px=box))
        image = np.clip(np.round(image + rng.normal(0.0, noise, image.shape)), 0, 255).astype(np.uint8)
        now = k * FRAME_NS
        claim = DetectionClaim(source="/detections", stamp_ns=now, received_ns=now, detections=tuple(told))
        stage.take((claim,), now)
        judgements = stage.update(Frame(camera="/image", stamp_ns=now, received_ns=now, image=image))
        alerts += [(k, a.type.value, a.object) for a in book.raise_new(judgements, now)]
        results.append({j.result.check: j.result for j in judgements})
        views.append({view.name: view for view in stage.views})
    return alerts, results, views


def before(onset):
    return lambda k: k < onset


def test_where_everything_stands_still_a_hidden_object_is_named():
    parked = Thing("7", texture(1, 60, 40), stand(200, 140, 260, 180), before(20))
    alerts, _, _ = watch([parked], 30)
    assert [(kind, name) for _, kind, name in alerts] == [("obstacle_hiding", "7")]
    assert alerts[0][0] - 20 < 6


def test_fog_hides_nothing_while_the_image_is_clean():
    """A contrast of six gray levels is enough at a noise of 0.7, and not at a noise of 4."""
    pale = Thing("7", texture(1, 60, 40, 6.0), stand(200, 140, 260, 180), before(20))
    fog = texture(0, WIDTH, HEIGHT, 2.0)
    alerts, _, _ = watch([pale], 30, noise=0.7, backdrop=fog)
    assert [(kind, name) for _, kind, name in alerts] == [("obstacle_hiding", "7")]
    alerts, results, _ = watch([pale], 30, noise=4.0, backdrop=fog)
    assert alerts == []
    assert results[25]["hiding"].status is Status.UNDECIDED
    assert "too few corners" in results[25]["hiding"].reason


FAR, NEAR = (
    stand(180, 130, 260, 180),
    stand(222, 125, 320, 210),
)  # the near one covers 48 % of the far one's box


def test_an_object_that_was_told_of_while_covered_as_much_is_missed():
    far = Thing("far", texture(1, 80, 50), FAR, before(40))
    alerts, _, _ = watch([far, Thing("near", texture(2, 98, 85), NEAR)], 60)
    assert [(kind, name) for _, kind, name in alerts] == [("obstacle_hiding", "far")]
    assert 4 <= alerts[0][0] - 40 < 12


def test_who_is_newly_covered_may_be_missed_for_ever():
    """The near one drives up while the far one stands, and its detector loses the far one then."""

    def drives(k):
        return NEAR(k) + np.array([1.0, 0.0, 1.0, 0.0]) * max(0.0, 150.0 - 8.0 * k)

    arrives = next(k for k in range(60) if drives(k)[0] < 235.0)
    far = Thing("far", texture(1, 80, 50), FAR, before(arrives))
    alerts, _, _ = watch([far, Thing("near", texture(2, 98, 85), drives)], 70)
    assert alerts == []


def test_corners_of_a_nearer_object_do_not_speak_for_the_one_behind():
    """All that can be seen of the far one is blank: the corners in its box are the near one's."""
    far = Thing("far", np.full((50, 80), 120.0), stand(200, 150, 260, 180), before(30))
    near = Thing("near", texture(2, 98, 85), stand(190, 125, 288, 210))
    alerts, results, _ = watch([far, near], 50)
    assert alerts == []
    assert "far" in results[33]["hiding"].reason


def test_the_object_behind_a_hidden_one_does_not_take_its_place():
    """It is told of for the first time, under an id of its own, and overlaps the hidden one (IoU 0.35)."""
    hidden = Thing("7", texture(1, 60, 40), stand(200, 140, 260, 180), before(20))
    behind = Thing("9", texture(2, 60, 40), stand(225, 132, 285, 166), lambda k: k >= 21)
    alerts, _, views = watch([behind, hidden], 40)
    assert [(kind, name) for _, kind, name in alerts] == [("obstacle_hiding", "7")]
    assert set(views[-1]) == {"7", "9"}


def test_an_object_under_a_new_id_is_no_hidden_one():
    box = stand(200, 140, 260, 180)
    first = Thing("7", texture(1, 60, 40), box, before(20))
    again = Thing("8", texture(1, 60, 40), box, lambda k: k >= 23)
    alerts, _, views = watch([first, again], 45)
    assert alerts == []
    assert set(views[-1]) == {"8"}


def test_a_hidden_object_that_comes_nearer_keeps_corners_to_be_followed_by():
    def comes(k):
        w, h = 30.0 * 1.05**k, 20.0 * 1.05**k
        return np.array([240.0 - w, 160.0 - h, 240.0 + w, 160.0 + h])

    car = Thing("7", texture(1, 240, 160, cell=8), comes, before(12))
    alerts, _, views = watch([car], 38)
    assert [name for _, _, name in alerts] == ["7"]
    view = views[-1]["7"]
    assert view.status == "missing"
    assert len(view.observed_px) >= 12
    assert np.abs(view.box_px - comes(37)).max() < 0.12 * (comes(37)[2] - comes(37)[0])


def test_the_box_of_a_covered_object_does_not_grow():
    def comes(k):
        w, h = 20.0 * 1.06**k, 14.0 * 1.06**k
        return np.array([240.0 - w, 160.0 - h, 240.0 + w, 160.0 + h])

    def wall(k):  # blank, told of by nobody, before the car from frame 15 on
        return np.array([40.0, 20.0, 440.0, 300.0]) + (0.0 if k >= 15 else 1000.0)

    car = Thing("7", texture(1, 200, 140, cell=8), comes, before(15))
    alerts, _, views = watch([car, Thing("w", np.full((280, 400), 120.0), wall, before(0))], 24)
    assert alerts == []
    seen, covered = views[14]["7"].box_px, views[23]["7"].box_px
    assert covered[2] - covered[0] < 1.2 * (seen[2] - seen[0])


GHOST = stand(0, 0, WIDTH, HEIGHT)  # a box over everything, and nothing is there


@pytest.mark.parametrize("label", ["truck", "balloon"])
@pytest.mark.parametrize("ghost_from", [10, 20, 24])
def test_a_box_over_the_whole_image_hides_nobody_whose_corners_stay(ghost_from, label):
    """It comes before, with or after the gap of what it is to excuse."""
    car = Thing("7", texture(1, 60, 40), lambda k: np.array([200.0, 140, 260, 180]) + 0.5 * k, before(20))
    ghost = Thing("g", np.zeros((2, 2)), GHOST, lambda k: k >= ghost_from, label)
    ghost.paste = lambda image, k: None
    alerts, _, _ = watch([car, ghost], 40)
    assert [name for _, kind, name in alerts if kind == "obstacle_hiding"] == ["7"]
    assert alerts[0][0] - 20 < 9


def test_who_drives_up_and_covers_all_of_it_hides_an_object():
    """The same box again, but this time it takes the corners away."""
    far = Thing("far", texture(1, 60, 40), stand(200, 140, 260, 180), before(20))

    def drives(k):
        return np.array([150.0, 110.0, 330.0, 230.0]) + np.array([1.0, 0.0, 1.0, 0.0]) * max(
            0.0, 60.0 * (20 - k)
        )

    alerts, results, _ = watch([far, Thing("near", texture(2, 180, 120), drives)], 50)
    assert alerts == []
    assert "far is missing" in results[22]["hiding"].reason


def retold(name, off, told):
    """The same parked car, told of a little to the right."""
    return Thing(name, texture(1, 60, 40), stand(200, 140, 260, 180), told, off=off)


def test_who_comes_back_under_a_new_id_is_not_hidden():
    """As far off as the edges of this detector let it be: 5 px of 40 to 60, and 18 px besides."""
    cars = retold("7", 0.0, before(20)), retold("8", 18.0, lambda k: k > 22)
    assert watch(cars, 50, jitter=5.0)[0] == []


def test_a_box_beside_the_place_of_a_missing_object_is_another_ones():
    """Its corners keep their places: it is where they are, not 24 px beside."""
    cars = retold("7", 0.0, before(20)), retold("8", 24.0, lambda k: k > 22)
    assert ("obstacle_hiding", "7") in [alert[1:] for alert in watch(cars, 50)[0]]


@pytest.mark.parametrize("gap", [2, 4])
def test_a_part_of_an_object_that_is_told_of_under_a_new_id_hides_it_not(gap):
    cars = retold("7", 0.0, before(20)), retold("8", 0.0, lambda k: k >= 20 + gap)
    cars[1].off_px = np.array([0.0, 0.0, -33.0, 0.0])  # of 60
    assert watch(cars, 50)[0] == []


@pytest.mark.parametrize("grown", [0.0, 4.0])
def test_a_box_that_comes_up_once_takes_no_corners_away(grown):
    """Just before the car is hidden, a second box lies over it: without known corners it could vanish unseen."""
    car, box = Thing("7", texture(1, 60, 40), stand(200, 140, 260, 180), before(20)), [200, 140, 260, 180]
    left, top, right, bottom = box
    twin = Thing(
        "8", texture(1, 60, 40), stand(left - grown, top - grown, right + grown, bottom + grown), lambda k: k == 19
    )  # fmt: skip
    twin.paste = lambda image, k: None
    assert [alert[1:] for alert in watch([car, twin], 32)[0]] == [("obstacle_hiding", "7")]
