"""The MCAP writer: what goes out comes back, and other readers of MCAP agree."""

import numpy as np
import pytest

import belie.recordings
from belie.geometry import SE3, CameraModel, so3_exp
from belie.recordings import GeodeticPoint, open_recording, write_mcap
from belie.types import Frame, MotionClaim, MountedCamera, PoseClaim, PositionClaim, RecordingError, Step

T0 = 1_700_000_000_123_456_789
MODELS = {
    "pinhole": (),
    "radial_tangential": (0.1, -0.2, 0.001, 0.002, 0.03),
    "rational": (0.1, 0.2, 0.001, 0.002, 0.03, 0.04, 0.05, 0.06),
    "equidistant": (0.0, 0.0, 0.0, 0.0),
}


def mounted(model="pinhole"):
    camera = CameraModel(
        width=64, height=48, fx=60.1, fy=60.2, cx=31.3, cy=23.7, model=model, distortion=MODELS[model]
    )
    return {
        "/front/image_raw": MountedCamera(model=camera, T_body_cam=SE3.exp([0.5, 0.1, 1.0, -1.2, 1.2, -1.2]))
    }


def full_steps(count=8):
    rng = np.random.default_rng(4)
    steps = []
    for index in range(count):
        stamp_ns = T0 + index * 100_000_001
        received_ns = stamp_ns + int(rng.integers(1_000_000, 60_000_000))
        covariance = np.diag(rng.uniform(0.1, 1.0, 6))
        T = SE3(so3_exp(rng.normal(size=3)), rng.normal(size=3) * 1e3)
        common = {"stamp_ns": stamp_ns, "received_ns": received_ns}
        claims = [
            PoseClaim(source="/wheel/odom", frame_id="odom", T_odom_body=T, covariance=covariance, **common),
            MotionClaim(
                source="/wheel/odom",
                kind="twist",
                linear_m_s=rng.normal(size=3),
                angular_rad_s=None if index == 3 else rng.normal(size=3),
                covariance=covariance if index % 2 else None,
                **common,
            ),
            MotionClaim(
                source="/imu/data",
                kind="imu",
                angular_rad_s=rng.normal(size=3),
                acceleration_m_s2=None if index == 2 else rng.normal(size=3),
                covariance=np.diag([0, 0, 0, 0.1, 0.2, 0.3]),
                **common,
            ),
            PositionClaim(
                source="/gps/fix",
                frame_id="enu",
                kind="gnss",
                position_m=np.zeros(3) if index == 0 else rng.normal(size=3) * 100,
                covariance=np.diag([1.0, 2.0, 3.0]),
                lever_m=np.array([0.1, 0.0, 1.7]),
                **common,
            ),
        ]
        image = rng.integers(0, 256, (48, 64), dtype=np.uint8)
        frame = Frame(camera="/front/image_raw", stamp_ns=stamp_ns, received_ns=received_ns, image=image)
        steps.append(Step(frame=frame, claims=tuple(claims)))
    return steps


def assert_same(ours, theirs, rotation=2e-15, metres=0.0):
    assert len(ours) == len(theirs)
    for a, b in zip(ours, theirs, strict=True):
        assert (a.frame.camera, a.frame.stamp_ns, a.frame.received_ns) == (
            b.frame.camera,
            b.frame.stamp_ns,
            b.frame.received_ns,
        )
        np.testing.assert_array_equal(a.frame.image, b.frame.image)
        assert [(type(c), c.source, c.stamp_ns, c.received_ns) for c in a.claims] == [
            (type(c), c.source, c.stamp_ns, c.received_ns) for c in b.claims
        ]
        for c, d in zip(a.claims, b.claims, strict=True):
            for name in c.__slots__:
                if name == "T_odom_body":
                    np.testing.assert_array_equal(c.T_odom_body.t, d.T_odom_body.t)
                    np.testing.assert_allclose(c.T_odom_body.R, d.T_odom_body.R, rtol=0, atol=rotation)
                elif name == "position_m" and c.kind == "gnss":
                    np.testing.assert_allclose(c.position_m, d.position_m, rtol=0, atol=1e-8)
                elif isinstance(getattr(c, name), np.ndarray):
                    np.testing.assert_array_equal(getattr(c, name), getattr(d, name), err_msg=name)
                else:
                    assert getattr(c, name) == getattr(d, name), name


@pytest.mark.parametrize("encoding", ["png", "mono8"])
@pytest.mark.parametrize("axes", ["flu", "rdf"])
def test_everything_comes_back(tmp_path, encoding, axes):
    steps = full_steps()
    origin = GeodeticPoint(latitude_deg=48.1, longitude_deg=11.5, altitude_m=520.0)
    seen = []
    path = tmp_path / "out.mcap"
    write_mcap(
        path,
        iter(steps),
        cameras=mounted(),
        body_axes=axes,
        image_encoding=encoding,
        geodetic_origin=origin,
        progress=seen.append,
    )
    assert seen == list(range(1, 9))
    recording = open_recording(path)
    assert (recording.format, recording.body_axes) == ("ros2-mcap", axes)
    assert_same(steps, list(recording.steps()))
    assert recording.geodetic_origin.latitude_deg == pytest.approx(48.1, abs=1e-12)
    back = recording.cameras["/front/image_raw"]
    assert back.model == mounted()["/front/image_raw"].model
    assert back.T_body_cam.is_close(mounted()["/front/image_raw"].T_body_cam, 1e-14)

    again = tmp_path / "again.mcap"
    write_mcap(again, recording, cameras=recording.cameras, body_axes=recording.body_axes)
    assert_same(steps, list(open_recording(again).steps()))


