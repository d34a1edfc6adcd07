"""``belie simulate`` on a made world: what is written, what is refused; and what the help tells."""

import importlib.util
import json
import tomllib
from pathlib import Path

import pytest

from belie.attacks import read_labels
from belie.recordings import open_recording
from belie.simulation.scenario import shipped_scenarios

SMALL = ("--size", "160x120", "--duration", "1", "--frame-rate", "10")


@pytest.fixture
def made_world(monkeypatch):
    """Puts the made world of the simulation's tests, with actors (id, x, y), in the place of a rendered one."""
    path = Path(__file__).parents[1] / "simulation" / "conftest.py"
    spec = importlib.util.spec_from_file_location("made_world", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    def make(*actors):
        world = module.make_world(*(module.make_actor(*actor) for actor in actors))
        monkeypatch.setattr("belie.simulation.simulate.build_world", lambda scenario: world)
        monkeypatch.setattr("belie.simulation.simulate.open_stage", module.open_plane_stage)

    return make


@pytest.fixture
def made(made_world):
    made_world((3, 30.0, 3.0))


def test_a_recording_and_what_lies_beside_it(run, made, tmp_path):
    out, look, depth = tmp_path / "out.mcap", tmp_path / "look.png", tmp_path / "depth"
    spec = "odometry-offset:rate=0.2,start=5"
    result = run(
        "simulate",
        "street-straight",
        *SMALL,
        "--attack",
        spec,
        "-o",
        out,
        "--preview",
        look,
        "--depth",
        depth,
    )
    assert result.exit_code == 0, result.output
    assert f"{spec}: /odom lies from 0.50 s" in result.stdout
    assert f"belie check {out} --labels {out}.labels.json" in result.stdout
    recording = open_recording(out)
    assert [s.topic for s in recording.streams if s.used] == [
        "/camera/camera_info",
        "/camera/image_raw/compressed",
        "/detections",
        "/gnss/fix",
        "/imu/data",
        "/odom",
    ]
    assert len(list(recording.steps())) == 10
    assert recording.geodetic_origin.latitude_deg == pytest.approx(48.1374, abs=0.001)
    (label,) = read_labels(f"{out}.labels.json")
    assert label.start_frame == 5
    truth = Path(f"{out}.groundtruth.tum").read_text().splitlines()
    assert len(truth) == 11
    objects = [json.loads(line) for line in Path(f"{out}.objects.jsonl").read_text().splitlines()]
    assert [entry["frame"] for entry in objects] == list(range(10))
    assert look.is_file()
    assert len(list(depth.glob("*.png"))) == 10
    assert not list(tmp_path.glob(".*"))


def test_the_same_seed_gives_the_same_bytes(run, made, tmp_path):
    files = [tmp_path / name for name in ("a.mcap", "b.mcap", "c.mcap")]
    for path, seed in zip(files, (7, 7, 8), strict=True):
        assert run("simulate", "street-curve", *SMALL, "--seed", seed, "-o", path).exit_code == 0

    def content(path):
        return [
            (step.frame.image.tobytes(), [(c.source, c.stamp_ns, c.received_ns) for c in step.claims])
            for step in open_recording(path).steps()
        ]

    assert content(files[0]) == content(files[1]) != content(files[2])


def test_closed_loop(run, made, tmp_path):
    out = tmp_path / "loop.mcap"
    result = run("simulate", "closed-loop", *SMALL, "--closed-loop", "-o", out)
    assert result.exit_code == 0, result.output
    assert "without belie: no collision in 0.9 s" in result.stdout
    outcome = json.loads(Path(f"{out}.closed_loop.json").read_text())
    assert [entry["guarded"] for entry in outcome["outcomes"]] == [False, True]
    assert all(entry["safe"] for entry in outcome["outcomes"])


def test_a_scenario_is_printed_and_read_again(run, tmp_path):
    result = run("simulate", "corridor", "--seed", 5, "--print")
    assert result.exit_code == 0
    values = tomllib.loads(result.stdout)
    assert (values["scene"], values["seed"], values["sensors"]["gnss"]["rate_hz"]) == ("corridor", 5, 0.0)
    assert "BMI055" in result.stdout
    assert "Undefined" not in result.stdout
    copy = tmp_path / "mine.toml"
    copy.write_text(result.stdout)
    again = run("simulate", copy, "--print")
    assert tomllib.loads(again.stdout) == values


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nowhere", "-o", "x.mcap"), "no scenario nowhere: known are closed-loop, corridor"),
        (("corridor",), "name the recording to write with -o OUT.mcap"),
        (("corridor", "-o", "x.bag"), "must end in .mcap"),
        (("corridor", "-o", "x.mcap", "--size", "big"), "--size big: write it as WIDTHxHEIGHT"),
        (("corridor", "-o", "x.mcap", "--weather", "hail"), "weather: Input should be"),
        (("corridor", "-o", "x.mcap", "--preview", "x.gif"), "must end in .mp4 or .png"),
        (("corridor", "-o", "x.mcap", "--duration", "0"), "duration_s: Input should be greater than 0"),
    ],
)
def test_what_makes_no_sense_is_one_line(run, arguments, said):
    result = run("simulate", *arguments)
    assert result.exit_code == 2
    assert said in result.stderr
    assert result.stderr.count("\n") == 1


def test_nothing_is_overwritten_without_force(run, made, tmp_path):
    out = tmp_path / "out.mcap"
    Path(f"{out}.labels.json").write_text("old")
    refused = run("simulate", "street-straight", *SMALL, "-o", out)
    assert refused.exit_code == 2
    assert "--force overwrites it" in refused.stderr
    assert run("simulate", "street-straight", *SMALL, "-o", out, "--force").exit_code == 0
    assert not Path(f"{out}.labels.json").exists()  # nothing stale beside it


def test_an_attack_that_names_no_object_takes_one_that_stays(run, made_world, tmp_path):
    made_world((3, 22.0, 3.0), (4, 40.0, -3.0))  # the nearer one, larger at first, is soon passed
    out = tmp_path / "out.mcap"
    sizes = ("--size", "960x720", "--duration", "4", "--frame-rate", "10")
    spec = "detections-hide:start=15,stop=30"
    result = run("simulate", "street-straight", *sizes, "--attack", spec, "-o", out)
    assert result.exit_code == 0, result.output
    (label,) = read_labels(f"{out}.labels.json")
    assert (label.object, label.stop_frame) == ("2", 30)
    assert "object 2 was chosen, as it stays in view" in result.stdout


def test_a_bad_attack_fails_before_anything_is_rendered(run, made, tmp_path):
    result = run(
        "simulate",
        "corridor",
        *SMALL,
        "--attack",
        "odometry-offset:rate=1,start=99",
        "-o",
        tmp_path / "x.mcap",
    )
    assert result.exit_code == 2
    assert not list(tmp_path.iterdir())


def test_help_lists_the_scenarios(run):
    result = run("simulate", "--help")
    assert result.exit_code == 0
    for name in shipped_scenarios():
        assert name in result.stdout
