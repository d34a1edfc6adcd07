"""Objects on synthetic pixels: a textured patch moves over a textured background, and a detector tells of it."""

from __future__ import annotations

import numpy as np
import pytest
from object_tools import BLANK, FRAME_NS, HEIGHT, MODEL, SIDE, WIDTH, Scene

from belie.detector import Config
from belie.detector.alerts import AlertBook
from belie.detector.objects import ObjectStage
from belie.types import Detection, DetectionClaim, Frame, Status


def watch(scene, *, hidden=(), labels=None, ids=True, late=0, silent_from=None):
    """Judge a scene: alerts as (frame, type, object, onset frame), and all results frame by frame."""
    config = Config()
    stage, book = ObjectStage(MODEL, config.objects, config.tracking, 0.1), AlertBook()
    rng = np.random.default_rng(7)
    alerts, results, views = [], [], []
    for k in range(scene.frames):
        told = k - late
        claims = ()
        if told >= 0 and (silent_from is None or told < silent_from):
            box, detections = scene.box(told), ()
            if box is not None and told not in hidden:
                jittered = np.clip(box + rng.normal(0.0, 1.0, 4), 0.0, [WIDTH, HEIGHT, WIDTH, HEIGHT])
                label = (labels or {}).get(told, "car")
                detections = (
                    Detection(label=label, score=0.9, track_id="7" if ids else "", box_px=jittered),
                )
            claims = (
                DetectionClaim(
                    source="/detections", stamp_ns=told * FRAME_NS, received_ns=k * FRAME_NS, detections=detections
                ),
            )  # fmt: skip
        stage.take(claims, k * FRAME_NS)
        frame = Frame(camera="/image", stamp_ns=k * FRAME_NS, received_ns=k * FRAME_NS, image=scene.image(k))
        judgements = stage.update(frame)
        alerts += [
            (k, a.type.value, a.object, a.onset_ns // FRAME_NS)
            for a in book.raise_new(judgements, frame.stamp_ns)
        ]
        results.append({j.result.check: j.result for j in judgements})
        views.append(stage.views)
    for answers in results:
        for result in answers.values():
            assert result.statistic is None or np.isfinite(result.statistic)
            assert result.threshold is None or np.isfinite(result.threshold)
            assert "nan" not in result.reason
            assert result.reason
    return alerts, results, views


def test_an_honest_detector_is_believed():
    alerts, results, _ = watch(Scene())
    assert alerts == []
    for check in ("hiding", "misclassification"):
        assert {answers[check].status for answers in results[5:]} == {Status.CONSISTENT}
    # Without the camera's own motion, nobody can say that there is nothing behind a box.
    assert {answers["injection"].status for answers in results[5:]} == {Status.UNDECIDED}


@pytest.mark.parametrize("onset", [12, 20])
def test_a_hidden_object_is_named_within_six_messages(onset):
    alerts, results, _ = watch(Scene(), hidden=range(onset, onset + 12))
    assert [a[1:] for a in alerts] == [("obstacle_hiding", "7", onset)]
    assert alerts[0][0] - onset < 6
    reason = results[alerts[0][0]]["hiding"].reason
    assert reason.startswith("car 7 at [")
    assert results[onset + 13]["hiding"].status is Status.CONSISTENT


def test_a_box_with_nothing_in_it_is_not_hidden_when_it_goes(monkeypatch):
    monkeypatch.setattr("belie.detector.scene_witness.SceneWitness.evidence", lambda *_, **__: (None, 6.0))
    alerts, results, _ = watch(Scene(), hidden=range(20, 40))
    assert [a[1:3] for a in alerts] == [("obstacle_injection", "7")]
    lies = [k for k, answers in enumerate(results) if answers["injection"].status is Status.CONTRADICTED]
    assert lies == list(range(lies[0], 20))  # the last message that told of it
    patient = [k for k, answers in enumerate(results) if "is not told of" in answers["injection"].reason]
    assert patient == list(range(20, 25))


@pytest.mark.parametrize("hidden", [(15,), (15, 16), (12, 18, 19, 25, 30, 31)])
def test_flicker_is_no_attack(hidden):
    assert watch(Scene(), hidden=hidden)[0] == []


def test_leaving_the_view_is_no_attack():
    scene = Scene(50, speed=6.0, start=240.0)
    gone = next(k for k in range(50) if (box := scene.box(k)) is None or box[2] - box[0] < 0.65 * SIDE)
    assert gone < 40
    assert watch(scene, hidden=range(gone, 50))[0] == []


def test_occlusion_is_told_and_no_attack():
    scene = Scene(36, speed=1.0, start=150.0, cover=lambda k: max(150.0 + k - 10, 420.0 - 14.0 * k))
    covered = next(k for k in range(36) if scene.cover(k) < scene.start + scene.speed * k + 0.5 * SIDE)
    alerts, results, _ = watch(scene, hidden=range(covered, 36))
    assert alerts == []
    answers = [answers["hiding"] for answers in results[covered + 2 : covered + 8]]
    assert {a.status for a in answers} == {Status.CONSISTENT}
    assert any("occluded or gone" in a.reason for a in answers)


def test_a_car_called_bird_is_an_accusation():
    alerts, results, _ = watch(Scene(), labels=dict.fromkeys(range(15, 27), "bird"))
    assert [a[1:] for a in alerts] == [("object_misclassification", "7", 15)]
    assert alerts[0][0] - 15 < 6
    assert "is called bird" in results[alerts[0][0]]["misclassification"].reason


@pytest.mark.parametrize(
    "labels",
    [dict.fromkeys(range(15, 40), "van"), {15: "bird"}, {15: "bird", 24: "person"}],
    ids=["car to van", "one frame", "two apart"],
)
def test_label_noise_is_no_attack(labels):
    assert watch(Scene(), labels=labels)[0] == []


def test_a_detector_without_track_ids():
    alerts, _, _ = watch(Scene(), ids=False, hidden=range(20, 32))
    assert [a[1:] for a in alerts] == [("obstacle_hiding", "#1", 20)]
    assert watch(Scene(), ids=False)[0] == []


def test_late_messages_are_held_against_their_own_frames():
    assert watch(Scene(), late=3)[0] == []
    alerts, _, views = watch(Scene(), late=3, hidden=range(15, 27))
    assert [a[1:] for a in alerts] == [("obstacle_hiding", "7", 15)]
    assert alerts[0][0] - (15 + 3) < 6
    assert views[10][0].told_ns == 7 * FRAME_NS


def test_a_silent_detector_is_undecided_with_the_reason():
    alerts, results, _ = watch(Scene(), silent_from=15)
    assert alerts == []
    for check in ("hiding", "misclassification", "injection"):
        assert results[30][check].status is Status.UNDECIDED
        assert results[30][check].reason.startswith("no message for 1.")


def test_an_object_without_texture_is_undecided():
    alerts, results, _ = watch(Scene(patch=BLANK, speed=2.0), hidden=range(15, 35))
    assert alerts == []
    assert results[20]["hiding"].status is Status.UNDECIDED
    assert (
        "too few corners" in results[20]["hiding"].reason
        or "occluded or gone" in results[20]["hiding"].reason
    )


def test_views_tell_what_is_known_and_can_not_be_changed():
    scene = Scene()
    _, _, views = watch(scene, hidden=range(20, 30))
    ((before,), (during,)) = views[19], views[22]
    assert (before.source, before.name, before.label, before.status) == (
        "/detections",
        "7",
        "car",
        "reported",
    )
    assert before.detected_px is not None
    assert (during.status, during.detected_px) == ("missing", None)
    assert np.abs(during.box_px - scene.box(22)).max() < 6.0
    assert during.observed_px.shape == during.predicted_px.shape
    assert during.error_px2 is not None
    assert during.error_px2 < 2.0
    with pytest.raises(AttributeError):
        during.label = "bird"
    with pytest.raises(ValueError, match="read-only"):
        during.box_px[0] = 0.0


def test_an_image_that_is_doubted_judges_nobody():
    config = Config()
    stage = ObjectStage(MODEL, config.objects, config.tracking, 0.1)
    claim = DetectionClaim(source="/detections", stamp_ns=0, received_ns=0, detections=())
    stage.take((claim,), 0)
    frame = Frame(camera="/image", stamp_ns=0, received_ns=0, image=Scene().image(0))
    reasons = [j.result.reason for j in stage.update(frame, doubted="dark")]
    assert reasons == ["not judged: dark"] * 3
