"""``belie attack``: an attacked copy, its labels, and what is refused."""

import json

import pytest

from belie.attacks import describe_attacks, read_labels
from belie.recordings import open_recording


def test_copy_and_labels(drive, attacked):
    (label,) = read_labels(f"{attacked}.labels.json")
    assert (label.start_frame, label.stop_frame, label.sources) == (60, 70, ("/odom",))
    original = [step.claims[0].T_odom_body.t for step in open_recording(drive).steps()]
    lies = [step.claims[0].T_odom_body.t for step in open_recording(attacked).steps()]
    assert len(lies) == len(original)
    assert lies[64][2] - original[64][2] == pytest.approx(1.0, abs=1e-6)
    assert lies[59] == pytest.approx(original[59], abs=1e-9)


def test_help_lists_every_attack(run):
    result = run("attack", "--help")
    assert result.exit_code == 0
    assert describe_attacks() in result.stdout
    assert "belie attack drive.mcap paper-odometry -o attacked.mcap" in result.stdout


def test_nothing_is_overwritten_without_force(run, drive, tmp_path):
    output = tmp_path / "out.mcap"
    output.write_bytes(b"precious")
    refused = run("attack", drive, "odometry-freeze:start=60", "-o", output)
    assert refused.exit_code == 2
    assert "--force overwrites it" in refused.stderr
    assert output.read_bytes() == b"precious"
    # A failure half-way leaves what was there, too.
    failed = run("attack", drive, "imu-bias:rate=1,start=60", "-o", output, "--force")
    assert failed.exit_code == 2
    assert "no imu claims" in failed.stderr
    assert output.read_bytes() == b"precious"
    assert run("attack", drive, "odometry-freeze:start=60", "-o", output, "--force").exit_code == 0
    assert open_recording(output).format == "ros2-mcap"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.mcap", "out.mcap.labels.json"]


def test_the_recording_itself_is_never_the_target(run, attacked):
    before = attacked.stat().st_mtime_ns
    result = run("attack", attacked, "odometry-freeze:start=60", "-o", attacked, "--force")
    assert result.exit_code == 2
    assert "would overwrite the recording itself" in result.stderr
    assert attacked.stat().st_mtime_ns == before


@pytest.mark.parametrize(
    ("specs", "output", "expected"),
    [
        (["odometry-ofset"], "out.mcap", "did you mean 'odometry-offset'?"),
        (["odometry-freeze:start=500"], "out.mcap", "the recording has 90 frames"),
        (["odometry-freeze:start=60"], "out.bag", "must end in .mcap"),
        ([], "out.mcap", "SPEC... and -o OUT.mcap are needed"),
    ],
)
def test_bad_attacks_are_one_line(run, drive, tmp_path, specs, output, expected):
    result = run("attack", drive, *specs, "-o", tmp_path / output)
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert expected in result.stderr
    assert not list(tmp_path.iterdir())


def test_labels_are_json_that_others_can_read(attacked):
    document = json.loads(attacked.with_name(f"{attacked.name}.labels.json").read_text())
    assert document["format"] == "belie-attack-labels"


def test_objects_of_a_file_are_attacked(run, drive, tmp_path):
    labels = tmp_path / "0000.txt"
    lines = [f"{k} 4 Car 0 0 0 {40 + k} 60 {140 + k} 120 1.5 1.8 4.2 1.0 1.6 12.0 -1.57\n" for k in range(90)]
    labels.write_text("".join(lines))
    output = tmp_path / "hidden.mcap"
    result = run("attack", drive, "paper-hiding:start=60", "--detections", labels, "-o", output)
    assert result.exit_code == 0, result.output
    assert "dimensions of objects with image boxes are left out" in result.stderr
    (label,) = read_labels(f"{output}.labels.json")
    assert (label.object, label.alert.value, label.sources) == ("4", "obstacle_hiding", ("/detections",))
    claims = [c for step in open_recording(output).steps() for c in step.claims if c.source == "/detections"]
    assert [k for k, claim in enumerate(claims) if not claim.detections] == list(range(60, 70))
    assert "frame 60 to 70; labelled obstacle_hiding, object 4" in result.stdout
    assert "object 4 was chosen, as it stays in view: Car, 100x60 px in frame 60" in result.stdout
    assert "told of in frames 0 to 84" in result.stdout
    shown = run("info", drive, "--detections", labels)
    assert "0000.txt (KITTI tracking labels)" in shown.stdout
    wrong = run(
        "attack",
        drive,
        "detections-hide:object=5,start=60",
        "--detections",
        labels,
        "-o",
        tmp_path / "x.mcap",
    )
    assert (wrong.exit_code, wrong.stderr.count("\n")) == (2, 1)
    assert "no object 5 to attack in frames 60 to 90; there /detections has 4 (Car)" in wrong.stderr


def test_an_object_that_comes_in_the_attack_is_told_of_by_its_own_frames(run, drive, tmp_path):
    boxes = tmp_path / "boxes.csv"
    rows = [f"{k},4,car,40,60,140,120" for k in range(50, 90)]
    boxes.write_text("\n".join(["frame,track_id,label,left,top,right,bottom", *rows, "20,,,,,,"]))
    spec = "detections-relabel:object=4,start=30,stop=70"
    result = run("attack", drive, spec, "--detections", boxes, "-o", tmp_path / "out.mcap")
    assert result.exit_code == 0, result.output
    assert "lies from 5.00 s, frame 50 to 70" in result.stdout
    assert "object 4 is first told of in frame 50: start at 60 or later" in result.stderr


def test_it_is_said_that_no_object_stays(run, drive, tmp_path):
    labels = tmp_path / "0000.txt"
    lines = [f"{k} 4 Car 0 0 0 40 60 140 120 -1 -1 -1 0 0 0 0\n" for k in range(20, 65)]
    lines += [
        f"{k} 5 Car 0 0 0 200 60 220 70 -1 -1 -1 0 0 0 0\n" for k in range(90)
    ]  # too small to be judged
    labels.write_text("".join(lines))
    output = tmp_path / "hidden.mcap"
    result = run("attack", drive, "paper-hiding:start=60", "--detections", labels, "-o", output)
    assert result.exit_code == 0, result.output
    assert "paper-hiding:start=60: no object with a track id, large enough, stays in view" in result.stderr
    assert "chosen" not in result.stdout
    assert "labelled obstacle_hiding, object 4" in result.stdout
