"""``belie demo``: the bundled drive, its lies, and the report."""

from importlib.resources import files
from pathlib import Path

import pytest

from belie.cli.demo import ATTACKS, DRIVE
from belie.recordings import open_recording


@pytest.fixture(scope="module")
def shown(run, tmp_path_factory):
    report = tmp_path_factory.mktemp("demo") / "demo.html"
    return run("demo", "--report", report, "--speed", 0), report


def test_every_lie_is_caught_and_nothing_else(shown):
    result, report = shown
    assert result.exit_code == 0, result.output
    assert result.stdout.count("ALERT") == len(ATTACKS)
    for word in ("position_spoofing", "odometry_spoofing", "false alerts 0", str(report)):
        assert word in result.stdout
    page = report.read_text()
    assert all(spec.split(":")[0] in page for spec, _ in ATTACKS)


def test_readme_shows_what_it_prints(shown):
    result, _ = shown
    readme = (Path(__file__).parents[2] / "README.md").read_text().splitlines()
    at = next(k for k, line in enumerate(readme) if line.startswith("lie  "))
    table = [line.rstrip() for line in readme[at : readme.index("```", at)]]
    assert len(table) == 1 + len(ATTACKS)
    printed = [line.rstrip() for line in result.stdout.splitlines()]
    assert [line for line in table if line not in printed] == []


def test_the_bundled_drive_is_small_and_whole():
    drive = files("belie.cli") / DRIVE
    assert drive.stat().st_size < 5_000_000
    recording = open_recording(drive)
    steps = list(recording.steps())
    assert 100 <= len(steps) <= 150
    assert {stream.role for stream in recording.streams if stream.used} == {
        "image",
        "camera_info",
        "odometry",
        "position",
        "imu",
        "detections",
    }


def test_a_report_that_cannot_be_written_is_said_at_once(run):
    result = run("demo", "--report", "no/such/folder/demo.html")
    assert result.exit_code == 2
    assert "the folder no/such/folder does not exist" in result.stderr
    assert result.stdout == ""
