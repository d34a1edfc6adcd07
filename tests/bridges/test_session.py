"""A whole session on a transport within the process: it starts, answers, survives, reloads and stops."""

from __future__ import annotations

import json
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import psutil
import pytest
from live_tools import IMAGE, INFO, ODOM, TF, free_port, quick_settings, wait_until

from belie.bridges.board import Board
from belie.bridges.introduction import Introduction
from belie.bridges.live import LiveSession
from belie.bridges.pipeline import Pipeline
from belie.bridges.wire import Offer, Received
from belie.geometry import SE3, CameraModel
from belie.odometry import VisualOdometry
from belie.odometry.tracking import second_thread
from belie.recordings import messages
from belie.recordings import topics as ros
from belie.recordings.messages import STORE
from belie.types import ConfigError, Status, TransportError

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


@contextmanager
def running(transport, robot, settings=None, **options) -> Iterator[LiveSession]:
    transport.offered = transport.offered or robot.offers()
    events: list[str] = []
    session = LiveSession(transport, settings or quick_settings(), on_event=events.append, **options)
    session.events = events
    thread = threading.Thread(target=session.run, daemon=True)
    thread.start()
    assert wait_until(lambda: ODOM in transport.handlers), events
    try:
        yield session
    finally:
        began = time.monotonic()
        session.request("stop")
        thread.join(10.0)
        session.stopped_s = time.monotonic() - began
        assert not thread.is_alive()


def answered(session: LiveSession) -> int:
    return sum(session.board.statuses.values())


def statuses(transport) -> dict[str, tuple[int, str]]:
    """Level and message of each status in the last diagnostics."""
    message = STORE.deserialize_cdr(transport.published["/diagnostics"][-1], DIAGNOSTICS)
    return {status.name: (status.level, status.message) for status in message.status}


def ever(transport, name: str, level: int) -> bool:
    """Whether a status was published with this level; on a busy machine the last one may be stale already."""
    every = [STORE.deserialize_cdr(data, DIAGNOSTICS) for data in transport.published["/diagnostics"]]
    return any((one.name, one.level) == (name, level) for message in every for one in message.status)


def fault_kinds(session: LiveSession) -> set[tuple[str, str]]:
    return {(fault.topic, fault.kind) for fault in session.board.faults()}


def test_every_frame_is_answered_and_diagnosed(transport, robot, tmp_path):
    path = tmp_path / "out.jsonl"
    with running(transport, robot, json=path) as session:
        robot.introduce(transport)
        robot.drive(transport, 0, 30)
        assert wait_until(lambda: answered(session) == 30)
        assert wait_until(lambda: "belie: odometry /odom" in statuses(transport))
        assert wait_until(lambda: ever(transport, "belie: input /odom", 0))
    assert session.stopped_s < 2.0
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["frame"] for line in lines] == list(range(30))
    assert any("ready" in event for event in session.events)
    assert transport.published["/belie/alerts"], "the latched topic must hold something from the start"


def test_only_the_newest_frame_waits_and_drops_are_counted(transport, robot):
    settings = quick_settings(intake={"settle_s": 0.05, "frames": 1})
    with running(transport, robot, settings) as session:
        robot.introduce(transport)
        robot.drive(transport, 0, 3)
        assert wait_until(lambda: answered(session) == 3)
        robot.drive(transport, 3, 200, pause_s=0.0)
        dropped = lambda: session.picture().inputs[0].dropped  # noqa: E731
        assert wait_until(lambda: answered(session) + dropped() == 203)
        assert dropped() > 0


def test_a_silent_stream_is_stale_and_comes_back(transport, robot):
    settings = quick_settings(answers={"period_s": 0.2, "stale_after_s": 0.3})
    with running(transport, robot, settings) as session:
        robot.introduce(transport)
        robot.drive(transport, 0, 10, pause_s=0.02)
        for k in range(10, 60):
            transport.send(IMAGE, robot.image(k))
            time.sleep(0.02)
        assert wait_until(lambda: ever(transport, "belie: input /odom", 3))
        assert wait_until(lambda: ever(transport, "belie: odometry /odom", 3))
        assert wait_until(lambda: answered(session) == 60)
        transport.published["/diagnostics"].clear()
        robot.drive(transport, 60, 10, pause_s=0.02)
        assert wait_until(lambda: answered(session) == 70)
        assert wait_until(lambda: ever(transport, "belie: input /odom", 0))


