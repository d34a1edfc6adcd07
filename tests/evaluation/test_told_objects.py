"""What detectors told: counts, labels, and which objects nothing could be said of."""

from dataclasses import replace

import numpy as np
import pytest

from belie.checks.objects import ObjectSettings
from belie.checks.objects.class_groups import ClassGroups
from belie.detector import ObjectView
from belie.evaluation.told_objects import ToldObjectsRecorder
from belie.types import Detection, DetectionClaim

SIZE = (640, 480)


def view(name, box_px=(100, 100, 160, 140), corners=9, status="reported", established=True):
    corners_px = np.zeros((corners, 2))
    return ObjectView(
        source="/d", name=name, label="car", told_label="car", misnamed=False, box_px=np.array(box_px, float),
        detected_px=None, told_ns=0, predicted_px=corners_px, observed_px=corners_px, error_px2=None, status=status,
        number=int(name), is_established=established,
    )  # fmt: skip


def told(*frames, settings=None):
    recorder = ToldObjectsRecorder(settings or ObjectSettings())
    for stamp_ns, views in enumerate(frames):
        recorder.see(views, SIZE, stamp_ns)
    (found,) = recorder.finish()
    return found


def test_an_object_that_can_be_judged_once_is_judged():
    found = told(*[[view("1")]] * 3, [view("1", corners=0)])
    assert (found.objects, found.unjudged) == (1, {})


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"box_px": (100, 100, 120, 110)}, "smaller than 24 px"),
        ({"box_px": (-60, 100, 60, 160)}, "less than 70% of it in the image"),
        ({"corners": 3}, "fewer than 4 corners that move with it"),
        ({"established": False}, "told of too seldom or unsurely"),
    ],
)
def test_an_object_that_never_can_be_says_why(changes, why):
    found = told(*[[view("1"), view("2", **changes)]] * 3)
    assert (found.objects, found.unjudged) == (2, {why: 1})
    assert found.in_words().endswith(f"2 objects; 1 could be judged, 1 never (mainly: {why})")


def test_where_an_object_could_not_be_judged_is_told():
    leaving = view("1", box_px=(-60, 100, 60, 160), status="missing")
    new = [view("1", established=False), view("2", established=False)]
    found = told(
        new, new, *[[view("1"), view("2")]] * 2, [leaving, view("2")], [view("1", status="not told")]
    )
    # Each is asked of once it is established; frames without a message do not count.
    assert (found.asked, found.unjudged, found.withheld) == (6, {}, {"less than 70% of it in the image": 1})
    assert found.in_words().endswith(
        "2 could be judged but for 17% of their messages (mainly: less than 70% of it in the image)"
    )


def test_what_came_as_something_known_is_no_label_without_a_group():
    recorder = ToldObjectsRecorder()
    for stamp_ns, label in enumerate(("car", "bird", "bird")):  # an attack, not a class that was forgotten
        boxes = [("7", label), ("8", "Wombat"), ("", "traffic light")]
        detections = tuple(
            Detection(label=name, score=1.0, track_id=track_id, box_px=[0, 0, 9, 9])
            for track_id, name in boxes
        )
        at = {"stamp_ns": stamp_ns, "received_ns": stamp_ns}
        recorder.hear([DetectionClaim(source="/d", detections=detections, **at)])
    (found,) = recorder.finish()
    assert (found.messages, found.boxes, found.labels["car"], found.labels["bird"]) == (3, 9, 1, 2)
    assert found.ungrouped(ClassGroups()) == {"Wombat": 3}
    assert found.unjudged is None


def test_boxes_are_counted_under_the_labels_that_messages_give():
    recorder = ToldObjectsRecorder()
    for stamp_ns, label in enumerate(("bird", "bird", "car", "car", "car")):
        car = Detection(label=label, score=1.0, track_id="7", box_px=[0, 0, 9, 9])
        at = {"stamp_ns": stamp_ns, "received_ns": stamp_ns}
        recorder.hear([DetectionClaim(source="/d", detections=(car,), **at)])
    (found,) = recorder.finish()
    assert found.ungrouped(ClassGroups()) == {"bird": 2}


def test_an_object_under_running_ids_is_one():
    new = [replace(view("1", established=False), name=str(k)) for k in range(9)]
    found = told(*[[each] for each in new], [view("1")])
    assert (found.objects, found.unjudged) == (1, {})


def test_boxes_of_which_none_was_followed_are_no_silent_pass():
    car = Detection(label="car", score=0.9, track_id="7", box_px=[5, 5, 6, 6])
    recorder = ToldObjectsRecorder(ObjectSettings())
    recorder.hear([DetectionClaim(source="/d", stamp_ns=0, received_ns=0, detections=(car,))])
    (found,) = recorder.finish()
    assert found.is_unchecked
    assert found.in_words().startswith(
        "/d: 1 messages, 1 boxes, 0 objects: no box could be followed, so none was checked"
    )
    assert not replace(found, boxes=0).is_unchecked
    assert not replace(found, unjudged=None).is_unchecked  # the paper's profile keeps no objects
