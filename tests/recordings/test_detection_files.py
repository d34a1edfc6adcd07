"""Detections from files beside a recording: KITTI tracking labels, MOT text and CSV, on folders, videos and bags."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from belie.geometry import SE3, CameraModel
from belie.recordings import open_recording, write_mcap
from belie.recordings.detection_files import read_detections, read_names
from belie.recordings.detection_rows import on_frames
from belie.types import DetectionClaim, RecordingError

KITTI = """\
0 1 Car 0 0 -1.57 10 20 30 40 1.5 1.8 4.2 -4.5 1.8 13.4 -1.570796
0 -1 DontCare -1 -1 -10 1 2 3 4 -1000 -1000 -1000 -10 -1 -1 -1
2 1 Car 0 0 -1.57 12 20 32 40 1.5 1.8 4.2 -4.5 1.8 12.4 -1.570796 0.8
3 2 Pedestrian 0 0 0 -9 5 7 30 -1 -1 -1 -1000 -1000 -1000 -10
"""
MOT_TRUTH = "1,7,11,21,30,10,1,3,0.9\n1,8,1,1,5,5,0,1,1\n3,9,1,1,20,20,1,1,0.5\n"
CSV = """\
frame,track_id,label,score,left,top,right,bottom,x,y,z
0,a,car,0.5,1,2,30,40,0,1,20
1,,,,,,,,,,
3,b,van,,5,5,9,9,,,
"""
MODEL = CameraModel(width=64, height=48, fx=60, fy=60, cx=31.5, cy=23.5)
FRAMES = 5


@pytest.fixture
def folder(tmp_path, image_folder):
    """A KITTI folder of five frames of 64 x 48."""
    root = tmp_path / "drive"
    root.mkdir()
    image_folder(root / "image_0", FRAMES)
    (root / "calib.txt").write_text("P0: 60 0 31.5 0 0 60 23.5 0 0 0 1 0\n")
    (root / "times.txt").write_text("\n".join(f"{0.1 * k:.6f}" for k in range(FRAMES)) + "\n")
    return root


def write(tmp_path, text, name="boxes.txt"):
    path = tmp_path / name
    path.write_text(text)
    return path


def claims(recording):
    return [
        (index, claim)
        for index, step in enumerate(recording.steps())
        for claim in step.claims
        if isinstance(claim, DetectionClaim)
    ]


def told(recording):
    return {index: [d.label for d in claim.detections] for index, claim in claims(recording)}


def test_kitti_labels(tmp_path, folder):
    recording = open_recording(folder, detections=str(write(tmp_path, KITTI)))
    assert told(recording) == {0: ["Car"], 1: [], 2: ["Car"], 3: ["Pedestrian"]}
    (_, first), *_ = claims(recording)
    (car,) = first.detections
    assert (first.source, first.stamp_ns, car.track_id, car.score) == ("/detections", 0, "1", 1.0)
    assert car.box_px.tolist() == [10, 20, 30, 40]
    assert car.dimensions_m.tolist() == [4.2, 1.8, 1.5]
    np.testing.assert_allclose(car.position_m, [-4.5, 1.8 - 0.75, 13.4])
    # It faces away from us: forward along the optical axis, left to the left, up against y.
    np.testing.assert_allclose(car.T_cam_obj.R, [[0, -1, 0], [0, 0, -1], [1, 0, 0]], atol=1e-6)
    person = claims(recording)[3][1].detections[0]
    assert (person.T_cam_obj, person.dimensions_m) == (None, None)
    assert person.box_px.tolist() == [0, 5, 7, 30]
    stream = next(stream for stream in recording.streams if stream.role == "detections")
    assert (stream.message_type, stream.used, stream.count) == ("boxes.txt (KITTI tracking labels)", True, 4)


def test_kitti_places_are_those_of_the_reference_camera(tmp_path, folder):
    (folder / "calib.txt").write_text("P0: 60 0 31.5 -30 0 60 23.5 0 0 0 1 0\n")
    recording = open_recording(folder, detections=str(write(tmp_path, KITTI)))
    assert claims(recording)[0][1].detections[0].position_m[0] == pytest.approx(-4.5 - 0.5)


@pytest.mark.parametrize("rotation_y", [-2.5, -0.3, 0.0, 1.2])
def test_kitti_corners_are_those_of_its_development_kit(tmp_path, rotation_y):
    height, width, length, bottom = 1.5, 1.8, 4.2, np.array([2.0, 1.6, 15.0])
    line = f"0 1 Car 0 0 0 1 2 3 4 {height} {width} {length} 2.0 1.6 15.0 {rotation_y}\n"
    (row,) = read_detections(write(tmp_path, line)).rows
    cosine, sine = np.cos(rotation_y), np.sin(rotation_y)
    R_y = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])  # computeBox3D.m
    theirs = [
        R_y @ [x * length / 2, y * height, z * width / 2] + bottom
        for x in (-1, 1)
        for y in (0, -1)
        for z in (-1, 1)
    ]
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    ours = row.detection.T_cam_obj.apply(0.5 * signs * row.detection.dimensions_m)
    assert sorted(np.round(theirs, 6).tolist()) == sorted(np.round(ours, 6).tolist())
    forward = row.detection.T_cam_obj.R[:, 0]
    np.testing.assert_allclose(forward, R_y @ [1, 0, 0])


def test_mot_truth_and_detections(tmp_path, folder):
    recording = open_recording(folder, detections=str(write(tmp_path, MOT_TRUTH)))
    assert told(recording) == {0: ["car"], 1: [], 2: ["pedestrian"]}
    car = claims(recording)[0][1].detections[0]
    assert (car.track_id, car.box_px.tolist()) == ("7", [10, 20, 40, 30])
    names = write(tmp_path, "human\nrider\nauto\n", "names.txt")
    boxes = str(write(tmp_path, MOT_TRUTH))
    assert told(open_recording(folder, detections=boxes, detection_names=names))[0] == ["auto"]
    raw = write(tmp_path, "1,-1,5,5,9,9,12.5,-1,-1,-1\n", "det.txt")
    (found,) = claims(open_recording(folder, detections=str(raw)))
    assert (found[1].detections[0].track_id, found[1].detections[0].score) == ("", 1.0)


def test_csv(tmp_path, folder):
    recording = open_recording(folder, detections=str(write(tmp_path, CSV, "boxes.csv")))
    assert told(recording) == {0: ["car"], 1: [], 2: [], 3: ["van"]}
    car = claims(recording)[0][1].detections[0]
    assert (car.score, car.track_id, car.position_m.tolist()) == (0.5, "a", [0, 1, 20])
    assert claims(recording)[3][1].detections[0].score == 1.0


def test_csv_by_time(tmp_path, folder):
    def stamped(*times_s):
        lines = [f"{time},car,1,2,30,40" for time in times_s]
        path = write(tmp_path, "\n".join(["stamp_s,label,left,top,right,bottom", *lines]) + "\n", "t.csv")
        found = claims(open_recording(folder, detections=str(path)))
        return [(index, claim.stamp_ns // 10**6, len(claim.detections)) for index, claim in found]

    # Rounded to the milliseconds; the empty frame between is one that was looked at.
    assert stamped(0.0, 0.1, 0.301) == [(0, 0, 1), (1, 100, 1), (2, 200, 0), (3, 300, 1)]
    # A slower detector is blind between its messages, not empty; as ever, the first claim after a frame comes with it.
    assert stamped(0.0, 0.2, 0.4) == [(0, 0, 1), (1, 200, 1), (3, 400, 1)]
    # Its own times stay its own.
    assert stamped(0.05, 0.15) == [(0, 50, 1), (1, 150, 1)]


def test_what_is_out_of_the_image_is_left_out_and_counted(tmp_path, folder):
    text = "frame,label,left,top,right,bottom\n0,car,-20,0,-1,9\n0,van,60,40,99,99\n1,car,3,3,3,9\n"
    recording = open_recording(folder, detections=str(write(tmp_path, text)))
    assert told(recording) == {0: ["van"], 1: []}
    assert claims(recording)[0][1].detections[0].box_px.tolist() == [60, 40, 64, 48]
    assert recording.join_counts.outside["/detections"] == 2
    (warning,) = recording.warnings
    assert (
        "2 of 3 boxes have no area inside the image of 64x48 px (first in line 2) and are left out; give left"
        in warning
    )


def test_rows_that_stand_there_twice_are_left_out_and_counted(tmp_path, folder):
    header, *lines = CSV.splitlines()
    doubled = "\n".join([header, *lines, lines[0].replace(",a,", ",c,"), *lines]) + "\n"
    recording = open_recording(folder, detections=str(write(tmp_path, doubled)))
    assert told(recording) == {0: ["car", "car"], 1: [], 2: [], 3: ["van"]}  # another id is another object
    assert recording.join_counts.repeated["/detections"] == 2
    (warning,) = recording.warnings
    assert "2 of 5 boxes stand in the file more than once (first in line 6) and are left out" in warning
    assert open_recording(folder, detections=str(write(tmp_path, CSV))).warnings == ()


def test_csv_as_spreadsheets_write_it(tmp_path, folder):
    text = 'frame,label,left,top,right,bottom\n0,"car, parked",1,2,30,40\n'
    path = tmp_path / "excel.csv"
    path.write_text(text, encoding="utf-8-sig")
    assert told(open_recording(folder, detections=str(path))) == {0: ["car, parked"]}


def test_the_documented_way_from_json(tmp_path, folder, monkeypatch):
    page = (Path(__file__).parents[2] / "docs" / "detection-files.md").read_text(encoding="utf-8")
    (lines,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    boxes = [{"frame": 0, "track_id": 7, "label": "car", "xyxy": [1, 2, 30, 40]}]
    (tmp_path / "boxes.json").write_text(json.dumps(boxes))
    monkeypatch.chdir(tmp_path)
    exec(lines, {})
    ((_, claim),) = claims(open_recording(folder, detections=str(tmp_path / "boxes.csv")))
    (car,) = claim.detections
    assert (car.track_id, car.label, car.score, car.box_px.tolist()) == ("7", "car", 1.0, [1, 2, 30, 40])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (KITTI.replace("3 2 Ped", "5 2 Ped"), r"line 4: frame 5 \(from 0\), but the recording has 5 frames"),
        (KITTI.replace("12.4", "nan"), r"line 3: expected KITTI's 17 or 18 fields"),
        (KITTI + "3 4 Car 0\n", r"line 5: expected KITTI's .* found 4 fields"),
        (
            KITTI.replace("12 20 32 40", "12 20 2 40"),
            r"line 3: expected left, top, right, bottom, found 12 20 2 40: right is less than left; where",
        ),
        (KITTI.replace("2 1 Car", "x 1 Car"), r"line 3: expected frame and track id"),
        (MOT_TRUTH + "0,1,1,1,2,2,1,1,1\n", r"line 4: frame 0, but MOT counts frames from 1"),
        (MOT_TRUTH + "6,1,1,1,2,2,1,1,1\n", r"line 4: frame 5 \(from 0\), but"),
        (MOT_TRUTH + "2,1,1,1,-2,2,1,1,1\n", r"line 4: .* a box of -2 x 2 px"),
        (MOT_TRUTH + "2,1,1,1,2,2,1,44,1\n", r"line 4: class 44 has no name; there are 12"),
        (MOT_TRUTH + "2,1,inf,1,2,2,1,1,1\n", r"line 4: expected MOT's"),
        (CSV + "1,a,car,0.5,1,2\n", r"line 5: expected the 11 fields of the header, found 6"),
        (CSV + "1.5,a,car,0.5,1,2,3,4,,,\n", r"line 5: expected a frame number, found '1.5'"),
        (CSV + ",a,car,0.5,1,2,3,4,,,\n", r"line 5: expected a frame number, or a time"),
        (CSV + "1,a,car,7,1,2,3,4,,,\n", r"line 5: expected a score from 0 to 1, found 7"),
        (CSV + "1,a,car,0.5,1,nan,3,4,,,\n", r"line 5: expected the numbers left, top"),
        (CSV + "1,a,car,0.5,1,,3,4,,,\n", r"line 5: expected left, top, right, bottom, all or none"),
        (CSV + "1,a,,0.5,1,2,3,4,,,\n", r"line 5: track_id without a label"),
        (CSV + "1,a,car,0.5,,,,,,,\n", r"line 5: 'car' has neither a box nor a place"),
        ("frame,label,colour\n", r"line 1: no column is called 'colour'; known are frame"),
        ("frame,label,left\n", r"line 1: the column top is missing"),
        ("frame,stamp_s,label\n", r"line 1: expected one column of frame, stamp_ns, stamp_s, found 2"),
        ("frame,label\n", r"line 1: expected the columns left"),
        ("frame,label,label\n", r"line 1: a column stands there twice"),
        (
            "stamp_s,label,left,top,right,bottom\n9.5,car,1,2,3,4\n",
            r"line 2: 9.500000 s, but the frames run from",
        ),
        ("stamp_s,label,left,top,right,bottom\nsoon,car,1,2,3,4\n", r"line 2: 'soon' is no time"),
        ("frame,left,top,right,bottom\n", r"line 1: the column label is missing"),
        ("frame,label,left,top,width,height\n", r"line 1: found left, top, width, height; give edges"),
        ('frame,label,left,top,right,bottom\n0,"car,1,2,3,4\n', r"line 2: .*; check its quotes"),
        (CSV.replace(",", ";"), r"separates its columns by semicolons; write it with commas"),
        ("0,1,car,0.9,1,2,3,4\n", r"has no header: it starts with '0,1,car"),
        (KITTI[len("0 1 ") :], r"KITTI's object labels .*; put both before each line"),
        ("0 1 Car 0 0 -10 1 2 3\n", r"line 1: expected KITTI's 17 or 18 fields.* found 9 fields"),
        ('{"objects": [{"label": "car, left, top"}]}', r"is JSON; docs/detection-files.md shows"),
        ('[{"image_id": 1, "bbox": [1, 2, 3, 4]}]', r"is COCO's JSON; docs/detection-files.md"),
        ("hello\n", r"holds no detections that belie knows: it starts with 'hello'"),
        ("", r"is empty"),
        (CSV.splitlines()[0] + "\n", r"holds a header and no detection; leave it out, or say"),
    ],
)
def test_malformed_files_are_named_in_one_line(tmp_path, folder, text, says):
    with pytest.raises(RecordingError, match=says) as caught:
        open_recording(folder, detections=str(write(tmp_path, text)))
    assert "\n" not in str(caught.value)
    assert "boxes.txt" in str(caught.value)


@pytest.mark.parametrize("content", [CSV.encode("utf-16"), b"\x89PNG\r\n\x1a\n", CSV.encode() + b"4,\xfc\n"])
def test_what_is_no_text_is_told_the_formats(tmp_path, folder, content):
    path = tmp_path / "boxes.csv"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"if it is text, save it as UTF-8; belie reads KITTI") as caught:
        open_recording(folder, detections=str(path))
    assert "codec" not in str(caught.value)


def test_edges_as_shares_of_the_image_are_told(tmp_path, folder):
    header, rows = "frame,label,left,top,right,bottom\n", "0,car,0.1,0.2,0.5,0.9\n1,car,0.1,0.2,1,1\n"
    (warning,) = open_recording(folder, detections=str(write(tmp_path, header + rows))).warnings
    assert "its 2 boxes all lie within 2 px" in warning
    assert "multiply left and right by 64, top and bottom by 48" in warning
    rows += "2,car,1,2,30,40\n"
    assert open_recording(folder, detections=str(write(tmp_path, header + rows))).warnings == ()


def test_times_in_another_unit_are_told(tmp_path, folder):
    header, rows = "stamp_ns,label,left,top,right,bottom\n", "0,car,1,2,30,40\n100,car,1,2,31,40\n"
    (warning,) = open_recording(folder, detections=str(write(tmp_path, header + rows))).warnings
    assert "its 2 times all lie within 0.000000 s" in warning
    assert "if they are milliseconds, write them as nanoseconds" in warning
    rows = rows.replace("100,", "100000000,")
    assert open_recording(folder, detections=str(write(tmp_path, header + rows))).warnings == ()


def test_a_folder_is_told_as_one(tmp_path, folder):
    with pytest.raises(RecordingError, match="a folder, where one file for all frames is needed, and"):
        open_recording(folder, detections=str(tmp_path))


def test_a_missing_file_says_so(folder):
    with pytest.raises(RecordingError, match=r"--detections none\.txt: no such file, .* format kitti"):
        open_recording(folder, detections="none.txt")


def test_names_must_be_there(tmp_path):
    with pytest.raises(RecordingError, match="holds no names"):
        read_names(write(tmp_path, "\n"))


def test_a_file_beside_a_bag_takes_the_place_of_its_topic(tmp_path, new_bag):
    bag = new_bag().drive().write()
    recording = open_recording(bag, detections=str(write(tmp_path, CSV)))
    found = claims(recording)
    assert told(recording) == {0: ["car"], 1: [], 2: [], 3: ["van"]}
    assert [claim.stamp_ns for _, claim in found] == recording.frame_stamps_ns()[:4].tolist()
    assert [type(claim).__name__ for step in recording.steps() for claim in step.claims].count(
        "PoseClaim"
    ) == 5
    written = tmp_path / "out.mcap"
    write_mcap(written, recording, cameras=recording.cameras, body_axes=recording.body_axes)
    assert told(open_recording(written)) == told(recording)
    with_topic = open_recording(written, detections=str(write(tmp_path, MOT_TRUTH)))
    assert told(with_topic) == {0: ["car"], 1: [], 2: ["pedestrian"]}


def test_euroc_tum_and_video(tmp_path, image_folder):
    boxes = str(write(tmp_path, CSV))
    expected = {0: ["car"], 1: [], 2: [], 3: ["van"]}
    camera = "image_width: 64\nimage_height: 48\ncamera_matrix: {data: [60, 0, 31.5, 0, 60, 23.5, 0, 0, 1]}\n"
    camera += "distortion_model: plumb_bob\ndistortion_coefficients: {data: [0, 0, 0, 0, 0]}\n"
    tum = tmp_path / "tum"
    names = image_folder(tum / "rgb", FRAMES)
    (tum / "rgb.txt").write_text("".join(f"{1 + 0.1 * k:.3f} rgb/{name}\n" for k, name in enumerate(names)))
    (tum / "camera.yaml").write_text(camera)
    assert told(open_recording(tum, detections=boxes)) == expected
    euroc = tmp_path / "euroc"
    names = image_folder(euroc / "cam0" / "data", FRAMES)
    lines = "".join(f"{10**18 + k * 10**8},{name}\n" for k, name in enumerate(names))
    (euroc / "cam0" / "data.csv").write_text(lines)
    (euroc / "cam0" / "sensor.yaml").write_text(
        "T_BS: {data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}\nintrinsics: [60, 60, 31.5, 23.5]\n"
        "resolution: [64, 48]\ndistortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n"
    )
    assert told(open_recording(euroc, detections=boxes)) == expected
    video = tmp_path / "drive.avi"
    out = cv2.VideoWriter(str(video), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (64, 48))
    for k in range(FRAMES):
        out.write(np.full((48, 64, 3), 40 * k, np.uint8))
    out.release()
    (tmp_path / "camera.yaml").write_text(camera)
    assert told(open_recording(video, detections=boxes)) == expected


def test_a_table_on_frames_of_another_clock_is_moved(tmp_path):
    table = read_detections(write(tmp_path, CSV))
    there = on_frames(table, np.arange(5), MODEL, SE3.from_translation([0.5, 0, 0]))
    assert there.claims[0].detections[0].position_m.tolist() == [0.5, 1.0, 20.0]
