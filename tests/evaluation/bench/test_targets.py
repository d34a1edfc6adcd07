"""Attacks on objects are about one that stays."""

import numpy as np
import pytest

from belie.evaluation.bench.cases import AttackCase
from belie.evaluation.bench.memory import MemoryRecording
from belie.evaluation.bench.targets import targeted
from belie.types import AttackError, Detection, DetectionClaim, Frame, Step


def recording(objects):
    """Objects as {track id: (first frame, last frame, side in px)}."""
    steps = []
    for k in range(80):
        at = {"stamp_ns": k * 10**8, "received_ns": k * 10**8}
        told = tuple(
            Detection(
                label="car", score=0.9, track_id=name, box_px=np.array([10.0, 10, 10 + side, 10 + side])
            )
            for name, (first, last, side) in objects.items()
            if first <= k <= last
        )
        frame = Frame(camera="/image", image=np.zeros((4, 6), np.uint8), **at)
        steps.append(Step(frame=frame, claims=(DetectionClaim(source="/d", detections=told, **at),)))
    return MemoryRecording(name="made", cameras={}, joined=tuple(steps))


HIDE = AttackCase(family="f", goal="OH", spec="paper-hiding:start=40", onset=40, target="staying")


def test_the_largest_that_stays_is_chosen_not_the_largest_that_passes():
    made = recording({"passing": (20, 45, 200), "ahead": (0, 79, 60), "far": (0, 79, 20)})
    assert targeted(made, HIDE) == "paper-hiding:start=40,object=ahead"


def test_where_none_stays_there_is_no_attack():
    with pytest.raises(AttackError, match="no object stays in view around frame 40"):
        targeted(recording({"passing": (20, 45, 200), "new": (38, 79, 90)}), HIDE)
