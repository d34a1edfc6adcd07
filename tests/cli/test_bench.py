"""``belie bench``: a suite of one's own over real processes, resumed, and with a detector that fails."""

import json
import re

import pytest

from belie.evaluation.bench.cases import recordings_of
from belie.evaluation.bench.recorded import load
from belie.evaluation.bench.suite import load_suite
from belie.types import PoseClaim

SUITE = """
title = "mine"
description = "a small drive"
rivals = ["gate", "bench_rivals:Silent"]

[[real]]
paths = ["{path}"]

[[attacks]]
family = "position jump"
goal = "PS"
specs = ["position-offset:axis=x,magnitude=30,source=/gnss"]
onsets = [70]

[[attacks]]
family = "too late"
specs = ["odometry-freeze"]
onsets = [5000]
"""
RIVALS = """
import json


class Silent:
    def __init__(self, cameras):
        pass

    def update(self, step):
        return []


class Broken(Silent):
    def update(self, step):
        raise RuntimeError("no idea")


class Deep(Silent):
    def update(self, step):
        return json.loads("{")


class Forgetful(Silent):
    def update(self, step):
        return None


class Wordy(Silent):
    def update(self, step):
        return "x"


class Picky(Silent):
    judges = ("camera_fault",)
"""


@pytest.fixture
def suite(tmp_path, drive, monkeypatch):
    (tmp_path / "bench_rivals.py").write_text(RIVALS, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    path = tmp_path / "mine.toml"
    path.write_text(SUITE.format(path=drive), encoding="utf-8")
    return path


def tables(output):
    """All but times and the last line, which tells of resumed runs."""
    return re.sub(r"Latency.*", "", output, flags=re.DOTALL)


def test_a_suite_of_ones_own_runs_resumes_and_gives_the_same_table(run, suite, tmp_path):
    arguments = ("bench", suite, "-o", tmp_path / "out", "-j", 1, "--cache", tmp_path / "cache")
    first = run(*arguments)
    assert first.exit_code == 0, first.output
    assert "6 of 6 runs; " in first.stdout
    folder = tmp_path / "out" / "mine"
    records = [json.loads(path.read_text(encoding="utf-8")) for path in (folder / "runs").glob("*.json")]
    (jump,) = [r for r in records if r["rival"] == "gate" and r["family"] == "position jump"]
    assert jump["caught"]
    assert sum(r["not_applicable"] is not None for r in records) == 2  # the attack that starts too late
    assert first.stderr.startswith(
        "not tried: 2 x too late: odometry-freeze:start=5000 starts at frame 5000, but"
    )
    assert first.stderr.count("\n") == 1
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert "position jump" in page
    assert "http://" not in re.sub(
        r"http://www\.w3\.org\S*|http://purl\S*|http://creativecommons\S*", "", page
    )
    assert "## Attacks caught" in (folder / "table.md").read_text(encoding="utf-8")

    import pyarrow.dataset as ds

    frames = ds.dataset(folder / "frames").to_table().to_pydict()
    assert {"run", "frame", "status", "statistic", "threshold", "alerts"} <= set(frames)
    assert set(frames["frame"]) == set(range(90))

    again = run(*arguments)
    assert "6 of 6 runs, 6 of them before; " in again.stdout
    assert tables(again.stdout) == tables(first.stdout)


def test_a_detector_that_fails_is_told_of_and_stops_nobody_else(run, suite, tmp_path):
    result = run(
        "bench",
        suite,
        "-o",
        tmp_path / "out",
        "-j",
        1,
        "--rival",
        "bench_rivals:Broken",
        "--cache",
        tmp_path / "cache",
    )
    assert result.exit_code == 1
    assert "7 of 9 runs" in result.stdout
    assert result.stderr.count("RuntimeError: no idea (bench_rivals.py:15)") == 1
    assert "failed: bench_rivals:Broken, drive0 noisy 0, honest (and 1 more): " in result.stderr
    failed = next((tmp_path / "out" / "mine" / "runs").glob("*.failed.json"))
    assert 'raise RuntimeError("no idea")' in json.loads(failed.read_text(encoding="utf-8"))["traceback"]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (
            "Deep",
            "JSONDecodeError: Expecting property name enclosed in double quotes: line 1 column 2 (char 1) (bench_",
        ),
        ("Forgetful", "Forgetful.update() must return the alerts, got None"),
        ("Wordy", "Wordy.update() must return belie.types.Alert, got 'x'"),
    ],
)
def test_what_is_wrong_with_a_detector_is_told(run, suite, tmp_path, name, said):
    only = ("--only", f"bench_rivals:{name}", "--cache", tmp_path / "cache")
    result = run("bench", suite, "-o", tmp_path / "out", "-j", 1, *only)
    assert result.exit_code == 1
    assert said in result.stderr
    assert "measure.py" not in result.stderr


OWN = """
title = "own"
rivals = ["default"]
honest = false

[[real]]
paths = ["{path}"]
{claims}

[[attacks]]
family = "hiding"
specs = ["detections-hide"]
onsets = [40]
"""


