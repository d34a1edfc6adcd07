"""What the report shows of an accused object: its film strip, and how its pixels held together (figures 5c, 5d)."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from typing import Any

import cv2
import numpy as np

from belie.attacks import AttackLabel
from belie.evaluation import report_words as words
from belie.evaluation.figures import ALERT, LABEL, QUIET, SEEN, svg
from belie.evaluation.film import LOST, SIDE_PX, Film, Role, Shot
from belie.evaluation.run import Run
from belie.geometry import FloatArray
from belie.geometry.boxes import where_px
from belie.types import AlertType

_GAP_PX = 10
_MOST_SHOTS = 6  # of `Film.strip`: all strips have pictures of one size
_JPEG_QUALITY = 85
_PAPER_LIMIT_PX2 = 20.0  # T4
_LEAST_PX2 = 0.01
_MOST_CORNERS = 40
_ARROW_PX = 16.0
_ROLES = {"after": "after the alert"}
_TOLD = {  # what is right, and what is a lie
    AlertType.OBSTACLE_HIDING: ("reported", "not reported"),
    AlertType.OBJECT_MISCLASSIFICATION: ("reported as what it is", "reported as something else"),
    AlertType.OBSTACLE_INJECTION: ("not reported", "reported, though it is not there"),
}


def film_content(run: Run, film: Film, index: int, labels: Iterable[AttackLabel] = ()) -> dict[str, Any]:
    """One film, for the template; `labels`: what was attacked, where that is known."""
    own = [label for label in labels if film.attack is None and _is_about(label, film)]
    strip = film.strip()
    return {
        "title": _title(run, film),
        "words": _words(run, film),
        "width": _MOST_SHOTS * (SIDE_PX + _GAP_PX) - _GAP_PX,
        "side": SIDE_PX,
        "shots": [
            {
                "x": k * (SIDE_PX + _GAP_PX),
                "when": _when(run, film, role, shot),
                "told": _told(film, shot),
                "is_wrong": _row(film, shot) == "missing",
                **_drawn(film, shot),
            }
            for k, (role, shot) in enumerate(strip)
        ],
        "right": _TOLD[film.alert.type][0],
        "wrong": _TOLD[film.alert.type][1],
        "has_error": _has_error(film),
        "is_missed": film.attack is not None,
        "is_labelled": bool(own),
        "figure": _figure(run, film, f"film{index}", own),
    }


def _when(run: Run, film: Film, role: Role, shot: Shot) -> str:
    """The time of a picture, and what happens then."""
    (shown_s,) = run.trace.since_start_s([shot.stamp_ns])
    what = _ROLES.get(role, role)
    if role == "alert" and film.raised_ns is not None and shot.stamp_ns != film.raised_ns:
        what = f"alert (at {run.trace.since_start_s([film.raised_ns])[0]:.2f} s)"
    return f"{shown_s:.2f} s: {what}"


def _is_about(label: AttackLabel, film: Film) -> bool:
    """Whether an attack was on the object of a film while that was taken."""
    is_then = label.start_ns <= film.shots[-1].stamp_ns and label.end_ns >= film.shots[0].stamp_ns
    return is_then and film.alert.source in label.sources and film.alert.object in (label.object, label.other)


def _drawn(film: Film, shot: Shot) -> dict[str, Any]:
    ok, data = cv2.imencode(".jpg", shot.picture, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    assert ok
    corners = np.column_stack([shot.observed, shot.predicted])[:_MOST_CORNERS]
    elsewhere = film.elsewhere_px(shot)
    placed = None if elsewhere is None else shot.placed(elsewhere)
    return {
        "data": base64.b64encode(data.tobytes()).decode("ascii"),
        "box": None if shot.status == LOST else shot.box.round(1).tolist(),
        "detected": None if shot.detected is None else shot.detected.round(1).tolist(),
        "elsewhere": None if placed is None else placed.round(1).tolist(),
        "arrow": None if placed is None else _arrow(placed),
        "corners": corners.round(1).tolist(),
    }


def _arrow(box: FloatArray) -> list[list[float]] | None:
    """Three points (u, v) of an arrow head at the picture's edge; None if the middle of the box is in the picture."""
    middle = 0.5 * SIDE_PX
    towards = 0.5 * (box[:2] + box[2:]) - middle
    reach = float(np.abs(towards).max())
    if reach <= middle:
        return None
    along = towards / np.linalg.norm(towards)
    tip = middle + towards / reach * (middle - 3.0)
    across = np.array([-along[1], along[0]])
    points = (
        tip,
        tip - _ARROW_PX * along + 0.6 * _ARROW_PX * across,
        tip - _ARROW_PX * along - 0.6 * _ARROW_PX * across,
    )
    return [point.round(1).tolist() for point in points]


