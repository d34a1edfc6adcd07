"""KITTI, EuRoC, TUM and videos: read, and one clear line for each fault."""

import itertools

import cv2
import numpy as np
import pytest

from belie.geometry import SE3, so3_exp
from belie.recordings import open_recording
from belie.types import CalibrationError, MotionClaim, PoseClaim, PositionClaim, RecordingError, TopicError

CAMERA_YAML = (
    "image_width: 64\nimage_height: 48\n"
    "camera_matrix: {rows: 3, cols: 3, data: [60, 0, 31.5, 0, 60, 23.5, 0, 0, 1]}\n"
    "distortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}\n"
)


@pytest.fixture
def kitti(tmp_path, image_folder):
    folder = tmp_path / "sequence"
    image_folder(folder / "image_0", 4)
    (folder / "calib.txt").write_text(
        "P0: 60 0 31.5 0 0 60 23.5 0 0 0 1 0\nP2: 60 0 31.5 30 0 60 23.5 0 0 0 1 0\n"
    )
    (folder / "times.txt").write_text("0\n1.037359e-01\n0.2\n0.3\n")
    rows = [f"1 0 0 {0.1 * i} 0 1 0 0 0 0 1 {i}" for i in range(4)]
    (folder / "poses.txt").write_text("\n".join(rows) + "\n")
    return folder


def test_kitti(kitti, textured):
    recording = open_recording(kitti)
    assert (recording.format, recording.body_axes, list(recording.cameras)) == ("kitti", "rdf", ["/image_0"])
    steps = list(recording.steps())
    assert [step.frame.stamp_ns for step in steps] == [0, 103_735_900, 200_000_000, 300_000_000]
    assert recording.frame_stamps_ns().tolist() == [0, 103_735_900, 200_000_000, 300_000_000]
    for index, step in enumerate(steps):
        np.testing.assert_array_equal(step.frame.image, textured(index))
        (claim,) = step.claims
        assert isinstance(claim, PoseClaim)
        assert (claim.source, claim.frame_id) == ("/odom", "world")
        np.testing.assert_allclose(claim.T_odom_body.t, [0.1 * index, 0, index])
        assert step.decode_ms > 0.0
    positions = [c for s in open_recording(kitti, position="poses").steps() for c in s.claims]
    assert sum(isinstance(c, PositionClaim) and c.kind == "localisation" for c in positions) == 4
    assert not [c for s in open_recording(kitti, odometry="none").steps() for c in s.claims]


def test_kitti_other_camera_sits_off_the_body(kitti, image_folder):
    image_folder(kitti / "image_2", 4)
    assert list(open_recording(kitti).cameras) == ["/image_0"]
    mounted = open_recording(kitti, image="image_2").cameras["/image_2"]
    np.testing.assert_allclose(mounted.T_body_cam.t, [-0.5, 0, 0])
    with pytest.raises(TopicError, match="--image image_7"):
        open_recording(kitti, image="image_7")


def test_kitti_official_layout(kitti, tmp_path):
    root = tmp_path / "dataset"
    (root / "sequences").mkdir(parents=True)
    (root / "poses").mkdir()
    kitti.rename(root / "sequences" / "07")
    (root / "sequences" / "07" / "poses.txt").rename(root / "poses" / "07.txt")
    assert sum(len(step.claims) for step in open_recording(root / "sequences" / "07").steps()) == 4


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n", "holds 1 poses for 4 images"),
        ("poses.txt", "1 0 0 0\n", "line 1: expected the 12 numbers of a 3x4 pose, found 4 fields"),
        ("poses.txt", "1 0 0 nan 0 1 0 0 0 0 1 0\n" * 4, "line 1: expected the 12 numbers"),
        ("poses.txt", "9 0 0 0 0 1 0 0 0 0 1 0\n" * 4, "line 1: the 3x3 block is not a rotation"),
        ("times.txt", "0\n0.1\n", "holds 2 times for 4 images"),
        ("times.txt", "0\nsoon\n0.2\n0.3\n", "line 2: 'soon' is no time"),
        ("times.txt", None, "times.txt is missing; .*--rate"),
        ("calib.txt", None, "calib.txt is missing"),
        ("calib.txt", "P1: 1 0 0 0 0 1 0 0 0 0 1 0\n", "no line 'P0:'"),
        ("calib.txt", "P0: 1 0 0\n", "must hold the 12 numbers"),
        ("poses.txt", b"\xff\xfe\x00", "cannot be read as text"),
    ],
)
def test_kitti_faults(kitti, file, content, message):
    if content is None:
        (kitti / file).unlink()
    else:
        (kitti / file).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(RecordingError, match=message) as error:
        open_recording(kitti)
    assert "\n" not in str(error.value)