def test_damaged_messages_are_named_and_survived(transport, robot):
    with running(transport, robot) as session:
        robot.introduce(transport)
        robot.drive(transport, 0, 5)
        assert wait_until(lambda: answered(session) == 5)
        transport.send(ODOM, b"")
        transport.send(ODOM, b"\x00\x01\x00\x00garbage")
        transport.send(ODOM, robot.image(5))  # wrong type
        transport.send(IMAGE, robot.odometry(5))
        transport.send(INFO, b"\xff" * 40)
        transport.send("/tf_static", b"\x00\x01\x00\x00\xff\xff\xff\x7f")
        nan = messages.new("geometry_msgs/msg/Point", x=float("nan"), y=0.0, z=0.0)
        message = STORE.deserialize_cdr(robot.odometry(5), ros.ODOMETRY)
        message.pose.pose.position = nan
        transport.send(ODOM, bytes(STORE.serialize_cdr(message, ros.ODOMETRY)))
        robot.drive(transport, 6, 20)
        assert wait_until(lambda: answered(session) == 25)
        kinds = fault_kinds(session)
        assert {
            (ODOM, "malformed message"),
            (IMAGE, "malformed message"),
            (INFO, "malformed message"),
        } <= kinds
        assert (ODOM, "unusable value") in kinds
        assert wait_until(lambda: "malformed message" in statuses(transport)["belie: input /odom"][1])


def test_an_image_that_claims_a_gigabyte_costs_no_memory(transport, robot):
    with running(transport, robot) as session:
        robot.introduce(transport)
        robot.drive(transport, 0, 5)
        assert wait_until(lambda: answered(session) == 5)
        before = psutil.Process().memory_info().rss
        honest = STORE.deserialize_cdr(robot.image(5), ros.IMAGE)
        honest.width, honest.height, honest.step = 40_000, 30_000, 40_000
        transport.send(IMAGE, bytes(STORE.serialize_cdr(honest, ros.IMAGE)))
        claimed = bytearray(robot.image(6))
        at = len(claimed) - 320 * 240 - 4
        assert struct.unpack_from("<I", claimed, at) == (320 * 240,)
        struct.pack_into("<I", claimed, at, 1_000_000_000)
        transport.send(IMAGE, bytes(claimed))
        robot.drive(transport, 7, 5)
        assert wait_until(lambda: answered(session) == 10)
        assert psutil.Process().memory_info().rss - before < 100e6
        assert {(IMAGE, "undecodable image"), (IMAGE, "malformed message")} <= fault_kinds(session)


def test_a_flood_on_a_claim_topic_is_bounded_and_counted(transport, robot):
    settings = quick_settings(intake={"settle_s": 0.05, "frames": 1, "claims": 200})
    with running(transport, robot, settings) as session:
        robot.introduce(transport)
        robot.drive(transport, 0, 5)
        assert wait_until(lambda: answered(session) == 5)
        before = psutil.Process().memory_info().rss
        data = robot.odometry(5)
        frame = 6
        until = time.monotonic() + 3.0
        sent, began = 0, time.monotonic()
        while time.monotonic() < until:
            for _ in range(500):
                transport.send(ODOM, data)
            sent += 500
            transport.send(IMAGE, robot.image(frame))
            frame += 1
            time.sleep(max(0.0, began + sent / 10_000 - time.monotonic()))
        picture = session.picture()
        odometry = next(one for one in picture.inputs if one.topic == ODOM)
        assert odometry.received > 10_000
        assert psutil.Process().memory_info().rss - before < 150e6
        assert answered(session) > 10, "frames go on being answered"
        assert wait_until(lambda: fault_kinds(session) == {(ODOM, "flood")})


def test_a_reload_begins_a_new_session_on_the_same_transport(transport, robot, tmp_path):
    path = tmp_path / "out.jsonl"
    for turn in range(2):
        with running(transport, robot, json=path) as session:
            robot.introduce(transport)
            robot.drive(transport, 0, 5)
            assert wait_until(lambda session=session: answered(session) == 5)
            session.request("reload")
        assert not transport.handlers, "nobody listens for a session that is over"
        assert len(path.read_text().splitlines()) == 5 * (turn + 1)


