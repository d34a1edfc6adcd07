"""Films of accused objects: what is kept, which pictures are shown, and where boxes are drawn."""

import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from belie.attacks import AttackLabel
from belie.checks.objects import ObjectSettings
from belie.detector import ObjectView
from belie.evaluation.attacked_objects import AttackedObjects
from belie.evaluation.film import SIDE_PX, FilmRecorder
from belie.evaluation.film_figure import _raised_and_end, film_content
from belie.evaluation.followed import ObjectFollower, accused
from belie.evaluation.report import render_report
from belie.evaluation.report_words import alert_row, headline, why_missed
from belie.evaluation.run import run_detector
from belie.evaluation.score import RaisedAlert
from belie.evaluation.traced_alert import TracedAlert
from belie.geometry import SE3, CameraModel
from belie.types import (
    Alert,
    AlertType,
    CheckResult,
    Detection,
    DetectionClaim,
    Frame,
    MountedCamera,
    Settings,
    Status,
    Verdict,
)

FRAME_NS = 100_000_000
CAMERA = CameraModel(width=160, height=120, fx=100, fy=100, cx=79.5, cy=59.5)
CAMERAS = {"/image": MountedCamera(model=CAMERA, T_body_cam=SE3.identity())}
HERE, THERE = np.array([42.0, 30.0, 80.0, 50.0]), np.array([110.0, 30.0, 150.0, 50.0])
START_NS = 1_700_000_000_000_000_000
IMAGE = np.random.default_rng(0).integers(0, 256, (120, 160), dtype=np.uint8)


def view(k, name="7", *, told=None, **fields):
    """An object of 40 x 20 px; told of in the frame `told`."""
    px = np.array([[50.0, 40.0], [70.0, 50.0]])
    given = {
        "source": "/detections", "name": name, "label": "car", "told_label": "car", "misnamed": False,
        "box_px": np.array([40.0, 30.0, 80.0, 50.0]),
        "detected_px": None if told is None else np.array([42.0, 30.0, 80.0, 50.0]),
        "told_ns": START_NS + (k if told is None else told) * FRAME_NS, "predicted_px": px + 1.0,
        "observed_px": px, "error_px2": 0.3, "status": "missing" if told is None else "reported",
        "number": int(name), "told_id": "" if told is None else name, "met_ns": START_NS,
    }  # fmt: skip
    return ObjectView(**(given | fields))


def message(stamp_ns, boxes):
    found = tuple(Detection(label="car", score=0.9, track_id=name, box_px=box) for name, box in boxes.items())
    return DetectionClaim(source="/detections", stamp_ns=stamp_ns, received_ns=stamp_ns, detections=found)


def filmed(frames, views, onset, raised, kind=AlertType.OBSTACLE_HIDING, told=None):
    """Films of object 7, with an alert in each frame of `raised`; `told`: the boxes by id of the message at a frame."""
    recorder, follower = FilmRecorder(), ObjectFollower(CAMERAS)
    for k in range(frames):
        stamp_ns = START_NS + k * FRAME_NS
        alert = Alert(type=kind, source="/detections", onset_ns=START_NS + onset * FRAME_NS, object="7")
        verdict = Verdict(
            frame=k, stamp_ns=stamp_ns, status=Status.CONSISTENT, latency_ms=1.0,
            alerts=(alert,) if k in np.atleast_1d(raised) else (),
        )  # fmt: skip
        frame = Frame(camera="/image", stamp_ns=stamp_ns, received_ns=stamp_ns, image=IMAGE)
        claim = message(stamp_ns, told(k) if told else {})
        recorder.add(frame, follower.add(frame, (claim,), views(k)), verdict)
    return recorder.finish()


def hidden(k):
    return (view(k, told=None if 20 <= k < 30 else k), view(k, name="8", told=k))


def test_a_film_goes_from_before_the_lie_until_after_the_alert():
    (film,) = filmed(60, hidden, onset=20, raised=24)
    assert [(role, shot.number) for role, shot in film.strip()] == [
        ("before", 15), ("before", 19), ("lie begins", 20), ("during", 22), ("alert", 24), ("after", 36),
    ]  # fmt: skip
    stamps = [shot.stamp_ns for shot in film.shots]
    assert stamps == sorted(set(stamps))
    assert len(stamps) <= 45


