"""What an alert tells of its object: its labels before and after, its track id and its box."""

from __future__ import annotations

import re

import numpy as np
import pytest
from object_tools import FRAME_NS, MODEL, Scene

from belie.detector import Config, Detector
from belie.geometry import SE3
from belie.types import Detection, DetectionClaim, Frame, MountedCamera

FROM = 15  # frame in which the lie begins


def first_alert(lie, profile="default"):
    """The first alert about an object as JSON, and the object's true box then; `lie`: its detection from `FROM` on."""
    scene = Scene(30)
    camera = MountedCamera(model=MODEL, T_body_cam=SE3.identity())
    detector = Detector({"/image": camera}, Config(profile=profile))
    for k in range(scene.frames):
        told = {"label": "car", "track_id": "7"} if k < FROM else lie
        detections = [] if told is None else [Detection(score=0.9, box_px=scene.box(k), **told)]
        ns = k * FRAME_NS
        claim = DetectionClaim(source="/d", stamp_ns=ns, received_ns=ns, detections=detections)
        frame = Frame(camera="/image", stamp_ns=ns, received_ns=ns, image=scene.image(k))
        if alerts := detector.update(frame, [claim]).to_json()["alerts"]:
            return alerts[0], scene.box(k)
    raise AssertionError("no alert")


@pytest.mark.parametrize("profile", ["default", "paper"])
@pytest.mark.parametrize(
    ("lie", "type", "after"),
    [
        (None, "obstacle_hiding", (None, None)),
        ({"label": "person", "track_id": "7"}, "object_misclassification", ("person", "7")),
    ],
)
def test_an_alert_tells_the_labels_before_and_after_and_the_box(profile, lie, type, after):
    alert, box = first_alert(lie, profile)
    assert (alert["type"], alert["object"], alert["label_before"]) == (type, "7", "car")
    assert (alert["label_after"], alert["id_after"]) == after
    np.testing.assert_allclose(alert["box_px"], box, atol=4.0)
    told_px = re.search(r"at \[(.*)\] px", alert["because"])
    np.testing.assert_allclose([float(edge) for edge in told_px[1].split(",")], alert["box_px"], atol=0.6)
