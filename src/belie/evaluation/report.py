"""The report: one self-contained HTML page that shows and explains a run."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import jinja2
import numpy as np

from belie.attacks import AttackLabel
from belie.evaluation import figures
from belie.evaluation import report_words as words
from belie.evaluation.config_toml import changed_settings, to_toml
from belie.evaluation.film_figure import film_content
from belie.evaluation.run import Run
from belie.evaluation.score import Score
from belie.evaluation.snapshots import Snapshot
from belie.geometry import FloatArray
from belie.types import RecordingError, Status

_JPEG_QUALITY = 82
_LONG_ARROW_PX = 400.0
_TEXT_SHARE = 0.014  # of the picture's width: size of what is written in it
_WIDE = 0.62  # of the size: a bold letter, about


def write_report(run: Run, path: str | Path, *, labels: Iterable[AttackLabel] | None = None) -> None:
    """Write one HTML page: the verdict in words, the evidence over time, trajectories, frames at the alerts.

    The page needs nothing else: no network, no scripts.

    Parameters
    ----------
    run : Run
        Of `belie.evaluation.run.run_detector`.
    path : path
        Where to write; an existing file is replaced.
    labels : iterable of AttackLabel, optional
        The truth, if it is known: the page then also shows hits, misses and delays.

    Raises
    ------
    RecordingError
        If the page cannot be written.

    Examples
    --------
    >>> write_report.__name__
    'write_report'
    """
    page = render_report(run, labels=labels)
    try:
        Path(path).write_text(page, encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"cannot write the report to {path}: {error.strerror}") from None


def render_report(run: Run, *, labels: Iterable[AttackLabel] | None = None) -> str:
    """The page as text; see `write_report`."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("belie.evaluation"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html.j2").render(_content(run, labels))


def _content(run: Run, labels: Iterable[AttackLabel] | None) -> dict[str, Any]:
    truth = None if labels is None else list(labels)
    scored = None if truth is None else run.score(truth)
    missed = [] if scored is None else [each.label for each in scored.labels if each.hit is None]
    films = [*run.films, *(film for film in run.attacked if film.shots and film.attack in missed)]
    changed = changed_settings(run.config)
    sequential = getattr(run.config, "sequential", None)
    return {
        "run": run,
        "headline": words.headline(run),
        "summary": words.summary(run),
        "never_decided": words.never_decided(run),
        "told": [told.in_words() for told in run.told],
        "warnings": [said for told in run.told if (said := told.timing_in_words())],
        "tone": words.tone(run),
        "alerts": [words.alert_row(run, traced) for traced in run.alerts],
        "score": None if scored is None else _score_rows(run, scored),
        "evidence": figures.evidence_figure(run, truth or ()),
        "trajectory": figures.trajectory_figure(run),
        "zoomed": figures.zoom_window(run) is not None,
        "snapshots": [_picture(run, snapshot) for snapshot in run.snapshots],
        "films": [film_content(run, film, k, truth or ()) for k, film in enumerate(films)],
        "unseen": [
            f"{label.text}: no picture, as {why}" for label in missed if (why := words.unfollowed(run, label))
        ],
        "floor_rows": words.floor_rows(run),
        "floor": figures.floor_figure(run),
        "undecided_share": run.trace.share(Status.UNDECIDED),
        "undecided": [
            {"check": check, "reason": reason, "share": f"{frames / len(run.trace):.1%}", "frames": frames}
            for check, reason, frames in run.undecided_reasons()[:12]
        ],
        "latency_words": words.latency_words(run),
        "latency": figures.latency_figure(run),
        "mishaps": words.mishap_rows(run),
        "changed": {name: value for name, (value, _) in changed.items() if name != "profile"},
        "false_alarms_per_hour": getattr(sequential, "false_alarms_per_hour", None),
        "settings": to_toml(run.config),
        "colors": {
            name: getattr(figures, name) for name in ("CLAIMED", "SEEN", "ALERT", "LABEL", "QUIET", "OWN")
        },
    }


def _score_rows(run: Run, result: Score) -> dict[str, Any]:
    rows = []
    kinds = {film.attack: film.label for film in run.attacked if film.attack is not None}
    for scored in result.labels:
        start_s, end_s = run.trace.since_start_s([scored.label.onset_ns, scored.label.end_ns])
        hit = scored.hit is not None
        rows.append(
            {
                "text": scored.label.text,
                "sources": ", ".join(scored.label.sources),
                "object": words.attacked_words(scored.label, kinds),
                "span": f"{start_s:.2f} to {end_s:.2f} s",
                "hit": hit,
                "delay": f"{scored.delay_frames} frames, {(scored.delay_ms or 0.0) / 1e3:.2f} s"
                if hit
                else "",
            }
        )
    aftermath = [words.raised_words(one) for one in result.aftermath]
    return {"rows": rows, "result": result, "aftermath": aftermath}


def _picture(run: Run, snapshot: Snapshot) -> dict[str, Any]:
    """A frame as JPEG, and its corners as numbers for SVG."""
    height, width = snapshot.image.shape
    found = snapshot.object
    ok, data = cv2.imencode(".jpg", snapshot.image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    assert ok
    length = np.linalg.norm(snapshot.expected_px - snapshot.observed_px, axis=1)
    drawn = length < _LONG_ARROW_PX
    corners = np.column_stack([snapshot.observed_px, snapshot.expected_px])[drawn]
    return {
        "title": words.snapshot_title(run, snapshot),
        "words": words.snapshot_words(run, snapshot),
        "width": width,
        "height": height,
        "radius": max(2.0, width / 330) * (1.0 if found is None else 0.5),
        "line": max(1.5, width / 500),
        "data": base64.b64encode(data.tobytes()).decode("ascii"),
        "corners": corners.round(1).tolist(),
        "is_alert": snapshot.alert is not None,
        "boxes": _boxes(snapshot),
    }


def _boxes(snapshot: Snapshot) -> list[dict[str, Any]]:
    """What is drawn around an accused object: by its own pixels dashed, and solid where the detector tells of it."""
    found = snapshot.object
    if found is None:
        return []
    source, name = found.source, f"{found.label} {found.name}"
    called = f"{found.told_label} {snapshot.told_id}".rstrip()
    drawn = [(found.box_px, figures.OWN, True, f"{name}, by its own pixels")]
    if found.detected_px is not None:
        drawn.append((found.detected_px, figures.ALERT, False, f"{called}, says {source}"))
    if snapshot.elsewhere_px is not None:
        drawn.append((snapshot.elsewhere_px, figures.ALERT, False, f"{name}, says {source}"))
    height, width = snapshot.image.shape
    size = _TEXT_SHARE * width
    content = []
    for k, (box, color, dashed, text) in enumerate(drawn):
        edges = _placed(box, snapshot)
        x = min(edges[0], width - _WIDE * size * len(text))
        y = edges[1] + edges[3] + 1.1 * size if k > 0 else edges[1] - 0.4 * size
        content.append(
            {
                "edges": edges,
                "color": color,
                "dashed": dashed,
                "text": text,
                "x": round(max(0.2 * size, x), 1),
                "y": round(min(max(size, y), height - 0.4 * size), 1),
                "size": round(size, 1),
            }
        )
    return content


def _placed(box_px: FloatArray, snapshot: Snapshot) -> list[float]:
    """Edges of the camera's image, in the picture: left, top, width, height."""
    left, top, right, bottom = (box_px * snapshot.scale - 0.5).tolist()
    return [round(x, 1) for x in (left, top, right - left, bottom - top)]