def test_boxes_and_corners_lie_where_they_are_in_the_picture():
    (film,) = filmed(30, hidden, onset=20, raised=24)
    shot = film.shots[0]
    width = 40.0 * shot.scale
    np.testing.assert_allclose(shot.box[[0, 2]], [SIDE_PX / 2 - width / 2, SIDE_PX / 2 + width / 2])
    np.testing.assert_allclose(shot.detected[0] - shot.box[0], 2.0 * shot.scale)
    np.testing.assert_allclose(
        shot.observed[0], (np.array([50.5, 40.5]) - [60.0, 40.0]) * shot.scale + SIDE_PX / 2
    )
    assert shot.picture.shape == (SIDE_PX, SIDE_PX)


def test_a_late_message_is_drawn_in_the_picture_that_it_speaks_of():
    (film,) = filmed(30, lambda k: (view(k, told=k - 3),), onset=20, raised=24)
    told = [shot.status for shot in film.shots]
    assert told[0] == "reported"
    assert told[-4:] == ["reported", "not told", "not told", "not told"]


def test_an_object_that_is_lost_ends_its_film():
    (film,) = filmed(60, lambda k: (view(k, told=k),) if k < 26 else (), onset=20, raised=24)
    assert film.shots[-1].number == 25
    assert [role for role, _ in film.strip()][-2:] == ["alert", "after"]


def test_an_alert_without_an_object_in_view_has_no_film():
    assert filmed(30, lambda k: (), onset=20, raised=24) == ()


def shifted(k):
    """Car 7 where it is; from frame 20 to 30 the detector tells of it at another place, which then gets a view, too."""
    if k < 20:
        return (view(k, told=k),)
    place = {
        "box_px": THERE,
        "detected_px": THERE if k < 30 else None,
        "number": 9,
        "met_ns": START_NS + 20 * FRAME_NS,
    }
    return (
        view(k, told=None if k < 30 else k),
        view(k, told=k if k < 30 else None, status="reported" if k < 30 else "missing", **place),
    )


def told_shifted(k):
    return {"7": THERE if 20 <= k < 30 else HERE}


def test_a_shifted_object_is_shown_where_it_is_and_where_it_is_told():
    (film,) = filmed(60, shifted, onset=20, raised=24, told=told_shifted)
    shot = film.shots[-1]
    assert [s.number for s in film.shots] == list(range(37))
    at_alert = next(s for s in film.shots if s.number == 24)
    assert at_alert.status == "missing"
    np.testing.assert_allclose(at_alert.box_px, [40.0, 30.0, 80.0, 50.0])
    np.testing.assert_allclose(film.elsewhere_px(at_alert), THERE)
    assert shot.told_id == "7"
    assert film.elsewhere_px(shot) is None


def test_every_alert_has_a_film_though_both_name_one_object(made_run):
    films = filmed(60, shifted, onset=20, raised=(24, 34), told=told_shifted)
    assert [film.raised_ns for film in films] == [START_NS + k * FRAME_NS for k in (24, 34)]
    np.testing.assert_allclose(films[1].shots[-1].box_px, THERE)
    run = made_run(60)
    content = [film_content(run, film, k) for k, film in enumerate(films)]
    assert "reports car 7, 70 px right of it, at [110, 30, 150, 50] px" in content[0]["words"]
    assert content[0]["shots"][4]["told"] == "reported 70 px right"
    assert content[0]["shots"][4]["arrow"] is not None
    assert content[0]["shots"][0]["elsewhere"] is None


def test_an_alert_means_the_object_of_its_name_that_is_lied_about():
    follower = ObjectFollower(CAMERAS)
    frame = Frame(camera="/image", stamp_ns=START_NS, received_ns=START_NS, image=IMAGE)
    objects = follower.add(frame, (), shifted(24))

    def meant(kind):
        alert = Alert(type=kind, source="/detections", onset_ns=START_NS, object="7")
        return objects.index(accused(objects, alert))

    assert meant(AlertType.OBSTACLE_HIDING) == 0
    assert meant(AlertType.OBSTACLE_INJECTION) == 1