def _told(film: Film, shot: Shot) -> str:
    if shot.status == "reported":
        return f"reported as {shot.told_label} {shot.told_id}".rstrip()
    if shot.status == LOST:
        return LOST
    if shot.status != "missing":
        return "no message for this frame"
    elsewhere = film.elsewhere_px(shot)
    return "not reported" if elsewhere is None else f"reported {words.way(shot.box_px, elsewhere)}"


def _title(run: Run, film: Film) -> str:
    name = f"{film.label} {film.alert.object}"
    if film.attack is not None:
        and_other = "" if film.attack.other is None else f" and {film.attack.other}"
        return f"Missed: {film.attack.name} on {name}{and_other}, by {film.alert.source}"
    onset_s = run.trace.since_start_s([film.alert.onset_ns])[0]
    kind = {
        AlertType.OBSTACLE_HIDING: "Hidden",
        AlertType.OBJECT_MISCLASSIFICATION: "Misclassified",
        AlertType.OBSTACLE_INJECTION: "Invented",
    }[film.alert.type]
    called = f", called id {film.told_id}" if film.is_swapped and film.told_id else ""
    return f"{kind}: {name}{called}, by {film.alert.source}, from {onset_s:.2f} s on"


def _words(run: Run, film: Film) -> str:
    if film.attack is not None or film.raised_ns is None:
        return f"No alert was raised: {film.why}."
    raised_ns = film.raised_ns
    onset_s, raised_s = run.trace.since_start_s([film.alert.onset_ns, raised_ns])
    name = f"{film.label} {film.alert.object}"
    source = film.alert.source
    alarm = f"The alert was raised at {raised_s:.2f} s.{_born_in_a_lie(run, film)}"
    at_alert = film.alert_shot
    elsewhere = film.elsewhere_px(at_alert)
    if film.alert.type is AlertType.OBSTACLE_HIDING:
        instead = (
            ""
            if elsewhere is None
            else f" Instead it reports {name}, {words.way(at_alert.box_px, elsewhere)} of it, "
            f"{where_px(elsewhere)}: the red box, or the red arrow towards it."
        )
        return (
            f"From {onset_s:.2f} s on {source} no longer reports {name} {where_px(at_alert.box_px)}, although it is "
            f"still in the picture: its corners can be followed from image to image, and they go on moving together."
            f"{instead} {alarm}"
        )
    if film.alert.type is AlertType.OBJECT_MISCLASSIFICATION:
        called = " and ".join(
            [f"calls it {film.told_label}"] * (film.told_label != film.label)
            + [f"gives it the track id {film.told_id}"] * film.is_swapped
        )
        instead = (
            ""
            if elsewhere is None
            else f", while it reports {name}, {words.way(at_alert.box_px, elsewhere)} of it"
        )
        return (
            f"{source} had reported {name}; from {onset_s:.2f} s on it {called or 'gives it another name'}{instead}. "
            f"The pixels are still those of the same object: {_followed(run, film)}. {alarm}"
        )
    return (
        f"From {onset_s:.2f} s on {source} is seen to report {name} where nothing stands: the corners in its box are "
        f"those of the ground or the wall behind it. {alarm}"
    )


def _followed(run: Run, film: Film) -> str:
    """How long its corners moved together: where its curve is drawn."""
    found = [shot for shot in film.shots if shot.error_px2 is not None]
    raised_ns = film.raised_ns or 0
    late = [s.stamp_ns for s in found if s.stamp_ns > raised_ns and (s.error_px2 or 0.0) > _PAPER_LIMIT_PX2]
    stamps_ns = [shot.stamp_ns for shot in found if not late or shot.stamp_ns < late[0]]
    if not stamps_ns:
        return "its picture is the same"
    first_s, last_s = run.trace.since_start_s([stamps_ns[0], stamps_ns[-1]])
    return f"its corners were followed from {first_s:.2f} s to {last_s:.2f} s"


def _born_in_a_lie(run: Run, film: Film) -> str:
    """A warning, where the object was first told of during another lie under the same name."""
    for other in run.alerts:
        alert = other.raised.alert
        same = (alert.source, alert.object) == (film.alert.source, film.alert.object)
        if same and alert.onset_ns <= film.since_ns <= other.end_ns and alert.onset_ns < film.alert.onset_ns:
            first_s = run.trace.since_start_s([film.since_ns])[0]
            return (
                f" But the detector first reported something at this place at {first_s:.2f} s, in the midst of the lie "
                f"about {film.label} {film.alert.object} told above: what is followed here may be what lay in the "
                "false box."
            )
    return ""