def test_kitti_without_times_takes_a_rate(kitti):
    (kitti / "times.txt").unlink()
    assert open_recording(kitti, rate_hz=10.0).frame_stamps_ns().tolist() == [0, 10**8, 2 * 10**8, 3 * 10**8]


def test_kitti_damaged_image_is_skipped(kitti):
    (kitti / "image_0" / "000002.png").write_bytes(b"\x89PNG nonsense")
    recording = open_recording(kitti)
    assert len(list(recording.steps())) == 3
    assert recording.join_counts.undecodable == {"/image_0": 1}


@pytest.fixture
def euroc(tmp_path, image_folder):
    root = tmp_path / "MH_01" / "mav0"
    image_folder(root / "cam0" / "data", 4)
    t0 = 1_403_636_579_763_555_584
    rows = "".join(f"{t0 + i * 50_000_000},{i:06d}.png\n" for i in range(4))
    (root / "cam0" / "data.csv").write_text("#timestamp [ns],filename\n" + rows)
    T_BS = "T_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]\n"
    (root / "cam0" / "sensor.yaml").write_text(
        "sensor_type: camera\n"
        + T_BS
        + "resolution: [64, 48]\nintrinsics: [60, 61, 31.5, 23.5] #fu, fv, cu, cv\n"
        "distortion_model: radial-tangential\ndistortion_coefficients: [-0.28, 0.07, 0.0002, 0.00002]\n"
    )
    for name in ("imu0", "state_groundtruth_estimate0"):
        (root / name).mkdir()
    (root / "imu0" / "sensor.yaml").write_text(
        "T_BS: {rows: 4, cols: 4, data: [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]}"
    )
    imu = "".join(f"{t0 + i * 5_000_000},0.1,0.2,0.3,9.8,0.0,0.1\n" for i in range(31))
    (root / "imu0" / "data.csv").write_text("#timestamp\n" + imu)
    pose = SE3(so3_exp(np.array([0.1, 0.2, 0.3])), np.array([1.0, 2.0, 3.0]))
    x, y, z, w = pose.quat_xyzw()
    truth = "".join(f"{t0 + i * 5_000_000},1,2,3,{w},{x},{y},{z},0,0,0,0,0,0,0,0,0\n" for i in range(31))
    (root / "state_groundtruth_estimate0" / "data.csv").write_text("#timestamp, p, q, v, bw, ba\n" + truth)
    return root.parent, pose


def test_euroc(euroc):
    folder, T_world_body = euroc
    recording = open_recording(folder)
    assert (recording.format, recording.body_axes) == ("euroc", "flu")
    mounted = recording.cameras["/cam0"]
    np.testing.assert_array_equal(mounted.T_body_cam.t, [0.1, 0.2, 0.3])
    assert (mounted.model.model, mounted.model.fy) == ("radial_tangential", 61.0)
    claims = [claim for step in recording.steps() for claim in step.claims]
    rates = [claim for claim in claims if isinstance(claim, MotionClaim)]
    poses = [claim for claim in claims if isinstance(claim, PoseClaim)]
    assert (len(rates), len(poses)) == (31, 31)
    assert poses[3].T_odom_body.is_close(T_world_body)
    np.testing.assert_array_equal(rates[0].angular_rad_s, [0.1, 0.2, 0.3])
    assert open_recording(folder / "mav0").format == "euroc"
    assert not any(
        isinstance(c, MotionClaim) for s in open_recording(folder, imu="none").steps() for c in s.claims
    )