def test_a_session_that_is_over_leaves_no_thread_behind(transport, robot, tmp_path):
    settings = quick_settings(
        answers={"annotated": "/belie/annotated"}, evidence={"folder": str(tmp_path)},
        metrics=f"127.0.0.1:{free_port()}",
    )  # fmt: skip
    second_thread().submit(int).result()  # one for the whole process, that stays
    before = {thread.ident for thread in threading.enumerate()}
    with running(transport, robot, settings, json=tmp_path / "out.jsonl") as session:
        robot.introduce(transport)
        robot.drive(transport, 0, 5)
        assert wait_until(lambda: answered(session) == 5)
        assert {f"belie-{topic}" for topic in ("/diagnostics", "/belie/alerts", "/belie/annotated")} <= {
            thread.name for thread in threading.enumerate()
        }
        session.request("reload")

    def left() -> set[str]:
        return {t.name for t in threading.enumerate() if t.ident not in before}

    assert wait_until(lambda: not left(), 5.0), left()
    assert session.picture().sinks["/diagnostics"]["dropped"] == 0, "what waited was published first"


def test_sinks_that_were_open_before_one_failed_are_closed(transport, robot, tmp_path):
    metrics = f"127.0.0.1:{free_port()}"
    bad = quick_settings(
        metrics=metrics, evidence={"folder": str(tmp_path)}, webhook={"url": "htp://a-typo.example"}
    )
    transport.offered = robot.offers()
    with pytest.raises(ConfigError, match="webhook"):
        LiveSession(transport, bad, on_event=lambda text: None).run()
    names = {thread.name for thread in threading.enumerate()}
    assert not names & {"belie-evidence", "belie-/diagnostics", "belie-/belie/alerts"}
    with running(transport, robot, quick_settings(metrics=metrics)) as session:  # the port is free again
        robot.introduce(transport)
        robot.drive(transport, 0, 5)
        assert wait_until(lambda: answered(session) == 5)


def test_a_topic_that_cannot_be_subscribed_leaves_nothing_behind(transport, robot, monkeypatch):
    metrics = f"127.0.0.1:{free_port()}"
    transport.offered = robot.offers()
    subscribe = transport.subscribe

    def refuse_images(topic, *arguments, **options) -> None:
        if topic == IMAGE:
            raise TransportError("no such type support")
        subscribe(topic, *arguments, **options)

    with monkeypatch.context() as patched:
        patched.setattr(transport, "subscribe", refuse_images)
        with pytest.raises(TransportError, match="type support"):
            LiveSession(transport, quick_settings(metrics=metrics), on_event=lambda text: None).run()
    assert not transport.handlers
    assert "belie-monitor" not in {thread.name for thread in threading.enumerate()}
    with running(transport, robot, quick_settings(metrics=metrics)):
        pass  # the port is free again


@pytest.mark.parametrize("jump_s", [-100.0, 100.0])
def test_a_clock_jump_begins_the_watch_anew(transport, robot, jump_s):
    with running(transport, robot) as session:
        robot.introduce(transport)
        robot.drive(transport, 4000, 10)
        assert wait_until(lambda: answered(session) == 10)
        first = 4000 + round(jump_s * 20)
        robot.drive(transport, first, 15)
        assert wait_until(lambda: answered(session) >= 24)
        assert ("", "clock jump") in fault_kinds(session)
        assert session.board.answer.verdict.frame < 20, "a new watch counts from 0"


def test_a_stream_of_another_clock_is_left_out_and_the_watch_goes_on(transport, robot):
    with running(transport, robot) as session:
        robot.introduce(transport)
        for k in range(60):
            transport.send(ODOM, robot.odometry(k + 4000))  # 200 s ahead of the images
            transport.send(IMAGE, robot.image(k))
            time.sleep(0.005)
        assert wait_until(lambda: answered(session) == 60)
        assert fault_kinds(session) == {(ODOM, "foreign clock")}
        assert session.board.answer.verdict.frame == 59, "the watch was never begun anew"
        assert wait_until(lambda: "foreign clock" in statuses(transport)["belie: input /odom"][1])


def test_a_stream_that_mends_its_clock_is_taken_in_again(transport, robot):
    with running(transport, robot) as session:
        robot.introduce(transport)
        for k in range(40):
            transport.send(ODOM, robot.odometry(k + 4000))
            transport.send(IMAGE, robot.image(k))
            time.sleep(0.005)
        assert wait_until(lambda: answered(session) == 40)
        robot.drive(transport, 40, 60)
        assert wait_until(lambda: answered(session) == 100)
        odometry = next(c for c in session.board.answer.verdict.checks if c.source == ODOM)
        assert odometry.status is Status.CONSISTENT, odometry.reason
        (fault,) = session.board.faults()
        assert (fault.kind, fault.count) == ("foreign clock", 40), "counted as long as it lasted"


