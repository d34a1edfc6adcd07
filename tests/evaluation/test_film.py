"""Films of accused objects: what is kept, which pictures are shown, and where boxes are drawn."""

import re
from dataclasses import replace

import numpy as np

from belie.detector import ObjectView
from belie.evaluation.film import SIDE_PX, FilmRecorder
from belie.evaluation.film_figure import film_content
from belie.evaluation.report import render_report
from belie.types import Alert, AlertType, Frame, Status, Verdict

FRAME_NS = 100_000_000
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
    }  # fmt: skip
    return ObjectView(**(given | fields))


def filmed(frames, views, onset, raised, kind=AlertType.OBSTACLE_HIDING):
    recorder = FilmRecorder()
    for k in range(frames):
        stamp_ns = START_NS + k * FRAME_NS
        alert = Alert(type=kind, source="/detections", onset_ns=START_NS + onset * FRAME_NS, object="7")
        verdict = Verdict(
            frame=k, stamp_ns=stamp_ns, status=Status.CONSISTENT, latency_ms=1.0,
            alerts=(alert,) if k == raised else (),
        )  # fmt: skip
        frame = Frame(camera="/image", stamp_ns=stamp_ns, received_ns=stamp_ns, image=IMAGE)
        recorder.add(frame, views(k), verdict)
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
    ids = re.findall(r' id="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert "nan" not in re.sub(r"base64,[^\"]+", "", page)
    shots = film_content(run, films[0], 0)["shots"]
    assert [shot["is_wrong"] for shot in shots] == [False, False, True, True, True, False]
