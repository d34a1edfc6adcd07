"""A scenario as a recording: what it hands out, that it is the same again, and what lies beside it."""

import json

import cv2
import numpy as np
import pytest

from belie.attacks import attack
from belie.geometry import SE3
from belie.recordings import open_recording, write_mcap
from belie.simulation.preview import Preview
from belie.simulation.simulate import SimulatedRecording
from belie.simulation.truth import objects_line, write_objects, write_trajectory
from belie.types import DetectionClaim, MotionClaim, PoseClaim, PositionClaim, RecordingError


def simulated(made, views=None, **changes):
    on_view = None if views is None else views.append
    return SimulatedRecording(
        made.scenario(**changes), world=made.world, stage_opener=made.open_stage, on_view=on_view
    )


def test_every_sensor_speaks_at_its_rate(made):
    recording = simulated(made)
    steps = list(recording.steps())
    assert [step.frame.stamp_ns for step in steps] == recording.frame_stamps_ns().tolist()
    claims = [claim for step in steps for claim in step.claims]
    counts = {}
    for claim in claims:
        counts[claim.source, type(claim)] = counts.get((claim.source, type(claim)), 0) + 1
    assert counts == {
        ("/imu/data", MotionClaim): 2.9 * 200 + 1,
        ("/odom", PoseClaim): 2.9 * 50 + 1,
        ("/odom", MotionClaim): 2.9 * 50 + 1,
        ("/gnss/fix", PositionClaim): 30,
        ("/detections", DetectionClaim): 30,
    }
    for step in steps[1:-1]:
        stamps = {}
        for claim in step.claims:
            stamps.setdefault(claim.source, []).append(claim.stamp_ns)
        assert max(stamps["/imu/data"]) == step.frame.stamp_ns


@pytest.mark.slow
def test_the_same_again_and_another_seed_is_another(made):
    def first(recording):
        step = next(recording.steps())
        position = next(claim for claim in step.claims if isinstance(claim, PositionClaim))
        return step.frame.image, position.position_m

    a, b, c = simulated(made), simulated(made), simulated(made, seed=2)
    for ours, theirs in zip(first(a), first(b), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert not np.array_equal(first(a)[1], first(c)[1])
    twice = [[claim.received_ns for step in a.steps() for claim in step.claims] for _ in range(2)]
    assert twice[0] == twice[1]


def test_written_and_read_again_it_is_the_same(made, tmp_path):
    recording = simulated(made, sensors={"gnss": {"rate_hz": 5}})
    ours = list(recording.steps())
    write_mcap(tmp_path / "out.mcap", ours, cameras=recording.cameras, body_axes="flu")
    back = open_recording(tmp_path / "out.mcap")
    theirs = list(back.steps())
    assert [step.frame.stamp_ns for step in theirs] == [step.frame.stamp_ns for step in ours]
    np.testing.assert_array_equal(theirs[7].frame.image, ours[7].frame.image)
    sent = sorted((c.source, c.stamp_ns) for step in ours for c in step.claims)
    got = sorted((c.source, c.stamp_ns) for step in theirs for c in step.claims)
    assert got == sent
    assert not back.join_counts.late.total()
    seen = [d for step in theirs for c in step.claims if isinstance(c, DetectionClaim) for d in c.detections]
    assert {d.label for d in seen} >= {"car", "truck"}


def test_attack_labels_need_no_second_rendering(made):
    recording = simulated(made)
    spec = "odometry-offset:axis=left,rate=0.2,start=10,stop=20"
    with pytest.raises(ValueError, match="to their end"):
        recording.replayed()
    attacked = list(attack(recording, spec).steps())
    assert len(attacked) == 30
    (label,) = attack(recording.replayed(), spec).labels
    assert len(made.opened) == 1
    assert (label.start_frame, label.sources) == (10, ("/odom",))
    poses = [c for step in attacked for c in step.claims if isinstance(c, PoseClaim)]
    lies = [c for c in poses if c.stamp_ns >= label.onset_ns and c.stamp_ns < label.end_ns]
    assert max(abs(c.T_odom_body.t[1]) for c in lies) > 1.5


def test_truth_beside(made, tmp_path):
    views = []
    recording = simulated(made, views)
    for _ in recording.steps():
        pass
    write_trajectory(tmp_path / "t.tum", recording.true_poses())
    rows = [line.split() for line in (tmp_path / "t.tum").read_text().splitlines() if line[0] != "#"]
    assert len(rows) == 30
    assert int(rows[10][0].replace(".", "")) == views[10].frame.stamp_ns
    assert float(rows[10][1]) == pytest.approx(8.0)
    write_objects(tmp_path / "o.jsonl", [objects_line(view) for view in views])
    first = json.loads((tmp_path / "o.jsonl").read_text().splitlines()[0])
    car = next(entry for entry in first["objects"] if entry["id"] == 3)
    T_cam_obj = SE3.from_quat_xyzw(car["quat_cam_xyzw"], car["position_cam_m"])
    np.testing.assert_allclose((made.world.T_body_cam @ T_cam_obj).t, [40.0, 4.0, 0.75], atol=1e-3)
    assert car["label"] == "car"


@pytest.mark.parametrize("suffix", [".png", ".mp4"])
def test_preview(made, tmp_path, suffix):
    path = tmp_path / f"look{suffix}"
    recording = simulated(made, duration_s=1.0)
    with Preview(path, frame_count=10, rate_hz=10) as preview:
        recording._on_view = preview.add
        for _ in recording.steps():
            pass
    if suffix == ".png":
        assert cv2.imread(str(path)).shape == (480, 960, 3)
        return
    video = cv2.VideoCapture(str(path))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 10
    ok, frame = video.read()
    assert ok
    assert frame.shape == (240, 320, 3)
    blue, green, red = (frame[..., i].astype(int) for i in range(3))
    assert (np.maximum(np.maximum(blue, green), red) - np.minimum(np.minimum(blue, green), red)).max() > 80


def test_preview_refuses_other_endings(tmp_path):
    with pytest.raises(RecordingError, match=r"must end in \.mp4 or \.png"):
        Preview(tmp_path / "look.gif", frame_count=3, rate_hz=10)
