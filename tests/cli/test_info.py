"""``belie info``: also of bags that cannot be checked."""

from dataclasses import replace

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from belie.recordings import messages, open_recording, write_mcap


def write_bag(folder, topics):
    """A bag with three messages on each of some (topic, type, message maker)."""
    path = folder / "bag"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        for topic, message_type, make in topics:
            connection = bag.add_connection(topic, message_type, typestore=messages.STORE)
            for index in range(3):
                stamp_ns = 10**9 + index * 10**8
                data = messages.STORE.serialize_cdr(make(stamp_ns), message_type)
                bag.write(connection, stamp_ns, data)
    return path


def image(stamp_ns):
    return messages.image(np.zeros((48, 64), np.uint8), stamp_ns, "cam", "mono8")


IMAGE = "sensor_msgs/msg/Image"


def test_a_folder(run, drive):
    result = run("info", drive, "--all")
    assert result.exit_code == 0, result.output
    assert "(kitti)" in result.stdout
    assert "longest gap [s]" in result.stdout
    assert "focal length 260.00 260.00 px, principal point 159.50 119.50 px" in result.stdout
    assert "x right, y down, z forward" in result.stdout
    assert "position  no such stream" in result.stdout
    assert "joined 90 frames: no message late, missing or out of order" in result.stdout


def test_topics_that_are_used_are_marked(run, attacked):
    lines = run("info", attacked).stdout.splitlines()
    marked = {line.split()[1] for line in lines if line.startswith("*")}
    assert marked == {"/odom", "/image_0/compressed", "/camera_info"}


def test_a_bag_without_camera_info_is_listed_and_says_what_is_missing(run, tmp_path):
    result = run("info", write_bag(tmp_path, [("/cam/image", IMAGE, image)]))
    assert result.exit_code == 2
    assert "/cam/image" in result.stdout
    assert "10.00" in result.stdout
    assert result.stderr.count("\n") == 1
    assert "no camera info for /cam/image" in result.stderr


def test_two_image_topics_are_named_with_the_flag(run, tmp_path):
    path = write_bag(tmp_path, [("/left/image", IMAGE, image), ("/right/image", IMAGE, image)])
    for command in ("info", "check"):
        result = run(command, path)
        assert result.exit_code == 2
        assert "/left/image, /right/image; name one with --image" in result.stderr
        assert result.stderr.count("\n") == 1


def test_an_odometry_that_is_too_slow_to_be_judged_is_told(run, drive, tmp_path):
    recording = open_recording(drive)
    slow = (
        replace(step, claims=step.claims if i % 2 == 0 else ()) for i, step in enumerate(recording.steps())
    )
    path = tmp_path / "slow.mcap"
    write_mcap(path, slow, cameras=recording.cameras, body_axes=recording.body_axes)
    said = "claims are 200 ms apart, more than 0.15 s: set streams.longest_gap_s = 0.24"
    assert f"not judged: /odom: {said}" in run("info", path).stdout
    assert f'"reason": "{said}"' in run("check", path, "--json", "-").stdout
    assert "not judged" not in run("info", drive).stdout


@pytest.mark.parametrize("name", ["missing.mcap", "text.mcap"])
def test_what_is_no_recording(run, tmp_path, name):
    (tmp_path / "text.mcap").write_text("hello")
    result = run("info", tmp_path / name)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1
