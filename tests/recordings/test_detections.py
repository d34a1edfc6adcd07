"""Object detections as vision_msgs: what goes out comes back, and other publishers' habits are understood."""

from types import SimpleNamespace as Message

import numpy as np
import pytest

from belie.geometry import SE3, CameraModel, so3_exp
from belie.recordings import open_recording, write_mcap
from belie.recordings.vision_messages import DetectionReader, detections
from belie.types import (
    CalibrationError,
    Detection,
    DetectionClaim,
    Frame,
    MountedCamera,
    RecordingError,
    Step,
    TopicError,
)

CAMERA = MountedCamera(
    model=CameraModel(width=64, height=48, fx=60, fy=60, cx=31.5, cy=23.5),
    T_body_cam=SE3.from_translation([0.5, 0.0, 1.0]),
)
IMAGE = np.zeros((48, 64), np.uint8)


def boxes():
    return (
        Detection(label="car", score=0.9, track_id="7", box_px=[1.5, 2, 30, 40]),
        Detection(
            label="truck",
            score=0.4,
            box_px=[0, 0, 64, 48],
            position_m=[1, 2, 30.0],
            covariance=np.diag([0.1, 0.2, 0.3]),
        ),
        Detection(
            label="bus",
            score=1.0,
            track_id="b",
            box_px=[5, 5, 6, 6],
            T_cam_obj=SE3(so3_exp(np.array([0.1, 1.0, -0.3])), np.array([-3.0, 1.0, 12.0])),
            covariance=np.diag([0.1, 0.2, 0.3]),
        ),
    )


def solids():
    return (
        Detection(
            label="car",
            score=0.9,
            track_id="7",
            T_cam_obj=SE3(so3_exp(np.array([0.0, 1.0, 0.0])), np.array([-3.0, 1.0, 12.0])),
            dimensions_m=[4.2, 1.8, 1.5],
        ),
        Detection(label="person", score=0.8, position_m=[1, 2, 30.0]),
    )


def write(path, *claims):
    frame = Frame(camera="/cam/image", stamp_ns=10**9, received_ns=10**9 + 10, image=IMAGE)
    write_mcap(path, [Step(frame=frame, claims=claims)], cameras={"/cam/image": CAMERA}, body_axes="flu")
    return path


def claim(found, source="/detections", stamp_ns=10**9):
    return DetectionClaim(source=source, stamp_ns=stamp_ns, received_ns=stamp_ns + 5, detections=found)


def assert_same(ours, theirs):
    assert (ours.label, ours.score, ours.track_id) == (theirs.label, theirs.score, theirs.track_id)
    for name in ("box_px", "position_m", "covariance", "dimensions_m"):
        a, b = getattr(ours, name), getattr(theirs, name)
        assert (a is None) == (b is None), name
        if a is not None:
            np.testing.assert_allclose(a, b, atol=1e-12, err_msg=name)
    assert (ours.T_cam_obj is None) == (theirs.T_cam_obj is None)
    if ours.T_cam_obj is not None:
        assert ours.T_cam_obj.is_close(theirs.T_cam_obj, 1e-12)


@pytest.mark.parametrize("found", [boxes(), solids(), ()], ids=["2d", "3d", "none"])
def test_detections_come_back(tmp_path, found):
    recording = open_recording(write(tmp_path / "out.mcap", claim(found)))
    ((back,),) = [step.claims for step in recording.steps()]
    assert isinstance(back, DetectionClaim)
    assert (back.source, back.stamp_ns, back.received_ns) == ("/detections", 10**9, 10**9 + 5)
    assert len(back.detections) == len(found)
    for ours, theirs in zip(found, back.detections, strict=True):
        assert_same(ours, theirs)
    (stream,) = [stream for stream in recording.streams if stream.role == "detections"]
    assert stream.used


def test_two_topics_must_be_chosen_between(tmp_path):
    path = write(tmp_path / "out.mcap", claim(boxes()), claim(solids(), "/objects"))
    with pytest.raises(TopicError, match=r"could be the detections: /detections, /objects; .* --detections"):
        open_recording(path)
    (step,) = open_recording(path, detections="/objects").steps()
    assert [c.source for c in step.claims] == ["/objects"]
    (step,) = open_recording(path, detections="none").steps()
    assert step.claims == ()


def test_what_vision_msgs_cannot_hold_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="send two claims"):
        write(tmp_path / "mixed.mcap", claim((*boxes(), *solids())))
    both = Detection(label="car", score=1, box_px=[0, 0, 1, 1], dimensions_m=[4, 2, 1.5])
    with pytest.raises(RecordingError, match="send two claims"):
        write(tmp_path / "both.mcap", claim((both,)))


