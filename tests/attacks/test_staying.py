"""Attacks that name no object are about one that stays in view."""

from dataclasses import replace

import numpy as np
import pytest

from belie.attacks import attack, choose_objects, staying_objects
from belie.attacks.timing import NS_PER_S
from belie.types import AttackError, Detection, DetectionClaim, Frame, Step

FRAMES = 80


class Road:
    """Objects as {track id: (first frame, last frame, side in px, left edge)}."""

    cameras, body_axes = {}, "flu"

    def __init__(self, every=1, **objects):
        self.objects, self.every, self.read = objects, every, -1

    def frame_stamps_ns(self):
        return np.arange(FRAMES) * NS_PER_S // 10

    def steps(self):
        places = {name: (*given, 10)[:4] for name, given in self.objects.items()}
        for k, t in enumerate(self.frame_stamps_ns().tolist()):
            self.read = max(k, self.read)
            told = tuple(
                Detection(label="car", score=0.9, track_id=name, box_px=[x, 10, x + side, 10 + side / 2])
                for name, (first, last, side, x) in places.items()
                if first <= k <= last
            )
            frame = Frame(camera="/image", stamp_ns=t, received_ns=t, image=np.zeros((4, 6), np.uint8))
            claim = DetectionClaim(source="/d", stamp_ns=t, received_ns=t, detections=told)
            yield Step(frame=frame, claims=(claim,) if k % self.every == 0 else ())


def chosen(road, *specs, least_px=0.0):
    return [choice.spec.to_text() for choice in choose_objects(road, specs, least_px=least_px)]


PASSING = {"passing": (20, 45, 200), "ahead": (0, 79, 60), "far": (0, 79, 20)}


def test_the_largest_that_stays_is_chosen_not_the_largest_that_passes():
    road = Road(**PASSING)
    ((ahead,),) = [choice.objects for choice in choose_objects(road, ["detections-hide:start=40,stop=60"])]
    assert (ahead.track_id, ahead.label, ahead.size_px) == ("ahead", "car", (60, 30))
    assert (ahead.first_frame, ahead.last_frame) == (0, 64)
    assert road.read == 64  # the rest of a long recording is not waited for
    assert attack(road, "detections-hide:start=40,stop=60").labels[0].object == "passing"


def test_it_stays_until_the_attack_is_over_if_any_does():
    road = Road(**PASSING, leaving=(0, 66, 90))
    assert chosen(road, "detections-hide:start=40,stop=60") == [
        "detections-hide:object=leaving,start=40,stop=60"
    ]
    assert chosen(road, "detections-hide:start=40") == ["detections-hide:object=ahead,start=40"]
    only = Road(leaving=(0, 66, 90))
    assert chosen(only, "detections-hide:start=40") == ["detections-hide:object=leaving,start=40"]


def test_where_none_stays_so_long_ten_frames_are_enough():
    road = Road(passing=(20, 45, 200), leaving=(0, 52, 90))
    assert chosen(road, "detections-hide:start=40,stop=60") == [
        "detections-hide:object=leaving,start=40,stop=60"
    ]
    late = Road(passing=(20, 71, 200), ahead=(0, 79, 60))  # as far as the recording tells
    assert chosen(late, "detections-hide:start=70") == ["detections-hide:object=ahead,start=70"]


def test_a_slow_detector_tells_of_what_stays_now_and_then():
    slow = Road(every=11, **PASSING)
    assert chosen(slow, "detections-hide:start=40,stop=60") == [
        "detections-hide:object=ahead,start=40,stop=60"
    ]


def test_where_none_stays_it_is_said():
    road = Road(passing=(20, 45, 200), small=(0, 79, 20))
    (choice,) = choose_objects(road, ["paper-hiding:start=40"], least_px=24.0)
    assert choice.lacks
    assert choice.spec.to_text() == "paper-hiding:start=40"
    assert staying_objects(Road(), 40) == []


def test_what_is_said_is_kept_and_what_needs_no_object_is_left():
    specs = ["odometry-freeze:start=40", "detections-hide:object=far,start=40", "detections-delay:start=40"]
    specs.append("detections-phantom:start=40")
    assert chosen(Road(**PASSING), *specs) == specs


def test_a_swap_takes_two_that_stay_and_attacks_that_follow_what_is_left():
    road = Road(**PASSING)
    beside = Road(**PASSING, beside=(0, 79, 40, 60), aside=(0, 79, 30, 200))
    assert chosen(beside, "detections-swap:start=40,stop=60") == [
        "detections-swap:other=aside,object=ahead,start=40,stop=60"
    ]
    assert chosen(road, "detections-swap:start=40,stop=60") == [
        "detections-swap:object=ahead,start=40,stop=60"
    ]
    assert chosen(road, "detections-swap:other=ahead,start=40,stop=60") == [
        "detections-swap:other=ahead,object=far,start=40,stop=60"
    ]
    both = chosen(road, "detections-hide:start=40,stop=60", "detections-relabel:start=40,stop=60")
    assert [text.partition(",")[0] for text in both] == [
        "detections-hide:object=ahead",
        "detections-relabel:object=far",
    ]
    # To call a car a car would be no lie.
    (choice,) = choose_objects(road, ["detections-relabel:to=car,start=40"])
    assert choice.lacks


def test_a_wrong_start_is_an_error():
    with pytest.raises(AttackError, match="the recording has 80 frames"):
        choose_objects(Road(), ["detections-hide:start=90"])


def test_an_object_that_leaves_is_not_said_to_stay():
    road = Road(passing=(20, 45, 200), leaving=(0, 52, 90))
    (left,) = choose_objects(road, ["detections-hide:start=40,stop=60"])
    assert (left.stays, left.objects[0].last_frame) == (False, 52)
    (ahead,) = choose_objects(Road(**PASSING), ["detections-hide:start=40,stop=60"])
    assert (ahead.stays, ahead.objects[0].last_frame) == (True, 64)


def test_what_is_told_of_only_before_the_attack_is_not_chosen():
    class Ends(Road):
        """A detector that falls silent at frame 40."""

        def steps(self):
            for k, step in enumerate(super().steps()):
                yield step if k < 40 else replace(step, claims=())

    (choice,) = choose_objects(Ends(**PASSING), ["detections-hide:start=40"])
    assert choice.lacks
    assert choice.objects == ()
