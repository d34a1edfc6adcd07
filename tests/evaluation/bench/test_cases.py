"""The matrix of a suite, and the keys by which finished runs are known."""

import os
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from belie.evaluation.bench.cases import AttackCase, DriveCase, RunCase, recordings_of, runs_of
from belie.evaluation.bench.suite import (
    commented_keys,
    load_suite,
    parse_suite,
    shipped_suites,
    suite_keys,
    suite_text,
)
from belie.types import ConfigError

SUITE = {
    "title": "mine",
    "rivals": ["default", "paper"],
    "drives": [{"scenarios": ["street-straight"], "weathers": ["sunny", "night"], "seeds": [1, 2]}],
    "attacks": [
        {"family": "lateral", "specs": ["odometry-offset:axis=y,rate={x}"], "magnitudes": [0.2, 0.1]}
    ],
}


def test_every_recording_meets_every_attack_and_every_detector_honest_first():
    matrix = runs_of(parse_suite(SUITE))
    assert len(matrix) == 4
    for _, cases in matrix:
        assert len(cases) == 2 * 3
        assert [case.attack is None for case in cases] == [True, False, False] * 2
    specs = {case.attack.spec for case in matrix[0][1] if case.attack}
    assert specs == {f"odometry-offset:axis=y,rate={x},start=100" for x in ("0.2", "0.1")}


def test_a_key_tells_apart_whatever_the_outcome_follows_from():
    first, *others = recordings_of(parse_suite(SUITE))
    attack = AttackCase(family="f", goal="OS", spec="odometry-freeze:start=40", onset=40)
    case = RunCase(recording=first, attack=attack, rival="default")
    variants = [
        replace(case, rival="paper"),
        replace(case, attack=None),
        replace(case, attack=replace(attack, spec="odometry-freeze:start=41")),
        *(replace(case, recording=other) for other in others),
        replace(case, recording=replace(first, sensor_seed=9)),
    ]
    keys = [case.key("k"), case.key("other settings"), *(variant.key("k") for variant in variants)]
    assert len(set(keys)) == len(keys)
    # What the tables call an attack is no reason to run it again.
    assert replace(case, attack=replace(attack, family="renamed")).key("k") == case.key("k")


def test_fresh_sensor_seeds_share_the_pictures(tmp_path):
    from belie.evaluation.bench.pictures import Pictures

    drives = {**SUITE["drives"][0], "weathers": ["sunny"], "seeds": [1], "sensor_seeds": [1, 2]}
    cases = recordings_of(parse_suite({**SUITE, "drives": [drives]}))
    bags = {Pictures(scenario=case.scenario, cache=tmp_path).bag for case in cases}
    assert [case.sensor_seed for case in cases] == [1, 2]
    assert len(bags) == 1
    assert cases[0].key != cases[1].key


def test_attacks_are_tried_only_where_they_are_meant():
    attacks = [{**SUITE["attacks"][0], "where": ["highway"]}]
    matrix = runs_of(parse_suite({**SUITE, "attacks": attacks}))
    assert all(case.attack is None for _, cases in matrix for case in cases)


@pytest.mark.parametrize("name", shipped_suites())
def test_every_shipped_suite_is_well_formed(name, monkeypatch, tmp_path):
    for folder in ("kitti00", "kitti06"):
        (tmp_path / folder).mkdir()
    monkeypatch.setenv("BELIE_DATA", str(tmp_path))
    from belie.attacks import parse_attack

    suite = load_suite(name)
    for _, cases in runs_of(suite):
        for case in cases:
            if case.attack is not None:
                parse_attack(case.attack.spec)
    assert suite.title
    assert suite.description


@pytest.mark.parametrize("name", shipped_suites())
def test_no_patch_works_in_an_honest_drive(name, monkeypatch, tmp_path):
    for folder in ("kitti00", "kitti06"):
        (tmp_path / folder).mkdir()
    monkeypatch.setenv("BELIE_DATA", str(tmp_path))
    for case in recordings_of(load_suite(name)):
        if isinstance(case, DriveCase) and case.scenario.scene == "patch":
            assert case.scenario.sensors.object_detector.patch == "none"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"drives": []}, "nothing to run"),
        (
            {"drives": [{"scenarios": ["street-straight"], "weather": "sunny"}]},
            "drives.0.weather: Extra inputs",
        ),
        (
            {"drives": [{"scenarios": ["street-straight"], "weathers": ["hail"]}]},
            "drives.0.weathers.0: Input should be",
        ),
    ],
)
def test_a_suite_that_makes_no_sense_is_refused_with_the_key(change, said):
    with pytest.raises(ConfigError, match=said):
        parse_suite({**SUITE, **change})


def test_a_missing_recording_says_how_to_find_it(monkeypatch):
    monkeypatch.delenv("BELIE_DATA", raising=False)
    with pytest.raises(ConfigError, match="set BELIE_DATA"):
        recordings_of(parse_suite({"title": "t", "real": [{"paths": ["no/such/folder"]}]}))


def recorded(tmp_path, **changes):
    (tmp_path / "drive.mcap").touch()
    real = {"paths": [str(tmp_path / "drive.mcap")], "claims": "recorded", "seeds": [1, 2], **changes}
    return recordings_of(parse_suite({"title": "t", "real": [real]}))


def test_a_recording_with_its_own_claims_is_one_whatever_the_seeds(tmp_path):
    (case,) = recorded(tmp_path, position="/gnss")
    assert case.name == "drive.mcap recorded"
    assert case.streams == (("position", "/gnss"),)


def test_detections_are_found_beside_the_recording_and_known_by_their_file(tmp_path):
    (tmp_path / "boxes.csv").touch()
    (case,) = recorded(tmp_path, detections="boxes.csv")
    assert case.streams == (("detections", str(tmp_path / "boxes.csv")),)
    before = case.key
    os.utime(tmp_path / "boxes.csv", (1, 1))
    assert case.key != before != recorded(tmp_path)[0].key
    with pytest.raises(ConfigError, match=r"bokses\.csv: no such file here or beside"):
        recorded(tmp_path, detections="bokses.csv")


def test_streams_are_named_of_recorded_claims_only(tmp_path):
    with pytest.raises(ConfigError, match=r'real\.0: .*detections .* set claims = "recorded"'):
        recorded(tmp_path, claims="noisy", detections="boxes.csv")


DOCUMENT = (Path(__file__).parents[3] / "docs" / "benchmark.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("table", "keys"), list(suite_keys()))
def test_every_key_is_documented_as_it_is(table, keys):
    rows = [
        f"| `{name}` | {default if default in ('needed', '–') else f'`{default}`'} | {meaning} |"
        for name, default, meaning in keys
    ]
    head = f"| {f'`{table}`' if '[' in table else table} | if left out | |\n|---|---|---|\n"
    assert head + "\n".join(rows) + "\n\n" in DOCUMENT


def test_the_examples_of_the_document_are_suites():
    examples = re.findall(r"```toml\n(.*?)```", DOCUMENT, re.DOTALL)
    assert examples
    for text in examples:
        parse_suite(tomllib.loads(text))


def test_keys_can_be_printed_below_a_suite():
    text = f"{suite_text('quick')}\n{commented_keys()}"
    assert parse_suite(tomllib.loads(text)) == load_suite("quick")
    assert "#   within (–): frames within which" in text