def test_empty_claims_take_the_type_of_their_topic(tmp_path):
    path = tmp_path / "out.mcap"
    steps = [
        Step(
            frame=Frame(camera="/cam/image", stamp_ns=k * 10**8, received_ns=k * 10**8, image=IMAGE),
            claims=(claim(solids() if k in (2, 4) else (), stamp_ns=k * 10**8),),
        )
        for k in range(1, 6)
    ]
    write_mcap(path, steps, cameras={"/cam/image": CAMERA}, body_axes="flu")
    back = [c for step in open_recording(path).steps() for c in step.claims]
    assert [(c.stamp_ns // 10**8, len(c.detections)) for c in back] == [
        (1, 0),
        (2, 2),
        (3, 0),
        (4, 2),
        (5, 0),
    ]
    silent = tmp_path / "silent.mcap"
    bare = [Step(frame=step.frame, claims=(claim((), stamp_ns=step.frame.stamp_ns),)) for step in steps]
    write_mcap(silent, bare, cameras={"/cam/image": CAMERA}, body_axes="flu")
    assert len([c for step in open_recording(silent).steps() for c in step.claims]) == 5


def test_misuse_of_a_detection():
    with pytest.raises(ValueError, match="left, top, right, bottom"):
        Detection(label="car", score=1, box_px=[3, 0, 1, 1])
    with pytest.raises(ValueError, match="between 0 and 1"):
        Detection(label="car", score=1.5)
    with pytest.raises(ValueError, match="not that of T_cam_obj"):
        Detection(label="car", score=1, T_cam_obj=SE3.identity(), position_m=[1, 0, 0])
    with pytest.raises(ValueError, match="without a position"):
        Detection(label="car", score=1, covariance=np.eye(3))


def test_another_frame_is_brought_to_the_camera():
    kind, message = detections(claim(boxes()), "lidar")
    assert kind.endswith("Detection2DArray")
    asked = []

    def T_cam_of(frame):
        asked.append(frame)
        return SE3(so3_exp(np.array([0.0, 0.0, np.pi / 2])), np.array([0.0, 0.0, 1.0]))

    (back,) = DetectionReader("/detections", T_cam_of)(message, 5, 0)
    assert set(asked) == {"lidar"}
    np.testing.assert_allclose(back.detections[1].position_m, [-2.0, 1.0, 31.0], atol=1e-12)
    np.testing.assert_allclose(np.diag(back.detections[1].covariance), [0.2, 0.1, 0.3], atol=1e-12)

    def nowhere(frame):
        raise CalibrationError(f"no transform to {frame}")

    with pytest.raises(CalibrationError, match="lidar"):
        DetectionReader("/detections", nowhere)(message, 5, 0)


def test_older_definitions_are_understood():
    """ROS 1 and Foxy: the hypothesis is flat, its class is ``id``, the track ``tracking_id``, the centre 2-D."""
    zero = Message(x=0.0, y=0.0, z=0.0, w=0.0)
    nothing = Message(pose=Message(position=zero, orientation=zero), covariance=np.zeros(36))
    header = Message(stamp=Message(sec=1, nanosec=0), frame_id="")
    entry = Message(
        header=header,
        results=[
            Message(id="van", score=0.2, pose=nothing),
            Message(id="car", score=1.2, pose=nothing),
        ],
        bbox=Message(center=Message(x=10.0, y=8.0, theta=0.0), size_x=4.0, size_y=6.0),
        tracking_id="3",
    )
    silent = Message(header=header, results=[], bbox=entry.bbox)
    message = Message(header=header, detections=[entry, silent])
    (back,) = DetectionReader("/yolo", lambda frame: SE3.identity())(message, 5, 0)
    (car,) = back.detections
    assert (car.label, car.score, car.track_id, car.position_m) == ("car", 1.0, "3", None)
    np.testing.assert_array_equal(car.box_px, [8, 5, 12, 11])
    entry.bbox.size_x = float("nan")
    with pytest.raises(RecordingError, match="NaN"):
        DetectionReader("/yolo", lambda frame: SE3.identity())(message, 5, 0)


def test_the_detector_holds_detections_against_the_image():
    from belie.detector import Config, Detector

    for profile in ("default", "paper"):
        detector = Detector({"/cam/image": CAMERA}, Config(profile=profile))
        frame = Frame(camera="/cam/image", stamp_ns=10**9, received_ns=10**9, image=IMAGE)
        verdict = detector.update(frame, [claim(boxes())])
        assert {check.source for check in verdict.checks} <= {"/cam/image", claim(boxes()).source}
        assert not verdict.alerts