def test_a_swap_names_the_ids_and_stays_with_its_object(made_run):
    far = np.array([112.0, 30.0, 150.0, 50.0])

    def views(k):
        named = {"misnamed": k < 30, "is_swapped": k < 30} if k >= 20 else {}
        names = ("7", "8") if k < 30 else ("8", "7")  # when the lie is believed
        return (
            view(k, names[0], told=k, number=7, told_id="7" if k < 20 else "8", **named),
            view(
                k,
                names[1],
                told=k,
                number=8,
                told_id="8" if k < 20 else "7",
                box_px=far,
                detected_px=far,
                **named,
            ),
        )

    (film,) = filmed(
        60, views, onset=20, raised=24, kind=AlertType.OBJECT_MISCLASSIFICATION,
        told=lambda k: {"7": HERE, "8": far} if k < 20 else {"7": far, "8": HERE},
    )  # fmt: skip
    assert film.shots[-1].number == 36
    assert all(shot.box_px[0] == 40.0 for shot in film.shots)
    raised = RaisedAlert(frame=24, stamp_ns=film.raised_ns, alert=film.alert)
    alert = TracedAlert(raised=raised, check="", reason="", end_ns=film.raised_ns, label="car")
    run = replace(made_run(60), films=(film,), alerts=(alert,))
    assert headline(run).startswith("/detections gives car 7 another's track id, 8: from about 2.0 s on")
    assert alert_row(run, alert)["object"] == "car 7, called id 8"
    content = film_content(made_run(60), film, 0)
    assert content["title"].startswith("Misclassified: car 7, called id 8, by /detections")
    assert "gives it the track id 8, while it reports car 7, 71 px right of it" in content["words"]
    assert "corners were followed from 0.00 s to 3.60 s" in content["words"]
    assert [shot["told"] for shot in content["shots"]] == ["reported as car 7"] * 2 + [
        "reported as car 8"
    ] * 4
    assert [shot["is_wrong"] for shot in content["shots"]] == [False, False, True, True, True, True]


def test_the_last_picture_is_one_in_which_the_object_can_be_seen():
    def leaving(k):
        box = np.array([40.0, 30.0, 80.0, 50.0]) + (max(0, k - 24) * 12.0, 0.0) * 2
        return (view(k, told=None, box_px=box),)

    (film,) = filmed(60, leaving, onset=20, raised=24)
    (*_, (role, shot)) = film.strip()
    assert (role, shot.number) == ("after", 32)
    assert shot.in_view >= 0.5


def test_a_slow_detector_is_shown_in_the_frames_that_it_tells_of():
    def every_third(k):
        if k % 3:
            return (view(k, status="not told"),)
        return (view(k, told=None if 20 <= k < 30 else k),)

    (film,) = filmed(60, every_third, onset=21, raised=27)
    assert [(role, shot.number) for role, shot in film.strip()] == [
        ("before", 15), ("before", 18), ("lie begins", 21), ("during", 24), ("alert", 27), ("after", 39),
    ]  # fmt: skip
    _, (film,) = attacked(60, every_third)
    assert [(role, shot.number) for role, shot in film.strip()] == [
        ("before", 15), ("before", 18), ("attack begins", 21), ("attacked", 24), ("attacked", 27), ("attack over", 33),
    ]  # fmt: skip


def test_the_picture_of_the_alert_is_one_that_a_message_tells_of(made_run):
    def every_third_a_frame_late(k):
        if k % 3 != 1:
            return (view(k, status="not told"),)
        return (view(k, told=k - 1, misnamed=k > 20, told_label="bird" if k > 20 else "car"),)

    (film,) = filmed(
        60, every_third_a_frame_late, onset=21, raised=28, kind=AlertType.OBJECT_MISCLASSIFICATION
    )
    (shot,) = [shot for role, shot in film.strip() if role == "alert"]
    assert shot is film.alert_shot
    assert (shot.number, shot.status, shot.told_label) == (27, "reported", "bird")
    (told,) = [s for s in film_content(made_run(60), film, 0)["shots"] if "alert (" in s["when"]]
    assert told["when"] == "2.70 s: alert (at 2.80 s)"
    assert told["told"] == "reported as bird"


def attacked(frames, views, checks=(), kind=AlertType.OBSTACLE_HIDING, told=None, other=None):
    """Films of object 7, which a label says is attacked in frames 20 to 30."""
    label = AttackLabel(
        name="detections-hide", text="detections-hide:start=20,stop=30", stream="detections", sources=("/detections",),
        alert=kind, start_frame=20, stop_frame=30, start_ns=START_NS + 20 * FRAME_NS, seed=0, object="7", other=other,
        onset_ns=START_NS + 20 * FRAME_NS, end_ns=START_NS + 30 * FRAME_NS,
    )  # fmt: skip
    films, objects, follower = (
        FilmRecorder(),
        AttackedObjects([label], ObjectSettings()),
        ObjectFollower(CAMERAS),
    )
    for k in range(frames):
        stamp_ns = START_NS + k * FRAME_NS
        frame = Frame(camera="/image", stamp_ns=stamp_ns, received_ns=stamp_ns, image=IMAGE)
        verdict = Verdict(frame=k, stamp_ns=stamp_ns, status=Status.CONSISTENT, latency_ms=1.0, checks=checks)
        followed = follower.add(frame, (message(stamp_ns, told(k) if told else {}),), views(k))
        films.add(frame, followed, verdict)
        objects.add(frame, followed, verdict, films.past)
    return label, objects.finish()


