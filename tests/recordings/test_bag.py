"""Bags of every storage: streams, calibration, extrinsics, claims, and one clear line for each fault."""

import contextlib
import sqlite3
import threading
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionMode

from belie.recordings import open_recording, storage
from belie.types import CalibrationError, MotionClaim, PoseClaim, PositionClaim, RecordingError, TopicError

START_NS, PERIOD_NS = 1_700_000_000_000_000_000, 100_000_000


def one_line(error) -> str:
    text = str(error.value)
    assert "\n" not in text
    assert len(text) < 600
    return text


@pytest.mark.parametrize(
    ("kind", "format"), [("mcap", "ros2-mcap"), ("sqlite3", "ros2-sqlite3"), ("ros1", "ros1")]
)
def test_every_storage_gives_the_same_steps(new_bag, textured, kind, format):
    bag = new_bag(kind).drive()
    path = bag.write()
    recording = open_recording(path)
    assert recording.format == format
    assert recording.body_axes == "flu"
    steps = list(recording.steps())
    assert [step.frame.stamp_ns for step in steps] == [START_NS + i * PERIOD_NS for i in range(5)]
    assert recording.frame_stamps_ns().tolist() == [step.frame.stamp_ns for step in steps]
    for index, step in enumerate(steps):
        np.testing.assert_array_equal(step.frame.image, textured(index))
        (claim,) = step.claims
        assert isinstance(claim, PoseClaim)
        assert claim.T_odom_body.t[0] == 0.1 * index
        assert (claim.source, claim.frame_id, claim.covariance) == ("/odom", "odom", None)
    assert len(list(recording.steps())) == 5
    mounted = recording.cameras["/cam/image_raw"]
    # optical frame on a forward-looking mount: the camera's z axis is the body's x axis
    np.testing.assert_allclose(mounted.T_body_cam.R @ [0, 0, 1], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(mounted.T_body_cam.t, [0.5, 0.0, 1.0])
    assert (mounted.model.fx, mounted.model.model) == (60.0, "pinhole")


def test_bags_without_definitions_take_the_usual_ones(new_bag):
    file = new_bag("sqlite3").drive().write()
    with contextlib.closing(sqlite3.connect(file)) as database, database:
        database.execute("DELETE FROM message_definitions")
    assert len(list(open_recording(file).steps())) == 5


@pytest.mark.parametrize("mode", [CompressionMode.MESSAGE, CompressionMode.FILE])
def test_compressed_bags(new_bag, mode):
    folder = new_bag("sqlite3").drive().write(compression=mode)
    recording = open_recording(folder)
    assert len(list(recording.steps())) == 5
    assert {stream.topic: stream.count for stream in recording.streams}["/odom"] == 5


def test_folder_misnamed_file_and_folder_without_metadata_open_alike(new_bag, tmp_path):
    file = new_bag("mcap").drive().write()
    folder = file.parent
    assert open_recording(folder).format == "ros2-mcap"
    misnamed = tmp_path / "drive.bag"
    misnamed.write_bytes(file.read_bytes())
    assert len(list(open_recording(misnamed).steps())) == 5
    (folder / "metadata.yaml").unlink()
    assert len(list(open_recording(folder).steps())) == 5


def test_streams_need_no_images(new_bag):
    bag = new_bag().drive(11)
    bag.messages = [
        entry for entry in bag.messages if not (entry[0] == "/odom" and entry[2] == START_NS + 5 * PERIOD_NS)
    ]
    streams = {stream.topic: stream for stream in open_recording(bag.write()).streams}
    image = streams["/cam/image_raw"]
    assert (image.role, image.count, image.used, image.start_ns) == ("image", 11, True, START_NS)
    assert image.rate_hz == pytest.approx(10.0)
    assert streams["/odom"].longest_gap_s == pytest.approx(0.2)
    assert streams["/tf_static"].role == "tf"


def test_twist_is_given_only_where_it_is_filled_in(new_bag):
    bag = new_bag().drive(0)
    bag.camera_info()
    twists = [0.0, 0.0, 0.7, 0.0]
    for index, speed in enumerate(twists):
        stamp_ns = START_NS + index * PERIOD_NS
        bag.odometry(stamp_ns, 0.1 * index, twist__twist__linear__x=speed)
        bag.image(stamp_ns)
    motions = [
        [claim for claim in step.claims if isinstance(claim, MotionClaim)]
        for step in open_recording(bag.write()).steps()
    ]
    assert [len(found) for found in motions] == [0, 0, 1, 1]
    np.testing.assert_array_equal(motions[2][0].linear_m_s, [0.7, 0, 0])
    np.testing.assert_array_equal(motions[3][0].linear_m_s, [0, 0, 0])


def test_zero_twist_with_covariance_is_a_claim_and_nan_half_is_unmeasured(new_bag):
    bag = new_bag().drive(0)
    bag.camera_info()
    covariance = np.diag([0.1] * 6).ravel()
    nan = float("nan")
    bag.odometry(START_NS, 0.0, twist__covariance=covariance, pose__covariance=covariance)
    bag.odometry(
        START_NS + 1,
        twist__twist__linear__x=1.0,
        twist__twist__angular__x=nan,
        twist__twist__angular__y=nan,
        twist__twist__angular__z=nan,
    )
    bag.image(START_NS + 2)
    (step,) = open_recording(bag.write()).steps()
    poses = [claim for claim in step.claims if isinstance(claim, PoseClaim)]
    twists = [claim for claim in step.claims if isinstance(claim, MotionClaim)]
    np.testing.assert_array_equal(poses[0].covariance, 0.1 * np.eye(6))
    np.testing.assert_array_equal(twists[0].linear_m_s, np.zeros(3))
    assert twists[1].angular_rad_s is None


def test_imu_is_rotated_to_body_axes(new_bag):
    bag = new_bag().drive()
    bag.tf_static(
        "base_link", "imu", (0.0, 0.0, 0.1), (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
    )  # +90 deg about z
    absent = np.array([-1.0] + [0.0] * 8)
    for index in range(40):
        bag.imu(
            START_NS + index * PERIOD_NS // 10,
            (1.0, 0.0, 0.0),
            angular_velocity_covariance=np.diag([1.0, 2.0, 3.0]).ravel(),
            linear_acceleration_covariance=absent,
        )
    claims = [c for s in open_recording(bag.write()).steps() for c in s.claims if isinstance(c, MotionClaim)]
    assert len(claims) == 40
    np.testing.assert_allclose(claims[0].angular_rad_s, [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(np.diag(claims[0].covariance)[3:], [2, 1, 3], atol=1e-12)
    assert claims[0].acceleration_m_s2 is None


def test_imu_without_extrinsics_is_an_error_that_can_be_left_out(new_bag):
    bag = new_bag().drive()
    bag.imu(START_NS, (0.0, 0.0, 0.1))
    path = bag.write()
    with pytest.raises(CalibrationError, match=r"no transform from base_link to imu.*--imu none") as error:
        open_recording(path)
    one_line(error)
    assert len(list(open_recording(path, imu="none").steps())) == 5


def test_gnss_is_east_north_up_about_the_first_valid_fix(new_bag):
    bag = new_bag().drive(4)
    bag.tf_static("base_link", "antenna", (0.2, 0.0, 1.5))
    fixes = [(-1, 0.0, 0.0), (0, 48.0, 11.0), (0, 48.0001, 11.0), (0, float("nan"), 11.0)]
    for index, (status, latitude, longitude) in enumerate(fixes):
        stamp_ns = START_NS + index * PERIOD_NS
        message = bag.new(
            "sensor_msgs/msg/NavSatFix",
            stamp_ns,
            "antenna",
            status__status=status,
            latitude=latitude,
            longitude=longitude,
            altitude=500.0,
            position_covariance=np.diag([0.25, 0.25, 1.0]).ravel(),
            position_covariance_type=2 if index == 2 else 0,
        )
        bag.add("/fix", "sensor_msgs/msg/NavSatFix", message, stamp_ns)
    recording = open_recording(bag.write())
    claims = [c for s in recording.steps() for c in s.claims if isinstance(c, PositionClaim)]
    assert [claim.kind for claim in claims] == ["gnss", "gnss"]
    np.testing.assert_allclose(claims[0].position_m, np.zeros(3), atol=1e-9)
    np.testing.assert_allclose(claims[1].position_m, [0.0, 11.12, 0.0], atol=5e-3)
    assert claims[0].covariance is None
    np.testing.assert_array_equal(np.diag(claims[1].covariance), [0.25, 0.25, 1.0])
    np.testing.assert_array_equal(claims[0].lever_m, [0.2, 0.0, 1.5])
    assert recording.join_counts.invalid == {"/fix": 2}
    assert recording.geodetic_origin.latitude_deg == 48.0


def test_pose_topics_are_localisation_or_named_odometry(new_bag):
    bag = new_bag().drive(3)
    for index in range(3):
        stamp_ns = START_NS + index * PERIOD_NS
        pose = bag.new(
            "geometry_msgs/msg/PoseWithCovarianceStamped",
            stamp_ns,
            "/map",
            pose__pose__position__y=float(index),
            pose__pose__orientation__w=1.0,
            pose__covariance=np.diag([4.0, 5, 6, 7, 8, 9]).ravel(),
        )
        bag.add("/amcl_pose", "geometry_msgs/msg/PoseWithCovarianceStamped", pose, stamp_ns)
        goal = bag.new("geometry_msgs/msg/PoseStamped", stamp_ns, "map", pose__orientation__w=1.0)
        bag.add("/goal_pose", "geometry_msgs/msg/PoseStamped", goal, stamp_ns)
    path = bag.write()
    claims = [c for s in open_recording(path).steps() for c in s.claims if isinstance(c, PositionClaim)]
    assert [(c.source, c.kind, c.frame_id, c.position_m[1]) for c in claims] == [
        ("/amcl_pose", "localisation", "map", float(index)) for index in range(3)
    ]
    np.testing.assert_array_equal(np.diag(claims[0].covariance), [4, 5, 6])
    steps = list(open_recording(path, odometry="/amcl_pose").steps())
    poses = [c for s in steps for c in s.claims]
    assert all(isinstance(c, PoseClaim) and c.source == "/amcl_pose" for c in poses)
    assert len(poses) == 3


def test_image_frame_that_is_the_body_needs_no_transform_but_another_does(new_bag):
    bag = new_bag().drive(2).without("/tf_static").without("/odom")
    bag.odometry(START_NS, child_frame_id="cam")
    recording = open_recording(bag.write())
    assert recording.body_axes == "rdf"
    assert recording.cameras["/cam/image_raw"].T_body_cam.is_close(
        type(recording.cameras["/cam/image_raw"].T_body_cam).identity()
    )

    bare = new_bag(name="bare").drive(2).without("/tf_static").write()
    with pytest.raises(CalibrationError, match="no transform from base_link to cam on /tf_static") as error:
        open_recording(bare)
    one_line(error)


def test_images_without_a_frame(new_bag):
    bag = new_bag().drive(2).without("/cam/image_raw")
    bag.image(START_NS, frame_id="")
    with pytest.raises(CalibrationError, match="base_link to an unnamed frame"):
        open_recording(bag.write())


def test_empty_child_frame_falls_back_to_base_link(new_bag):
    bag = new_bag().drive(2).without("/odom")
    bag.odometry(START_NS, child_frame_id="")
    assert open_recording(bag.write()).cameras["/cam/image_raw"].T_body_cam.t[2] == 1.0


def test_two_of_a_kind_are_listed_with_the_flag(new_bag):
    bag = new_bag().drive(2)
    bag.image(START_NS, topic="/rear/image_raw")
    bag.camera_info(topic="/rear/camera_info", frame_id="rear")
    bag.odometry(START_NS, topic="/wheel/odom")
    path = bag.write()
    with pytest.raises(TopicError, match="/cam/image_raw, /rear/image_raw; name one with --image") as error:
        open_recording(path)
    one_line(error)
    with pytest.raises(TopicError, match="/odom, /wheel/odom; name one with --odometry"):
        open_recording(path, image="/cam/image_raw")
    recording = open_recording(path, image="/cam/image_raw", odometry="/odom")
    assert list(recording.cameras) == ["/cam/image_raw"]
    with pytest.raises(TopicError, match="--odometry /nowhere: no such topic"):
        open_recording(path, image="/cam/image_raw", odometry="/nowhere")
    with pytest.raises(
        TopicError, match=r"--odometry /cam/image_raw: this topic is of type sensor_msgs/msg/Image"
    ):
        open_recording(path, image="/cam/image_raw", odometry="/cam/image_raw")


def test_another_cameras_info_is_not_taken(new_bag):
    bag = new_bag().drive(2).without("/cam/camera_info")
    bag.camera_info(topic="/rear/camera_info", frame_id="rear")
    path = bag.write()
    with pytest.raises(CalibrationError, match="/rear/camera_info is of frame rear") as error:
        open_recording(path)
    one_line(error)
    assert open_recording(path, camera_info="/rear/camera_info").cameras


@pytest.mark.parametrize(
    ("topic", "error", "message"),
    [
        ("/cam/camera_info", TopicError, "no camera info for /cam/image_raw.*record /cam/camera_info"),
        ("/cam/image_raw", TopicError, "no images"),
        ("/tf_static", CalibrationError, "no transform from base_link to cam"),
    ],
)
def test_missing_streams(new_bag, topic, error, message):
    path = new_bag().drive(2).without(topic).write()
    with pytest.raises(error, match=message) as raised:
        open_recording(path)
    one_line(raised)


def test_nan_pose_and_zero_quaternion_name_the_message(new_bag):
    bag = new_bag().drive(3)
    bag.odometry(START_NS + 250_000_000, float("nan"))
    bag.image(START_NS + 300_000_000)
    with pytest.raises(
        RecordingError, match=r"pose of /odom holds NaN or infinity in message 3 \(stamp 1700000000.25"
    ) as e:
        list(open_recording(bag.write()).steps())
    one_line(e)
    bag = new_bag(name="zero").drive(3)
    bag.odometry(START_NS + 250_000_000, pose__pose__orientation__w=0.0)
    with pytest.raises(RecordingError, match="zero quaternion in message 3"):
        list(open_recording(bag.write()).steps())


def test_image_stamps_that_run_backwards(new_bag):
    bag = new_bag().drive(5)
    bag.image(START_NS - 3_000_000_000, received_ns=START_NS + 5 * PERIOD_NS)
    with pytest.raises(
        RecordingError, match="image stamps run backwards at message 5 of /cam/image_raw"
    ) as error:
        list(open_recording(bag.write()).steps())
    one_line(error)
    reversed_bag = new_bag(name="reversed").drive(0)
    reversed_bag.camera_info()
    for index in range(10):
        reversed_bag.image(START_NS - index * PERIOD_NS, received_ns=START_NS + index * PERIOD_NS)
    with pytest.raises(RecordingError, match="image stamps run backwards"):
        list(open_recording(reversed_bag.write()).steps())


def test_unstamped_images(new_bag):
    bag = new_bag().drive(0)
    bag.camera_info()
    for index in range(3):
        bag.image(0, received_ns=START_NS + index * PERIOD_NS)
    with pytest.raises(RecordingError, match=r"carry no time \(header.stamp is 0"):
        list(open_recording(bag.write()).steps())


def test_damaged_image_is_counted_and_skipped_all_damaged_is_an_error(new_bag):
    bag = new_bag().drive(0)
    bag.camera_info()
    for index in range(4):
        bag.compressed(START_NS + index * PERIOD_NS, b"\xff\xd8\xffnonsense" if index == 2 else None)
    recording = open_recording(bag.write())
    assert len(list(recording.steps())) == 3
    assert recording.join_counts.undecodable == {"/cam/image_raw": 1}

    bag = new_bag(name="all").drive(0)
    bag.camera_info()
    bag.compressed(START_NS, b"\xff\xd8\xffnonsense")
    with pytest.raises(RecordingError, match=r"none of the first images .* can be decoded") as error:
        open_recording(bag.write())
    one_line(error)


def test_size_must_fit_the_calibration(new_bag):
    bag = new_bag().drive(1).without("/cam/camera_info")
    bag.camera_info(width=1280, height=960)
    with pytest.raises(CalibrationError, match="is for 1280x960 pixels, the images are 64x48"):
        open_recording(bag.write())
    tiny = new_bag(name="tiny").drive(0)
    tiny.camera_info(width=1, height=1)
    tiny.image(START_NS, pixels=np.zeros((1, 1), np.uint8))
    with pytest.raises(RecordingError, match="1x1 pixels; too small") as error:
        open_recording(tiny.write())
    one_line(error)
    changing = new_bag(name="changing").drive(2)
    changing.image(START_NS + 900_000_000, pixels=np.zeros((24, 32), np.uint8))
    with pytest.raises(RecordingError, match="image 2 of /cam/image_raw is 32x24"):
        list(open_recording(changing.write()).steps())


@pytest.mark.parametrize(
    ("kind", "message"), [("mcap", "mcap recover"), ("sqlite3", "recover"), ("ros1", "rosbag reindex")]
)
@pytest.mark.parametrize("share", [0.02, 0.5, 0.95])
def test_truncated_bags_name_the_mending(new_bag, kind, message, share):
    file = new_bag(kind).drive(20).write()
    data = file.read_bytes()
    file.write_bytes(data[: max(24, int(len(data) * share))])
    with pytest.raises(RecordingError, match=message) as error:
        list(open_recording(file).steps())
    one_line(error)


def test_flipped_bytes_never_give_a_traceback(new_bag):
    file = new_bag().drive(6).write()
    data = np.frombuffer(file.read_bytes(), np.uint8)
    rng = np.random.default_rng(1)
    for _ in range(60):
        broken = data.copy()
        at = rng.integers(8, len(broken), 20)
        broken[at] = rng.integers(0, 256, 20)
        file.write_bytes(broken.tobytes())
        with contextlib.suppress(RecordingError):  # and no other error
            recording = open_recording(file)
            assert recording.streams
            list(recording.steps())


@pytest.mark.parametrize(
    ("name", "magic"),
    [("a.mcap", b"\x89MCAP0\r\n"), ("a.db3", b"SQLite format 3\x00"), ("a.bag", b"#ROSBAG V2.0\n")],
)
@pytest.mark.parametrize("rest", [b"", b"\x00", b"\x01", bytes(50), b"\x89MCAP0\r\n" * 8])
def test_files_of_a_few_bytes_say_that_they_were_cut_short(tmp_path, name, magic, rest):
    path = tmp_path / name
    for length in range(len(magic), 62):
        path.write_bytes((magic + rest)[:length])
        with pytest.raises(RecordingError, match=r"cut short, its \d+ bytes hold no message") as error:
            open_recording(path)
        assert str(path) in one_line(error)


def test_what_parsers_say_of_damaged_records_is_not_passed_on():
    said = (
        r"a.mcap cannot be read as ros2-mcap: a record in it is damaged or cut short; .* `mcap recover a.mcap"
    )
    with pytest.raises(RecordingError, match=said), storage._clear_errors(Path("a.mcap"), "ros2-mcap"):
        ord(b"")


def overwritten(path, bag, topic, index, at, by):
    """The file with some bytes of a message's record overwritten; `at` counts from the start of its data."""
    message = [data for name, _, _, data in bag.messages if name == topic][index]
    data = path.read_bytes()
    start = data.index(message) + at
    path.write_bytes(data[:start] + by + data[start + len(by) :])


def test_damaged_messages_are_counted_and_those_that_are_gone(new_bag):
    bag = new_bag().drive(12)
    path = bag.write()
    channel = -22  # before the data, in MCAP
    overwritten(path, bag, "/odom", 4, channel, b"\xff\xff")
    overwritten(path, bag, "/cam/image_raw", 7, channel, b"\xff\xff")
    overwritten(path, bag, "/odom", 8, 16, b"\xff\xff\xff\xff")  # length of frame_id
    recording = open_recording(path)
    steps = list(recording.steps())
    assert len(steps) == 11
    assert sum(len(step.claims) for step in steps) == 10
    assert recording.join_counts.lost == {"/odom": 1, "/cam/image_raw": 1}
    assert recording.join_counts.undecodable == {"/odom": 1}


def test_an_undamaged_bag_has_lost_nothing(new_bag):
    for kind in ("mcap", "sqlite3", "ros1"):
        recording = open_recording(new_bag(kind, name=kind).drive(6).write())
        list(recording.steps())
        assert not recording.join_counts.lost


def test_a_topic_that_cannot_be_read_at_all_is_an_error(new_bag):
    bag = new_bag().drive(12)
    path = bag.write()
    for index in range(1, 12):
        overwritten(path, bag, "/odom", index, 16, b"\xff\xff\xff\xff")
    assert len(list(open_recording(path).steps())) == 12  # the first could be read
    bag = new_bag(name="all").drive(12)
    path = bag.write()
    for index in range(12):
        overwritten(path, bag, "/odom", index, 16, b"\xff\xff\xff\xff")
    with pytest.raises(RecordingError, match="Odometry"):
        list(open_recording(path).steps())


def test_empty_bag(new_bag):
    with pytest.raises(RecordingError, match="holds no messages"):
        open_recording(new_bag().write().parent)


def test_closing_the_steps_stops_the_thread(new_bag):
    recording = open_recording(new_bag().drive(60).write())
    steps = recording.steps()
    next(steps)
    assert any(thread.name == "belie-prefetch" for thread in threading.enumerate())
    steps.close()
    assert not any(thread.name == "belie-prefetch" for thread in threading.enumerate())