def test_euroc_faults(euroc):
    folder, _ = euroc
    (folder / "mav0" / "imu0" / "sensor.yaml").unlink()
    with pytest.raises(CalibrationError, match="T_BS from the sensor to the body"):
        open_recording(folder)
    with pytest.raises(TopicError, match="--image cam5"):
        open_recording(folder, image="cam5")
    table = folder / "mav0" / "state_groundtruth_estimate0" / "data.csv"
    table.write_text("1403636579763555584,1,2\n")
    with pytest.raises(RecordingError, match="line 1: expected nanoseconds and position"):
        open_recording(folder)


@pytest.fixture
def tum(tmp_path, image_folder):
    folder = tmp_path / "fr1_desk"
    names = image_folder(folder / "rgb", 4)
    rows = "".join(f"{1305031102.175304 + 0.03 * i:.6f} rgb/{name}\n" for i, name in enumerate(names))
    (folder / "rgb.txt").write_text("# color images\n# timestamp filename\n" + rows)
    poses = "".join(f"{1305031102.17 + 0.01 * i:.4f} {i} 0 0 0 0 0 1\n" for i in range(12))
    (folder / "groundtruth.txt").write_text("# timestamp tx ty tz qx qy qz qw\n" + poses)
    (folder / "camera.yaml").write_text(CAMERA_YAML)
    return folder


def test_tum(tum):
    recording = open_recording(tum)
    assert (recording.format, recording.body_axes) == ("tum", "rdf")
    steps = list(recording.steps())
    assert steps[0].frame.stamp_ns == 1305031102175304000
    assert [claim.stamp_ns for claim in steps[0].claims] == [1305031102170000000, 1305031102180000000]
    assert recording.cameras["/rgb"].model.distortion[0] == 0.1


def test_tum_faults(tum, tmp_path):
    (tum / "camera.yaml").rename(tmp_path / "elsewhere.yaml")
    with pytest.raises(CalibrationError, match=r"no camera calibration in .*write camera\.yaml there"):
        open_recording(tum)
    assert open_recording(tum, camera_info=str(tmp_path / "elsewhere.yaml")).cameras
    (tum / "camera.yaml").write_text(CAMERA_YAML)
    (tum / "groundtruth.txt").write_text("1305031102.17 1 2 3 0 0 0 0\n")
    with pytest.raises(RecordingError, match="line 1: not a quaternion"):
        open_recording(tum)
    (tum / "groundtruth.txt").write_text("1305031102.17 1 2 3\n")
    with pytest.raises(RecordingError, match="line 1: expected 8 numbers"):
        open_recording(tum)
    (tum / "gray.txt").write_text((tum / "rgb.txt").read_text())
    with pytest.raises(TopicError, match=r"2 image lists .* rgb\.txt, gray\.txt; name one with --image"):
        open_recording(tum)


@pytest.fixture
def video(tmp_path, textured):
    path = tmp_path / "drive.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48))
    for index in range(10):
        smooth = cv2.GaussianBlur(textured(index), (9, 9), 3)
        writer.write(cv2.cvtColor(smooth, cv2.COLOR_GRAY2BGR))
    writer.release()
    (tmp_path / "drive.yaml").write_text(CAMERA_YAML)
    (tmp_path / "drive.tum").write_text("".join(f"{0.04 * i:.3f} {i} 0 0 0 0 0 1\n" for i in range(10)))
    return path


