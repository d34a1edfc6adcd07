"""``belie check``: exit codes, the JSON contract, the table, the score and the report."""

import json
import re

import numpy as np
import pytest


def test_an_honest_drive_exits_0(run, drive):
    result = run("check", drive)
    assert result.exit_code == 0, result.output
    assert "90 in 8.9 s, 10.0 Hz" in result.stdout
    assert "no alert" in result.stdout
    assert re.search(r"learning the noise of this stream: 1 to \d+ more frames", result.stdout)
    assert "p95" in result.stdout


def test_a_lie_exits_1_and_is_named(run, attacked):
    result = run("check", attacked)
    assert result.exit_code == 1, result.output
    line = next(line for line in result.stdout.splitlines() if "odometry_spoofing" in line)
    assert "/odom" in line
    assert "frame 60" in line
    assert f"--labels {attacked}.labels.json" in " ".join(result.stderr.split())


def test_json_alone_on_stdout(run, attacked):
    result = run("check", attacked, "--json", "-")
    assert result.exit_code == 1
    verdicts = [json.loads(line) for line in result.stdout.splitlines()]
    assert [verdict["frame"] for verdict in verdicts] == list(range(90))
    assert set(verdicts[0]) == {"frame", "stamp_ns", "status", "latency_ms", "checks", "alerts"}
    odometry = next(check for check in verdicts[30]["checks"] if check["check"] == "odometry")
    assert set(odometry) == {
        "check", "source", "status", "statistic", "threshold", "unit", "floor", "reason", "object",
    }  # fmt: skip
    alerts = [(verdict["frame"], alert) for verdict in verdicts for alert in verdict["alerts"]]
    frame, alert = alerts[0]
    assert 60 <= frame <= 63
    assert (alert["type"], alert["source"], alert["object"]) == ("odometry_spoofing", "/odom", None)
    assert set(alert) == {"type", "source", "onset_ns", "object", "because"}
    reasons = [c["reason"] for c in verdicts[frame]["checks"] if c["status"] == "contradicted"]
    assert alert["because"] == "; ".join(reasons)
    assert alert["because"]
    assert "odometry_spoofing" in result.stderr


@pytest.fixture(scope="module")
def scored(run, attacked, tmp_path_factory):
    """One run with everything asked for: result, JSON lines, page."""
    folder = tmp_path_factory.mktemp("scored")
    options = ["--json", folder / "out.jsonl", "--report", folder / "out.html"]
    result = run("check", attacked, *options, "--labels", f"{attacked}.labels.json")
    assert result.exit_code == 1, result.output
    return result, (folder / "out.jsonl").read_text(), (folder / "out.html").read_text(encoding="utf-8")


def test_json_to_a_file_leaves_the_table_on_stdout(scored):
    result, lines, _ = scored
    assert "odometry_spoofing" in result.stdout
    assert len(lines.splitlines()) == 90


def test_labels_score_the_answer(scored):
    result, _, _ = scored
    assert "hits 1 of 1" in result.stdout
    assert "wrong type or source 0" in result.stdout
    assert "add --labels" not in result.stderr


def test_the_report_is_one_self_contained_page(scored):
    _, _, html = scored
    assert "The stream /odom claims a motion that the camera did not see" in html
    assert "data:image/jpeg;base64," in html
    assert "odometry-offset:axis=z,rate=0.2,start=60,stop=70" in html
    assert "<script" not in html
    assert not [word for word in ('src="http', 'href="http', "@import", "url(http") if word in html]


def test_the_paper_profile_runs(run, drive):
    result = run("check", drive, "--profile", "paper", "--position", "poses")
    assert result.exit_code in (0, 1), result.output
    assert "profile paper" in result.stdout


def test_settings_from_file_and_flags(run, drive, tmp_path):
    settings = tmp_path / "belie.toml"
    settings.write_text("[noise]\nlearning_frames = 30\n")
    result = run("check", drive, "--config", settings, "--false-alarms-per-hour", "5", "--json", "-")
    undecided = [v for v in map(json.loads, result.stdout.splitlines()) if v["status"] == "undecided"]
    assert len(undecided) >= 30