def own_suite(tmp_path, path, claims):
    suite = tmp_path / "own.toml"
    suite.write_text(OWN.format(path=path, claims=claims), encoding="utf-8")
    return "bench", suite, "-o", tmp_path / "out", "-j", 1, "--cache", tmp_path / "cache"


def test_claims_are_taken_as_they_were_recorded_detections_too(run, tmp_path, drive):
    rows = [f"{frame},7,car,0.9,40,60,90,110" for frame in range(90)]
    table = "frame,track_id,label,score,left,top,right,bottom\n" + "\n".join(rows) + "\n"
    (drive.parent / "boxes.csv").write_text(table, encoding="utf-8")
    result = run(*own_suite(tmp_path, drive, 'claims = "recorded"\ndetections = "boxes.csv"'))
    assert result.exit_code == 0, result.output
    assert "1 of 1 runs; " in result.stdout
    assert result.stderr == ""
    (record,) = (tmp_path / "out" / "own" / "runs").glob("*.json")
    found = json.loads(record.read_text(encoding="utf-8"))
    assert found["alert"] == "obstacle_hiding"
    assert found["frames"] == 90
    assert found["object_px"] == [50, 50]
    assert found["why_missed"].startswith("hiding ")  # the box shows a moving wall
    motion_only = load_suite(tmp_path / "own.toml").model_copy(update={"objects": False})
    (case,) = recordings_of(motion_only)
    steps = load(case, tmp_path / "cache").joined
    assert {type(claim) for step in steps for claim in step.claims} == {PoseClaim}


def test_where_no_attack_can_be_tried_it_is_told_and_nothing_is_claimed(run, tmp_path, drive):
    result = run(*own_suite(tmp_path, drive, ""))
    assert result.exit_code == 2
    assert (
        "not tried: 1 x hiding: detections-hide:start=40: no detections claims in frames 40 to 90;"
        in result.stderr
    )
    assert 'claims = "recorded" takes the recording\'s own' in result.stderr
    assert "no attack was run: of 1 none could be tried" in result.stderr
    assert result.stderr.count("\n") == 2


def test_attacks_that_a_detector_cannot_answer_are_not_run_on_it(run, suite, tmp_path):
    arguments = (
        "-o",
        tmp_path / "out",
        "-j",
        1,
        "--cache",
        tmp_path / "cache",
        "--only",
        "bench_rivals:Picky",
    )
    result = run("bench", suite, *arguments)
    assert result.exit_code == 0, result.output
    assert "1 of 1 runs; " in result.stdout  # the honest one


def test_suites_are_listed_and_printed_to_be_copied(run, tmp_path):
    listed = run("bench", "--list").stdout
    for name in ("quick", "paper", "real", "floor", "stealth", "clean", "latency"):
        assert re.search(rf"^{name}\s", listed, re.MULTILINE)
    printed = run("bench", "quick", "--print").stdout
    copy = tmp_path / "copy.toml"
    copy.write_text(printed, encoding="utf-8")
    assert run("bench", copy, "--print").stdout == printed


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("quik",), "did you mean quick?"),
        (("quick", "--rival", "nobody"), "no rival nobody: known are default, paper"),
    ],
)
def test_what_is_misspelt_is_told_in_one_line(run, arguments, said, tmp_path):
    result = run("bench", *arguments, "-o", tmp_path / "out")
    assert result.exit_code == 2
    assert said in result.stderr
    assert result.stderr.count("\n") == 1


def test_what_is_wrong_with_every_run_ends_the_suite_in_one_line(run, suite, tmp_path, monkeypatch):
    (tmp_path / "needy.py").write_text(
        "from belie.types import MissingExtraError\n\n\nclass Needy:\n    def __init__(self, cameras):\n"
        "        raise MissingExtraError('torch', 'bench')\n\n    def update(self, step):\n        return []\n"
    )
    result = run(
        "bench",
        suite,
        "-o",
        tmp_path / "out",
        "-j",
        1,
        "--only",
        "needy:Needy",
        "--cache",
        tmp_path / "cache",
    )
    assert result.exit_code == 2
    assert "torch is not installed; run: pip install 'belie[bench]'" in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.slow
def test_a_first_look_shows_every_kind_of_attack_found(run, tmp_path):
    pytest.importorskip("moderngl")
    only = (
        "--only",
        "default",
        "-o",
        tmp_path / "out",
        "-j",
        1,
        "--cache",
        tmp_path / "cache",
        "--reports",
        0,
    )
    result = run("bench", "quick", *only)
    assert result.exit_code == 0, result.output
    assert "What was missed" not in result.stdout
    rows = (tmp_path / "out" / "quick" / "table.md").read_text(encoding="utf-8")
    assert len(re.findall(r"^\| .* \| no fog \| 1/1 ", rows, re.MULTILINE)) == 7
    assert "| default | street-straight sunny | 1 | 6 s | 0 |" in rows