def test_an_image_a_little_older_than_the_one_before_is_left_out(transport, robot):
    with running(transport, robot) as session:
        robot.introduce(transport)
        robot.drive(transport, 0, 20)
        assert wait_until(lambda: answered(session) == 20)
        transport.send(IMAGE, robot.image(20, stamp_ns=19 * robot.period_ns - 1_000_000))
        robot.drive(transport, 20, 10)
        assert wait_until(lambda: answered(session) == 30)
        (fault,) = session.board.faults()
        assert (fault.topic, fault.kind, fault.count) == (IMAGE, "image out of order", 1)
        assert session.board.answer.verdict.frame == 29, "the watch was never begun anew"
        transport.send(IMAGE, robot.image(30, stamp_ns=29 * robot.period_ns - 1_000_000_000))
        assert wait_until(lambda: ("", "clock jump") in fault_kinds(session))


def test_odometry_that_speaks_late_is_judged_in_its_own_frame(transport, robot):
    settings = quick_settings(
        intake={"settle_s": 0.05, "first_message_s": 0.2, "frames": 100, "start_frames": 100}
    )
    mount = SE3([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0.0, 0.0, 1.0])
    sits = [
        ("base_link", "cam_optical_frame", mount),
        ("base_link", "imu_link", SE3.from_translation([1.0, 0, 0])),
    ]
    with running(transport, robot, settings) as session:
        transport.send(TF, bytes(STORE.serialize_cdr(messages.transforms(sits, 0), ros.TRANSFORMS)))
        transport.send(INFO, robot.info(0))
        transport.send(IMAGE, robot.image(0))
        assert wait_until(lambda: session.board.watching)
        for k in range(1, 21):
            message = STORE.deserialize_cdr(robot.odometry(k), ros.ODOMETRY)
            message.child_frame_id = "imu_link"
            transport.send(ODOM, bytes(STORE.serialize_cdr(message, ros.ODOMETRY)))
            transport.send(IMAGE, robot.image(k))
            time.sleep(0.005)
        assert wait_until(lambda: answered(session) >= 20)
        assert fault_kinds(session) == {("", "odometry frame")}
        (fault,) = session.board.faults()
        assert fault.count == 1
        assert "tells of imu_link, not of base_link" in fault.text


def test_odometry_that_speaks_late_is_vouched_for_once_its_noise_is_known(transport, robot):
    settings = quick_settings(
        intake={"settle_s": 0.05, "first_message_s": 0.2, "frames": 1000, "start_frames": 1000}
    )
    with running(transport, robot, settings) as session:
        robot.introduce(transport)
        late = 300  # 15 s of images
        for k in range(late):
            transport.send(IMAGE, robot.image(k))
            time.sleep(0.003)
        assert session.board.watching
        robot.drive(transport, late, 60)
        assert wait_until(lambda: answered(session) == late + 60), session.picture()
        assert not session.board.faults()
        odometry = next(c for c in session.board.answer.verdict.checks if c.source == ODOM)
        assert odometry.status is Status.CONSISTENT, odometry.reason


def introduced(robot) -> tuple[Pipeline, Callable[..., None]]:
    """A watch of a robot that has introduced itself, and how to give it a message at the time of image `k`."""
    image, info, odom = (
        ros.Topic(name=offer.topic, message_type=offer.message_type, count=1) for offer in robot.offers()
    )
    choice = ros.Choice(
        image=image, camera_info=info, odometry=odom, position=None, imu=None, detections=None
    )
    introduction = Introduction(choice, info_by_name=False)
    introduction.frames.add_message(STORE.deserialize_cdr(robot.tf(), ros.TRANSFORMS))
    introduction.hear_info(STORE.deserialize_cdr(robot.info(0), ros.CAMERA_INFO))
    introduction.hear_image("cam_optical_frame", (320, 240))
    pipeline = Pipeline(introduction, quick_settings(), Board())

    def add(topic: str, kind: str, data: bytes, k: int) -> None:
        received = Received(topic=topic, message_type=kind, data=data, received_ns=k * robot.period_ns)
        pipeline.add(received, STORE.deserialize_cdr(data, kind))

    return pipeline, add