@pytest.mark.parametrize("command", ["check", "info", "calibrate"])
def test_a_detector_that_cannot_be_used_is_one_line(run, drive, tmp_path, command):
    text = tmp_path / "text.onnx"
    text.write_text("hello")
    output = ["-o", tmp_path / "belie.toml"] if command == "calibrate" else []
    for model, expected in ((tmp_path / "none.onnx", "no such file"), (text, "is no ONNX model")):
        result = run(command, drive, "--detector", model, *output)
        assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
        assert expected in result.stderr


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["{drive}", "--detections", "boxes.txt"], "--detections boxes.txt: no such file"),
        (["no/such.mcap"], "no/such.mcap does not exist"),
        (["{drive}", "--profile", "fast"], "profile"),
        (["{drive}", "--config", "none.toml"], "cannot read the configuration none.toml"),
        (["{drive}", "--false-alarms-per-hour", "-1"], "sequential.false_alarms_per_hour"),
        (["{drive}", "--labels", "{drive}/poses.txt"], "labels"),
        (["{drive}", "--imu", "/imu"], "--imu /imu has no meaning"),
        (["{drive}", "--report", "no/folder/out.html"], "the folder no/folder does not exist"),
        (["{drive}", "--json", "no/folder/out.json"], "no/folder/out.json: No such file"),
        (["{drive}", "--rate", "-3"], "rate_hz must be positive"),
        (["{drive}", "--image", "/left"], "--image /left"),
        ([], "Missing argument 'SOURCE'"),
        (["{drive}", "--reprot", "x"], "--reprot"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(run, drive, arguments, expected):
    result = run("check", *(argument.format(drive=drive) for argument in arguments))
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith("belie: error: ")
    assert expected in result.stderr


def test_a_missing_file_of_detections_is_no_topic(run, attacked):
    for named, said in (("boxes.txt", "file"), ("labels/boxes", "file"), ("/boxes", "topic")):
        result = run("check", attacked, "--detections", named)
        assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
        assert f"--detections {named}: no such {said}" in result.stderr


def test_what_damage_took_is_told_in_one_line(run, tmp_path, drive, attacked):
    data = attacked.read_bytes()
    at = data.index(b"IDAT", len(data) // 2) + 40
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data[:at] + bytes(byte ^ 0xFF for byte in data[at : at + 500]) + data[at + 500 :])
    said = f"belie: warning: {damaged} is damaged: 1 of 90 messages of /image_0 cannot be decoded"
    copy = tmp_path / "copy.mcap"
    for arguments in (["check", damaged], ["attack", damaged, "odometry-freeze:start=70", "-o", copy]):
        result = run(*arguments)
        assert result.exit_code < 2, result.output
        assert [line for line in result.stderr.splitlines() if line.startswith(said)]
    assert "warning" not in run("check", attacked).stderr


def test_a_recording_without_claims_says_that_there_was_nothing_to_check(run, drive):
    result = run("check", drive, "--odometry", "none")
    assert result.exit_code == 0
    assert "no stream made one, so there was nothing to check but the camera itself" in result.stdout
    assert "nothing to check" not in run("check", drive).stdout


def test_damaged_files_are_one_line(run, tmp_path, attacked):
    text = tmp_path / "text.mcap"
    text.write_text("hello")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(attacked.read_bytes()[:20_000])
    empty = tmp_path / "empty"
    empty.mkdir()
    for path in (text, cut, empty):
        result = run("check", path)
        assert result.exit_code == 2
        assert result.stderr.count("\n") == 1, result.stderr
        assert str(path) in result.stderr


@pytest.fixture
def boxes(tmp_path):
    """A CSV file of three boxes of one label in each of thirty frames, shifted to the right by some pixels."""

    def write(label="car", right_px=0, seldom=""):
        lines = ["frame,track_id,label,left,top,right,bottom"]
        lines += [f"{frame},sign,{seldom},250,180,280,220" for frame in range(5 if seldom else 0)]
        for frame in range(30):
            for k in range(3):
                left = 10 + 90 * k + right_px
                lines.append(f"{frame},{k},{label},{left},{70 * k + 10},{left + 50},{70 * k + 50}")
        path = tmp_path / "boxes.csv"
        path.write_text("\n".join(lines) + "\n")
        return path

    return write


@pytest.mark.parametrize("command", ["check", "info"])
def test_detections_that_do_not_fit_are_told(run, drive, boxes, command):
    out = " ".join(run(command, drive, "--detections", boxes(right_px=5000)).stderr.split())
    assert "belie: warning: " in out
    assert (
        "90 of 90 boxes have no area inside the image of 320x240 px (first in line 2) and are left out; give left"
        in out
    )
    out = " ".join(run(command, drive, "--detections", boxes(label="wombat")).stderr.split())
    assert "/detections: 90 of 90 boxes have labels that no class group holds: 'wombat' (90)" in out
    assert "if that is no attack, put them into objects.classes.groups" in out
    out = " ".join(run(command, drive, "--detections", boxes(label="w" * 5000)).stderr.split())
    assert f"no class group holds: '{'w' * 40}…' (90)" in out
    assert "warning" not in run(command, drive, "--detections", boxes()).stderr
    is_told = "'stop sign' (5)" in run(command, drive, "--detections", boxes(seldom="stop sign")).stderr
    assert is_told == (command == "info")


@pytest.mark.parametrize("late", [0, 3])
def test_a_file_that_counts_frames_otherwise_is_told(run, drive, tmp_path, late):
    def left(
        k, depth_m, start
    ):  # of a box on one of the drive's bands, `start` px from the left in the first frame
        return start - 260.0 * (0.06 * k + 0.05 * np.sin(0.3 * k)) / depth_m

    lines = ["frame,track_id,label,left,top,right,bottom"]
    for k in range(75):
        for band, depth_m in enumerate((4.0, 6.0, 9.0, 14.0)):
            for number in range(6):
                x = left(k - late, depth_m, 20 + 90 * number)
                if 5 < x < 255:
                    lines.append(f"{k},{band}{number},car,{x},{60 * band + 5},{x + 50},{60 * band + 55}")
    path = tmp_path / "boxes.csv"
    path.write_text("\n".join(lines) + "\n")
    report = tmp_path / "report.html"
    result = run("check", drive, "--detections", path, "--report", report)
    told = (
        "/detections: its boxes are told about 3 frames late: they move as their pixels did 3 frames before"
    )
    assert (told in result.stderr) == (late == 3)
    assert (told in report.read_text()) == (late == 3)


def test_the_summary_tells_of_objects(run, drive, boxes):
    result = run("check", drive, "--detections", boxes())
    line = next(line for line in result.stdout.splitlines() if line.startswith("objects"))
    assert "/detections: 30 messages, 90 boxes, 3 objects; " in line
    assert "objects  " not in run("check", drive).stdout