def test_video(video, textured):
    recording = open_recording(video)
    assert recording.format == "video"
    assert recording.frame_stamps_ns().tolist() == [40_000_000 * i for i in range(10)]
    steps = list(recording.steps())
    assert [len(step.claims) for step in steps] == [1] * 10
    for index, step in enumerate(steps):
        expected = cv2.GaussianBlur(textured(index), (9, 9), 3).astype(float)
        assert np.abs(step.frame.image - expected).mean() < 8.0
    assert open_recording(video, rate_hz=10.0).frame_stamps_ns()[-1] == 900_000_000


def test_video_faults(video):
    video.with_suffix(".tum").write_text("1305031102.0 0 0 0 0 0 0 1\n")
    with pytest.raises(RecordingError, match="its times must count from the video's first frame"):
        open_recording(video)
    video.write_bytes(video.read_bytes()[:200])
    with pytest.raises(RecordingError, match=r"cannot be opened as a video|no frame that can be decoded"):
        open_recording(video)


def test_what_is_no_recording(tmp_path):
    text = tmp_path / "notes.mcap"
    text.write_text("this is text\n")
    empty = tmp_path / "empty"
    empty.mkdir()
    (tmp_path / "nothing.bag").write_bytes(b"")
    other = tmp_path / "other"
    other.mkdir()
    (other / "letter.odt").write_text("x")
    for path, message in [
        (text, "notes.mcap is no recording: it starts with b'this is text"),
        (empty, "empty is an empty folder"),
        (tmp_path / "nothing.bag", r"is empty \(0 bytes\)"),
        (other, "other is no recording: it holds letter.odt"),
        (tmp_path / "absent", "absent does not exist"),
    ]:
        with pytest.raises(RecordingError, match=message) as error:
            open_recording(path)
        assert "\n" not in str(error.value)


def test_an_option_without_meaning_is_refused(kitti):
    with pytest.raises(TopicError, match="--imu /imu has no meaning for a recording of format kitti"):
        open_recording(kitti, imu="/imu")
    with pytest.raises(TopicError, match="--position /fix: a folder has one trajectory"):
        open_recording(kitti, position="/fix")
    with pytest.raises(ValueError, match="rate_hz must be positive"):
        open_recording(kitti, rate_hz=-1.0)


def test_handheld_as_a_tum_folder(data_dir, tmp_path):
    source = data_dir / "handheld"
    folder = tmp_path / "handheld"
    folder.mkdir()
    files = sorted((source / "images").iterdir())[:20]
    K = np.loadtxt(source / "K.txt").ravel().tolist()
    (folder / "camera.yaml").write_text(
        f"image_width: 752\nimage_height: 480\ncamera_matrix: {{data: {K}}}\ndistortion_model: plumb_bob\n"
        "distortion_coefficients: {data: [-0.29660776, 0.08081684, 0, 0]}\n"
    )
    (folder / "rgb.txt").write_text("".join(f"{i / 30:.9f} {file}\n" for i, file in enumerate(files)))
    rows = []
    for index, row in enumerate(np.loadtxt(source / "poses.txt")[:20]):
        T_world_cam = SE3(so3_exp(row[:3]), row[3:]).inverse()
        rows.append(
            " ".join(map(repr, [index / 30, *T_world_cam.t.tolist(), *T_world_cam.quat_xyzw().tolist()]))
        )
    (folder / "groundtruth.txt").write_text("\n".join(rows))
    recording = open_recording(folder)
    steps = list(recording.steps())
    assert len(steps) == 20
    assert steps[5].frame.image.shape == (480, 752)
    assert recording.cameras["/rgb"].model.model == "radial_tangential"
    # sanity of poses and calibration together: the camera moves by millimetres to centimetres a frame
    poses = [claim.T_odom_body for step in steps for claim in step.claims]
    steps_m = [np.linalg.norm((a.inverse() @ b).t) for a, b in itertools.pairwise(poses)]
    assert 1e-4 < np.median(steps_m) < 0.05