def test_an_attacked_object_without_an_alert_is_shown_and_why(made_run):
    unsure = CheckResult(
        check="hiding", source="/detections", status=Status.UNDECIDED, statistic=3.0, threshold=12.0,
        object="7", reason="car 7 is missing: too few corners on it: 2",
    )  # fmt: skip
    label, films = attacked(60, hidden, (unsure,))
    assert [(role, shot.number) for role, shot in films[0].strip()] == [
        ("before", 15), ("before", 19), ("attack begins", 20), ("attacked", 25), ("attacked", 29), ("attack over", 35),
    ]  # fmt: skip
    page = render_report(replace(made_run(60), attacked=films), labels=[label])
    text = " ".join(re.sub(r"<[^>]+>", " ", page).split())
    assert "The attacked objects that raised no alert" in text
    assert "Missed: detections-hide on car 7, by /detections" in text
    assert "the evidence came to 25% of what an alarm takes" in text
    assert "in 10 of 10 frames the check said: car 7 is missing: too few corners on it: 2." in text
    assert "/detections car 7 2.00 to 3.00 s missed" in text
    assert "no picture" not in text


def test_a_doubt_about_another_object_is_no_reason():
    other = CheckResult(
        check="hiding", source="/detections", status=Status.UNDECIDED, reason="car 8 is missing: fading"
    )
    silent = replace(other, reason="no message for 0.7 s")
    assert attacked(60, hidden, (other,))[1][0].why == (
        "in 10 of 10 frames its pixels could not vouch for it: told of too seldom or unsurely"
    )
    assert (
        attacked(60, hidden, (silent,))[1][0].why == "in 10 of 10 frames the check said: no message for 0.7 s"
    )


def test_why_the_pixels_of_a_renamed_object_do_not_tell():
    unsure = CheckResult(
        check="misclassification", source="/detections", status=Status.UNDECIDED, statistic=12.0, threshold=12.0,
        object="7", reason="car 7 is called bird in 5 of the last 5 messages: its pixels do not tell whether it is "
        "the same object",
    )  # fmt: skip

    def renamed(k):
        lie = {"misnamed": True, "told_label": "bird", "is_established": True} if 20 <= k < 30 else {}
        return (view(k, told=k, **lie),)

    _, (film,) = attacked(60, renamed, (unsure,), kind=AlertType.OBJECT_MISCLASSIFICATION)
    assert "the check said: car 7 is called bird in 5 of the last 5 messages: its pixels do not" in film.why
    assert film.why.endswith("could not vouch for it: fewer than 4 corners that move with it")


def test_a_missed_swap_names_both(made_run):
    label, films = attacked(60, lambda k: (view(k, told=k),), other="3")
    page = render_report(replace(made_run(60), attacked=films), labels=[label])
    text = " ".join(re.sub(r"<[^>]+>", " ", page).split())
    assert "/detections car 7 and 3 2.00 to 3.00 s missed" in text
    assert "Missed: detections-hide on car 7 and 3, by /detections" in text


def test_the_lie_is_shaded_no_longer_than_the_alert_lasted(made_run):
    (film,) = filmed(60, lambda k: (view(k, told=k if k < 20 else None),), onset=20, raised=24)
    raised = RaisedAlert(frame=24, stamp_ns=film.raised_ns, alert=film.alert)
    end_ns = START_NS + 28 * FRAME_NS
    alert = TracedAlert(raised=raised, check="hiding", reason="", end_ns=end_ns, label="car")
    run = made_run(60)
    assert _raised_and_end(run, film)[1] == pytest.approx(3.6)  # where its film ends
    assert _raised_and_end(replace(run, alerts=(alert,)), film)[1] == pytest.approx(2.8)
    label, _ = attacked(1, hidden)
    assert film_content(run, film, 0, [label])["is_labelled"]
    assert not film_content(run, film, 0, [replace(label, object="8")])["is_labelled"]