def _has_error(film: Film) -> bool:
    """Whether its corners are evidence: those in a box with nothing in it are the background's."""
    return film.alert.type is not AlertType.OBSTACLE_INJECTION


def _figure(run: Run, film: Film, name: str, labels: Sequence[AttackLabel]) -> str:
    """``e^L`` over time, the span of the lie, below it what the detector told, and at the top what was attacked."""
    seconds = run.trace.since_start_s([shot.stamp_ns for shot in film.shots])
    error = np.array([np.nan if s.error_px2 is None else max(s.error_px2, _LEAST_PX2) for s in film.shots])
    (onset,) = run.trace.since_start_s([film.alert.onset_ns])
    raised, end = _raised_and_end(run, film)

    def draw(figure: Any) -> None:
        axes = figure.subplots()
        if _has_error(film):
            _draw_error(axes, seconds, error)
        else:
            axes.set_yticks([])
        color = ALERT if raised is not None else LABEL
        axes.axvspan(onset, end, color=color, alpha=0.12, linewidth=0)
        if raised is not None:
            axes.axvline(raised, color=ALERT, linewidth=1.2)
        for label in labels:
            span = np.clip(run.trace.since_start_s([label.start_ns, label.end_ns]), seconds[0], seconds[-1])
            axes.plot(
                span,
                [1.0, 1.0],
                color=LABEL,
                linewidth=6,
                solid_capstyle="butt",
                transform=axes.get_xaxis_transform(),
            )
        for status, color in (("reported", SEEN), ("missing", ALERT)):
            at = [t for t, s in zip(seconds, film.shots, strict=True) if _row(film, s) == status]
            axes.plot(at, [_LEAST_PX2 * 0.45] * len(at), linestyle="", marker="s", markersize=4, color=color)
        axes.set_xlabel("time since the first frame [s]")

    return svg(draw, (9.0, 2.1 if _has_error(film) else 0.75), name)


def _raised_and_end(run: Run, film: Film) -> tuple[float | None, float]:
    """When the alert was raised, if one was, and when the lie was over or the film was: seconds.

    It is over with the first honest message, and no later than the alert in the table.
    """
    last_ns, raised_ns = film.shots[-1].stamp_ns, film.raised_ns
    if raised_ns is None:
        end_ns = last_ns if film.attack is None else min(film.attack.end_ns, last_ns)
        return None, float(run.trace.since_start_s([end_ns])[0])
    honest = [
        shot.stamp_ns for shot in film.shots if shot.stamp_ns > raised_ns and _row(film, shot) == "reported"
    ]
    told = [a.end_ns for a in run.alerts if (a.raised.alert, a.raised.stamp_ns) == (film.alert, raised_ns)]
    raised, end = run.trace.since_start_s([raised_ns, min([*honest[:1], *told, last_ns])])
    return float(raised), float(max(raised, end))


def _draw_error(axes: Any, seconds: FloatArray, error: FloatArray) -> None:
    axes.set_yscale("log")
    axes.set_ylim(_LEAST_PX2 * 0.25, _PAPER_LIMIT_PX2 * 4.0)
    axes.axhline(_PAPER_LIMIT_PX2, color=QUIET, linewidth=1.0, linestyle=(0, (5, 3)))
    axes.annotate(
        "20 px², the paper's limit (T4): above it the pixels would no longer be the object's",
        (0.005, _PAPER_LIMIT_PX2), fontsize=8, xycoords=("axes fraction", "data"), textcoords="offset points",
        xytext=(0, 3), color="#555555",
    )  # fmt: skip
    axes.plot(seconds, error, color="#222222", linewidth=1.1, marker=".", markersize=4)
    axes.set_yticks([0.01, 0.1, 1.0, 10.0], ["0.01", "0.1", "1", "10"])
    axes.minorticks_off()
    axes.set_ylabel("corners apart [px²]")


def _row(film: Film, shot: Shot) -> str:
    """What a message told: "reported" what is true as far as is known, "missing" what is a lie."""
    if film.alert.type is AlertType.OBJECT_MISCLASSIFICATION:
        is_swapped = film.is_swapped and shot.told_id not in ("", film.alert.object)
        return "" if shot.status != "reported" else "missing" if shot.misnamed or is_swapped else "reported"
    if film.alert.type is AlertType.OBSTACLE_INJECTION:
        return "missing" if shot.status == "reported" else "reported" if shot.status == "missing" else ""
    return shot.status
