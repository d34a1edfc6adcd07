"""The sidecar: written, read back, and refused where it is not one."""

import json

import pytest

from belie.attacks import AttackLabel, attack, labels_path, read_labels, write_labels
from belie.types import AlertType, RecordingError


@pytest.fixture
def labels(curve):
    return attack(
        curve(), ["odometry-bias:rate=0.05,start=9,seed=7", "camera-freeze:start=12,stop=15"]
    ).labels


def test_round_trip(labels, tmp_path):
    path = labels_path(tmp_path / "out.mcap")
    write_labels(path, labels)
    assert path.name == "out.mcap.labels.json"
    assert read_labels(path) == labels
    assert isinstance(read_labels(str(path))[0].alert, AlertType)
    assert isinstance(read_labels(path)[0], AttackLabel)


def test_objects_are_written_and_older_files_read(curve, tmp_path):
    specs = ["detections-swap:start=9", "odometry-freeze:start=9"]
    labels = attack(curve(), specs).labels
    path = labels_path(tmp_path / "out.mcap")
    write_labels(path, labels)
    document = json.loads(path.read_text())
    assert [(entry["object"], entry["other"]) for entry in document["labels"]] == [("1", "2"), (None, None)]
    assert read_labels(path) == labels
    for entry in document["labels"]:
        del entry["object"], entry["other"]
    path.write_text(json.dumps(document))
    assert [label.object for label in read_labels(path)] == [None, None]


def damage(document, how):
    label = document["labels"][0]
    match how:
        case "version":
            document["version"] = 99
        case "format":
            document["format"] = "something else"
        case "missing":
            del label["onset_ns"]
        case "extra":
            label["magnitude"] = 3
        case "alert":
            label["alert"] = "bad_mood"
        case "type":
            label["start_frame"] = "soon"
        case "order":
            label["onset_ns"] = 0
        case "none":
            document["labels"] = None
        case "list":
            return [document]
    return document


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ("version", "version 99, this belie reads 1"),
        ("format", "holds no attack labels"),
        ("list", "holds no attack labels"),
        ("missing", r"labels\.0\.onset_ns"),
        ("extra", r"labels\.0\.magnitude"),
        ("alert", r"labels\.0\.alert"),
        ("type", r"labels\.0\.start_frame"),
        ("order", "out of order"),
        ("none", "malformed label"),
    ],
)
def test_damage_is_named_in_one_line(labels, tmp_path, how, says):
    path = tmp_path / "labels.json"
    write_labels(path, labels)
    path.write_text(json.dumps(damage(json.loads(path.read_text()), how)))
    with pytest.raises(RecordingError, match=says) as caught:
        read_labels(path)
    assert "\n" not in str(caught.value)
    assert "labels.json" in str(caught.value)


def test_files_that_are_none(labels, tmp_path):
    with pytest.raises(RecordingError, match="No such file"):
        read_labels(tmp_path / "nothing.json")
    (tmp_path / "text.json").write_bytes(b"\xff\xfe not json")
    with pytest.raises(RecordingError, match="is not JSON"):
        read_labels(tmp_path / "text.json")
    with pytest.raises(RecordingError, match="cannot write labels"):
        write_labels(tmp_path / "no" / "folder.json", labels)