def test_a_run_films_the_objects_of_its_labels(made):
    class Seeing(made.Detector):
        def update(self, frame, claims):
            verdict = super().update(frame, claims)
            self.objects = (view(verdict.frame, told=verdict.frame),)
            return verdict

    label, _ = attacked(1, hidden)
    run = run_detector(made.Recording(60), Settings(), detector=Seeing(), labels=[label])
    assert [film.attack for film in run.attacked] == [label]
    assert run_detector(made.Recording(60), Settings(), detector=Seeing()).attacked == ()


def test_an_attacked_object_that_is_lost_is_shown_where_it_was_last():
    def leaves(k):
        return (view(k, told=k, box_px=np.array([150.0, 30.0, 190.0, 50.0])),) if k < 20 else ()

    _, (film,) = attacked(60, leaves)
    assert (
        film.why
        == "belie no longer followed car 7 when it was attacked: 25% of its box was left in the picture"
    )
    assert [shot.status for _, shot in film.strip()] == ["reported"] * 2 + ["no longer followed"] * 4


def test_an_attack_that_leaves_the_object_what_it_was_says_so():
    told = {"told": 0, "told_label": "truck"}
    _, (film,) = attacked(60, lambda k: (view(k, **told),), kind=AlertType.OBJECT_MISCLASSIFICATION)
    assert film.why == "it was called truck, which counts as one kind of thing with car"
    _, (film,) = attacked(
        60, lambda k: (view(k, "8" if 20 <= k < 30 else "7", told=k, number=7),),
        kind=AlertType.OBJECT_MISCLASSIFICATION, told=lambda k: {"8" if 20 <= k < 30 else "7": HERE},
    )  # fmt: skip
    assert film.why == "its box was told under the track id 8, which was taken for a new name of it"
    assert film.is_swapped
    _, (film,) = attacked(60, lambda k: (view(k, told=k),))
    assert film.why.startswith("in 10 of the 10 attacked frames the box reported near it was taken for it")


def test_a_missed_attack_without_an_object_is_told(made_run):
    label, films = attacked(60, lambda k: ())
    assert films == ()
    page = render_report(made_run(60), labels=[label, replace(label, object=None)])
    assert "no picture, as belie did not follow object 7" in page
    assert "no picture, as its label names no object" in page


def test_a_phantom_that_cannot_be_told_from_what_is_behind_it_says_so_itself():
    """The check says that of all boxes together, and only where no other box tells anything."""
    of_all = CheckResult(
        check="injection", source="/detections", status=Status.UNDECIDED,
        reason="no box can be told from what is behind it: no ground is seen",
    )  # fmt: skip

    def phantom(k):
        return (view(k, told=k, unseen="its corners cannot be told from the ground" if k < 28 else ""),)

    _, (film,) = attacked(60, phantom, (of_all,), kind=AlertType.OBSTACLE_INJECTION)
    assert film.why == (
        "in 8 of 10 frames its pixels could not be told from what is behind it: "
        "its corners cannot be told from the ground"
    )


def test_a_missed_attack_on_an_object_without_an_id_says_what_the_check_said(made_run):
    label, _ = attacked(60, lambda k: ())
    run = made_run(60)
    unsure = replace(
        run.trace.checks[0], check="hiding", source="/detections", undecided=Counter({"too few": 7})
    )
    run = replace(run, trace=replace(run.trace, checks=(unsure,)))
    said = why_missed(run, replace(label, object=None))
    assert said.endswith("; in 7 frames of the whole run the check said: too few")


def test_the_page_shows_a_film_of_each_kind(made_run):
    run = made_run(60)
    films = tuple(
        film
        for kind in (AlertType.OBSTACLE_HIDING, AlertType.OBSTACLE_INJECTION)
        for film in filmed(60, hidden, onset=20, raised=24, kind=kind)
    )
    films += filmed(
        60, lambda k: (view(k, told=k, misnamed=20 <= k < 30, told_label="bird" if 20 <= k < 30 else "car"),),
        onset=20, raised=24, kind=AlertType.OBJECT_MISCLASSIFICATION,
    )  # fmt: skip
    page = render_report(replace(run, films=films))
    text = " ".join(re.sub(r"<[^>]+>", " ", page).split())
    assert "Hidden: car 7, by /detections" in text
    assert "Invented: car 7, by /detections" in text
    assert "from 2.00 s on it calls it bird" in text
    assert "2.40 s: alert reported as bird" in text
    assert "3.60 s: after the alert" in text
    ids = re.findall(r' id="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert "nan" not in re.sub(r"base64,[^\"]+", "", page)
    shots = film_content(run, films[0], 0)["shots"]
    assert [shot["is_wrong"] for shot in shots] == [False, False, True, True, True, False]
