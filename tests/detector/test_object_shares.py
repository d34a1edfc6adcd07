"""Objects share the false alarms that all together may raise: what each is given adds up to what there is."""

from __future__ import annotations

import numpy as np

from belie.detector import Config
from belie.detector.object_shares import RATE_SHARE
from belie.detector.objects import ObjectStage
from belie.geometry import CameraModel
from belie.types import Detection, DetectionClaim, Frame

WIDTH, HEIGHT, FRAME_NS, RATE = 480, 320, 100_000_000, 0.1
MODEL = CameraModel(width=WIDTH, height=HEIGHT, fx=400, fy=400, cx=239.5, cy=159.5)
CHECKS = ("hiding", "misclassification")
BOXES = [[20.0, 140, 80, 180], [120, 130, 220, 200], [260, 150, 300, 180], [330, 100, 460, 220]]


def test_the_shares_of_those_that_may_be_accused_add_up_to_no_more_than_one():
    config, rng = Config(), np.random.default_rng(0)
    stage = ObjectStage(MODEL, config.objects, config.tracking, RATE)
    picture = rng.integers(40, 200, (HEIGHT, WIDTH)).astype(np.uint8)
    known: set[str] = set()
    sums = []
    for k, count in enumerate([2, 2, 2, 2, 2, 4, 4, 4, 4, 4, 4, 1, 1, 1]):
        told = tuple(
            Detection(label="car", score=0.9, track_id=str(i), box_px=np.array(box))
            for i, box in enumerate(BOXES[:count])
        )
        now = k * FRAME_NS
        claim = DetectionClaim(source="/detections", stamp_ns=now, received_ns=now, detections=told)
        stage.take((claim,), now)
        stage.update(Frame(camera="/image", stamp_ns=now, received_ns=now, image=picture))
        stream = stage.streams["/detections"]
        messages = 3600.0 / max(stream.interval_s, 1e-3)
        given = [
            messages / np.exp(stream.shares.threshold(check, track))
            for track in stream.tracks
            for check in CHECKS
            if track.name in known
        ]
        if known:
            sums.append((len(given) // 2, sum(given)))
        known = {t.name for t in stream.tracks if t.weight >= config.objects.established}
    share = sum(RATE_SHARE[check] for check in CHECKS)
    assert {count for count, _ in sums} >= {2, 4}
    assert all(total < 1.0001 * RATE * share for _, total in sums)
    assert max(total for _, total in sums) > 0.3 * RATE * share
