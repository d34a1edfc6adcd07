"""The table of `belie check`, of runs whose outcome is known: as wide as there is room, and in words."""

from dataclasses import replace

import pytest

from belie.cli.check_table import print_summary

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