def test_a_frame_is_looked_at_while_it_waits_for_its_claims(robot, monkeypatch):
    pipeline, add = introduced(robot)
    for k in range(3):
        add(ODOM, ros.ODOMETRY, robot.odometry(k), k)
        add(IMAGE, ros.IMAGE, robot.image(k), k)
        assert len(list(pipeline.release(k * robot.period_ns + 1))) == 1
    add(IMAGE, ros.IMAGE, robot.image(3), 3)
    assert not list(pipeline.release(3 * robot.period_ns + 1)), "the odometry is awaited"
    pipeline.look()
    with monkeypatch.context() as patched:
        patched.delattr(VisualOdometry, "update")  # it must have been seen by now
        add(ODOM, ros.ODOMETRY, robot.odometry(3), 3)
        (answer,) = pipeline.release(3 * robot.period_ns + 2)
    assert answer.verdict.frame == 3


def test_claims_do_not_pile_up_while_the_camera_is_dead(robot):
    pipeline, add = introduced(robot)
    for k in range(400):  # 20 s before the first image
        add(ODOM, ros.ODOMETRY, robot.odometry(k), k)
    assert len(pipeline._early) <= 101
    add(IMAGE, ros.IMAGE, robot.image(400), 400)
    assert len(list(pipeline.release(410 * robot.period_ns))) == 1
    for k in range(401, 1000):  # 30 s after the last
        add(ODOM, ros.ODOMETRY, robot.odometry(k), k)
    waiting = pipeline._joiner.streams[ODOM].waiting
    assert 90 <= len(waiting) <= 101, "five seconds at 20 Hz"
    add(IMAGE, ros.IMAGE, robot.image(1000), 1000)
    assert len(list(pipeline.release(1010 * robot.period_ns))) == 1


def test_a_changed_camera_begins_the_watch_anew(transport, robot):
    with running(transport, robot) as session:
        robot.introduce(transport)
        robot.drive(transport, 0, 10)
        assert wait_until(lambda: answered(session) == 10)
        transport.send(INFO, robot.info(10))  # the same camera
        assert ("", "camera info changed") not in fault_kinds(session)
        other = CameraModel(width=320, height=240, fx=250.0, fy=250.0, cx=159.5, cy=119.5)
        transport.send(INFO, robot.info(11, other))
        robot.drive(transport, 12, 10)
        assert wait_until(lambda: answered(session) == 20)
        assert ("", "camera info changed") in fault_kinds(session)


def test_links_that_do_not_fit_are_named(transport, robot):
    transport.offered = [*robot.offers(), Offer(topic=ODOM, message_type="std_msgs/msg/String")]
    transport.offered = robot.offers()
    transport.wrong = {ODOM: "a publisher of /odom offers another reliability than is asked for"}
    with running(transport, robot) as session:
        robot.introduce(transport)
        robot.drive(transport, 0, 5)
        transport.offered.append(Offer(topic=ODOM, message_type="std_msgs/msg/String"))
        assert wait_until(lambda: {(ODOM, "type mismatch"), (ODOM, "QoS mismatch")} <= fault_kinds(session))


def test_a_missing_mount_is_waited_for_and_named(transport, robot):
    with running(transport, robot) as session:
        transport.send(INFO, robot.info(0))
        robot.drive(transport, 0, 3)
        assert wait_until(lambda: "tf_static" in session.board.state)
        transport.send("/tf_static", robot.tf())
        robot.drive(transport, 3, 3)
        assert wait_until(lambda: answered(session) >= 5)


def test_a_lie_raises_an_alert_on_the_latched_topic(transport, robot):
    with running(transport, robot) as session:
        robot.introduce(transport)
        robot.drive(transport, 0, 60)
        assert wait_until(lambda: answered(session) == 60)
        assert not session.board.raised
        for k in range(60, 90):
            transport.send(ODOM, robot.odometry(k, yaw_rad=0.1 * (k - 60)))
            transport.send(IMAGE, robot.image(k))
            time.sleep(0.005)
        assert wait_until(lambda: session.board.raised["odometry_spoofing"] == 1)
        assert wait_until(
            lambda: STORE.deserialize_cdr(transport.published["/belie/alerts"][-1], DIAGNOSTICS).status
        )
        alert = STORE.deserialize_cdr(transport.published["/belie/alerts"][-1], DIAGNOSTICS).status[0]
        assert alert.level == 2
        assert {value.key: value.value for value in alert.values}["source"] == ODOM
        assert (
            np.array(
                [
                    s.level
                    for s in STORE.deserialize_cdr(
                        transport.published["/diagnostics"][-1], DIAGNOSTICS
                    ).status
                ]
            ).max()
            >= 1
        )