@pytest.mark.parametrize("model", MODELS)
def test_every_camera_model_comes_back(tmp_path, model):
    write_mcap(tmp_path / "out.mcap", full_steps(1), cameras=mounted(model), body_axes="flu")
    back = open_recording(tmp_path / "out.mcap").cameras["/front/image_raw"].model
    assert back == mounted(model)["/front/image_raw"].model


def test_jpeg_is_close(tmp_path):
    import cv2

    (step,) = full_steps(1)
    smooth = cv2.GaussianBlur(step.frame.image, (9, 9), 3)
    frame = Frame(camera="/front/image_raw", stamp_ns=5, received_ns=5, image=smooth)
    write_mcap(
        tmp_path / "out.mcap", [Step(frame=frame)], cameras=mounted(), body_axes="flu", image_encoding="jpeg"
    )
    (back,) = open_recording(tmp_path / "out.mcap").steps()
    assert np.abs(back.frame.image.astype(int) - smooth).max() <= 8


def test_folder_target_and_refusals(tmp_path):
    steps = full_steps(2)
    write_mcap(tmp_path / "bag", steps, cameras=mounted(), body_axes="flu")
    assert (tmp_path / "bag" / "metadata.yaml").is_file()
    assert len(list(open_recording(tmp_path / "bag").steps())) == 2
    with pytest.raises(RecordingError, match="exists already"):
        write_mcap(tmp_path / "bag", steps, cameras=mounted(), body_axes="flu")
    lonely = Step(frame=steps[0].frame, claims=(steps[0].claims[1],))
    with pytest.raises(RecordingError, match=r"twist of /wheel/odom .* has no pose of the same stamp"):
        write_mcap(tmp_path / "lonely.mcap", [lonely], cameras=mounted(), body_axes="flu")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["bag"]  # nothing half-written is left
    with pytest.raises(ValueError, match="image_encoding"):
        write_mcap(tmp_path / "x.mcap", steps, cameras=mounted(), body_axes="flu", image_encoding="gif")


def test_names_that_ros_does_not_allow_are_replaced(tmp_path):
    (step,) = full_steps(1)
    claim = PoseClaim(
        source="wheel odometry", frame_id="odom", stamp_ns=1, received_ns=1, T_odom_body=SE3.identity()
    )
    (camera,) = mounted().values()
    frame = Frame(camera="left cam", stamp_ns=1, received_ns=1, image=step.frame.image)
    write_mcap(
        tmp_path / "out.mcap",
        [Step(frame=frame, claims=(claim,))],
        cameras={"left cam": camera},
        body_axes="flu",
    )
    topics = {stream.topic for stream in open_recording(tmp_path / "out.mcap").streams}
    assert topics == {"/camera/image/compressed", "/camera/camera_info", "/odom", "/tf_static"}


def test_the_mcap_library_agrees(tmp_path):
    """The reference reader, with the message definitions from the file alone, as Foxglove does it."""
    reader_module = pytest.importorskip("mcap.reader")
    decoders = pytest.importorskip("mcap_ros2.decoder")
    steps = full_steps(5)
    path = tmp_path / "out.mcap"
    write_mcap(path, steps, cameras=mounted(), body_axes="flu")
    with path.open("rb") as stream:
        reader = reader_module.make_reader(
            stream, validate_crcs=True, decoder_factories=[decoders.DecoderFactory()]
        )
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        assert summary.statistics.message_count == 2 + 5 * 5
        assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
        decoded = {}
        for _, channel, message, content in reader.iter_decoded_messages():
            decoded.setdefault(channel.topic, []).append((message.log_time, content))
    odometry = decoded["/wheel/odom"]
    assert [time for time, _ in odometry] == sorted(step.frame.received_ns for step in steps)
    _, first = odometry[0]
    assert first.child_frame_id == "base_link"
    assert first.header.stamp.sec * 10**9 + first.header.stamp.nanosec == T0
    assert first.pose.pose.position.x == steps[0].claims[0].T_odom_body.t[0]
    _, image = decoded["/front/image_raw/compressed"][0]
    assert image.format == "png"
    assert bytes(image.data[:4]) == b"\x89PNG"
    _, info = decoded["/front/camera_info"][0]
    assert info.k[0] == 60.1
    assert [edge.child_frame_id for _, tf in decoded["/tf_static"] for edge in tf.transforms] == [
        "camera_optical_frame",
        "gnss_antenna",
    ]


def test_kitti_comes_back(data_dir, tmp_path):
    import shutil

    folder = tmp_path / "kitti"
    shutil.copytree(data_dir / "kitti06", folder)
    for file in sorted((folder / "image_0").iterdir())[20:]:
        file.unlink()
    recording = open_recording(folder, position="poses")
    path = tmp_path / "kitti.mcap"
    write_mcap(path, recording, cameras=recording.cameras, body_axes=recording.body_axes)
    back = open_recording(path)
    assert back.cameras["/image_0"].model == recording.cameras["/image_0"].model
    assert back.body_axes == recording.body_axes
    assert_same(list(recording.steps()), list(back.steps()))
    np.testing.assert_array_equal(back.frame_stamps_ns(), recording.frame_stamps_ns())


def test_the_public_api():
    assert belie.recordings.__all__ == sorted(belie.recordings.__all__)
    assert set(belie.recordings.__all__) == {
        "BodyAxes",
        "GeodeticPoint",
        "JoinCounts",
        "JoinSettings",
        "Recording",
        "StreamInfo",
        "open_recording",
        "write_mcap",
    }
    for name in belie.recordings.__all__:
        assert getattr(belie.recordings, name) is not None
