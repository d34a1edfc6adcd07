"""The table of `belie check`, of runs whose outcome is known: as wide as there is room, and in words."""

from dataclasses import replace

import numpy as np
import pytest

from belie.attacks import AttackLabel
from belie.cli.check_table import print_summary
from belie.detector import ObjectView
from belie.evaluation.run import run_detector
from belie.types import AlertType, Settings

WHY = "car 1 at [554, 190, 723, 336] px is missing in 5 of the last 5 messages, " + "and so on " * 6


@pytest.fixture
def printed(made_run, capsys):
    run = made_run(60, onset=30, end=40)
    run = replace(run, alerts=tuple(replace(alert, reason=WHY.strip()) for alert in run.alerts))

    def lines():
        print_summary(run)
        return [line.rstrip() for line in capsys.readouterr().out.splitlines()]

    return lines


@pytest.mark.parametrize(("columns", "expected"), [("200", 1), (None, 2), ("70", 3)])
def test_the_reason_has_the_whole_width(printed, monkeypatch, columns, expected):
    if columns is None:
        monkeypatch.delenv("COLUMNS", raising=False)
    else:
        monkeypatch.setenv("COLUMNS", columns)
    lines = printed()
    first = next(k for k, line in enumerate(lines) if line.startswith("  because car 1 at"))
    reason = lines[first : first + expected]
    assert " ".join(" ".join(reason).split()) == f"because {WHY.strip()}"
    assert max(map(len, lines)) <= int(columns or 120)
    assert columns == "70" or any(line.startswith("odometry_spoofing  /odom   3.20 s") for line in lines)


def test_numbers_that_differ_are_told_as_a_range(printed):
    assert any(line.endswith("learning: 1 to 5 more frames") for line in printed())


def test_a_check_that_never_decided_is_named(made_run, capsys):
    print_summary(made_run(5))
    out = " ".join(capsys.readouterr().out.split())
    assert "never decided false motion of /odom (odometry): undecided in all 5 frames because" in out


def test_why_an_attacked_object_was_missed_stands_below_it(made, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    label = AttackLabel(
        name="detections-hide", text="detections-hide:start=20", stream="detections", sources=("/detections",),
        alert=AlertType.OBSTACLE_HIDING, start_frame=20, stop_frame=30, start_ns=made.start_ns + 2 * 10**9,
        onset_ns=made.start_ns + 2 * 10**9, end_ns=made.start_ns + 3 * 10**9, seed=0, object="7",
    )  # fmt: skip

    class Seeing(made.Detector):
        def update(self, frame, claims):
            verdict = super().update(frame, claims)
            self.objects = (car(verdict),) if verdict.frame < 15 or verdict.frame > 18 else ()
            return verdict

    def car(verdict):
        px = np.array([[50.0, 40.0]])
        return ObjectView(
            source="/detections", name="7", label="car", told_label="car", misnamed=False, detected_px=None,
            box_px=np.array([40.0, 30.0, 80.0, 50.0]), told_ns=0, predicted_px=px, observed_px=px, error_px2=0.3,
            status="missing", number=7, told_id="7", met_ns=made.start_ns,
        )  # fmt: skip

    run = run_detector(made.Recording(60), Settings(), detector=Seeing(), labels=[label], pictures=False)
    other = replace(label, object="9", text="detections-hide:object=9")
    print_summary(run, labels=[label, other])
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    at = next(k for k, line in enumerate(lines) if "MISS" in line)
    assert lines[at + 1] == f"  because {run.attacked[0].why}"
    assert lines[at + 3] == "  because belie did not follow object 9: it knows none that it was never told of"
