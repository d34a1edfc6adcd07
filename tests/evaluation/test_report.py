"""The page: complete, self-contained, well-formed, and honest about what it does not know."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from belie.attacks import AttackLabel
from belie.detector import Config
from belie.evaluation import figures, report_words
from belie.evaluation.report import render_report, write_report
from belie.evaluation.run import run_detector
from belie.evaluation.told_objects import ToldObjects
from belie.types import AlertType, CheckResult, RecordingError, Settings, Status

FRAME_NS = 100_000_000


class Checker(HTMLParser):
    """Counts tags, and finds whatever is not closed, or named twice."""

    def __init__(self) -> None:
        super().__init__()
        self.open, self.ids, self.counts, self.text = [], [], {}, []

    def handle_starttag(self, tag, attrs):
        self.counts[tag] = self.counts.get(tag, 0) + 1
        self.ids += [value for name, value in attrs if name == "id"]
        if tag not in ("meta", "br"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.counts[tag] = self.counts.get(tag, 0) + 1

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def checked(page):
    checker = Checker()
    checker.feed(page)
    assert checker.open == []
    assert len(checker.ids) == len(set(checker.ids))
    return checker


def label(made, text="odometry-freeze:start=30"):
    at = {"start_ns": 30, "onset_ns": 30, "end_ns": 40}
    return AttackLabel(
        name="odometry-freeze", text=text, stream="odometry", sources=("/odom",), start_frame=30,
        stop_frame=40, seed=0, alert=AlertType.ODOMETRY_SPOOFING,
        **{name: made.start_ns + frame * FRAME_NS for name, frame in at.items()},
    )  # fmt: skip


def test_an_attacked_run(made_run, made):
    page = render_report(made_run(60, onset=30, end=40), labels=[label(made)])
    found = checked(page)
    text = " ".join(" ".join(found.text).split())
    assert "The stream /odom claims a motion that the camera did not see: from about 3.0 s on." in text
    assert "3.00 s (frame 30)" in text
    assert "3.20 s (frame 32)" in text
    assert "1 of 1 attacks found" in text
    assert "Frame 32, 3.20 s: false motion (odometry or IMU), /odom" in text
    assert "late 1 of /gnss" in text
    assert found.counts["image"] == 1
    assert found.counts["circle"] == 4
    assert "script" not in found.counts
    assert not re.search(r"(src|href)=\"(?!data:|#)", page)


def test_an_honest_run(made_run):
    found = checked(render_report(made_run(60)))
    text = " ".join(" ".join(found.text).split())
    assert "No claim was contradicted: what the robot said agrees with what its camera saw." in text
    assert "the frame that came nearest to an alert" in text
    assert "Against the labels" not in text


def test_a_run_that_could_not_be_judged(made_run):
    text = " ".join(" ".join(checked(render_report(made_run(5))).text).split())
    assert "almost nothing could be judged" in text
    assert "Nothing could be tested in this recording" in text
    assert "learning: 1 to 5 more frames" in text


def test_a_check_that_never_decided_is_told_in_the_headline(made):
    class Half(made.Detector):
        def update(self, frame, claims):
            verdict = super().update(frame, claims)
            why = "no ground is seen" if verdict.frame else "first frame"
            unknown = CheckResult(check="injection", source="/d", status=Status.UNDECIDED, reason=why)
            return replace(verdict, checks=(*verdict.checks, unknown))

    run = run_detector(made.Recording(60), Settings(), detector=Half())
    page = render_report(run)
    text = " ".join(" ".join(checked(page).text).split())
    assert "agrees with what its camera saw" not in text
    assert "nothing is known of invented obstacles of /d (injection)." in text
    assert "undecided in all 60 frames, in 59 of them because: no ground is seen" in text
    assert report_words.tone(run) == "open"
    assert "border-left: .35rem solid #3a7d44" not in page


def test_names_from_a_recording_are_escaped(made_run, made):
    page = render_report(made_run(60, onset=30), labels=[label(made, text="<script>alert(1)</script>")])
    assert "<script>" not in page
    assert "&lt;script&gt;" in page


def test_settings_are_told(made_run):
    config = Config.model_validate({"sequential": {"false_alarms_per_hour": 3.0}})
    text = " ".join(checked(render_report(made_run(20, config=config))).text)
    assert "3 false alarms an hour" in " ".join(text.split())
    assert "sequential.false_alarms_per_hour = 3.0" in text
    assert "[sequential]" in text


def test_the_same_run_gives_the_same_page(made_run):
    assert render_report(made_run(30, onset=20)) == render_report(made_run(30, onset=20))


def test_long_runs_are_thinned_but_keep_their_peaks():
    x = np.arange(100_000.0)
    y = np.zeros(100_000)
    y[54_321] = 7.0
    y[:1000] = np.nan
    thin_x, thin_y = figures._thinned(x, y)
    assert len(thin_x) == len(thin_y) <= 1500
    assert np.nanmax(thin_y) == 7.0
    assert np.isnan(thin_y[0])


def test_a_page_that_cannot_be_written_is_one_line(made_run, tmp_path):
    with pytest.raises(RecordingError, match=r"cannot write the report to .*: No such file"):
        write_report(made_run(20), tmp_path / "none" / "out.html")


def test_a_detector_of_which_no_box_was_followed_is_told_in_the_headline(made_run):
    told = ToldObjects(source="/d", messages=9, boxes=9, labels={}, objects=0, unjudged={})
    run = replace(made_run(60), told=(told,))
    assert report_words.headline(run).endswith("nothing is known of the objects of /d.")
    assert report_words.tone(run) == "open"


def test_the_page_says_how_many_objects_could_be_judged(made_run):
    """A flat curve of a detector whose objects were never judged looks like that of one that does not lie."""
    told = ToldObjects(source="/d", messages=9, boxes=12, labels={}, objects=3, unjudged={"small": 1})
    assert f"<strong>Objects:</strong> {told.in_words()}." in render_report(
        replace(made_run(60), told=(told,))
    )
