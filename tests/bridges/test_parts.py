"""The parts between a middleware and the detector, one by one."""

from __future__ import annotations

import io
import os
import struct
import threading
import time
import tomllib
from contextlib import ExitStack
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import simplejpeg
from live_tools import DEMO, IMAGE, INFO, ODOM, free_port, quick_settings, wait_until
from rich.console import Console
from typer.testing import CliRunner

from belie.attacks import AttackSpec
from belie.bridges.board import Answer, Board, Input
from belie.bridges.discovery import discover
from belie.bridges.hijack import Hijack
from belie.bridges.intake import Intake
from belie.bridges.pipeline import decode_image
from belie.bridges.player import Player, as_bag, messages_of, types_of
from belie.bridges.rewriting import rewritten
from belie.bridges.settings import DdsSettings, IntakeSettings, TopicSettings, parse_live_settings
from belie.bridges.sinks.dashboard import drawn_picture
from belie.bridges.transports.dds import DdsTransport
from belie.bridges.transports.remapped import Remapped
from belie.bridges.wire import Offer, Received
from belie.cli.main import app
from belie.geometry import SE3
from belie.recordings import messages, open_recording
from belie.recordings import topics as ros
from belie.recordings.claims import ImuReader, PoseReader
from belie.recordings.geodesy import GeodeticPoint
from belie.recordings.images import GrayDecoder, UndecodableImageError
from belie.recordings.messages import STORE
from belie.recordings.rig import Rig, claim_reader
from belie.recordings.transforms import TransformTree
from belie.types import (
    AmbiguousTopicError,
    CheckResult,
    Frame,
    MotionClaim,
    PoseClaim,
    PositionClaim,
    Status,
    Verdict,
)

QUICK = IntakeSettings(settle_s=0.05)


# -- choosing topics -----------------------------------------------------------------------------------


def test_discovery_waits_for_what_is_missing_and_says_for_what(robot, transport):
    said: list[str] = []
    found: list[ros.Choice | None] = []
    options = {"stopped": lambda: False, "on_waiting": said.append}
    thread = threading.Thread(
        target=lambda: found.append(discover(transport, TopicSettings(), QUICK, **options)), daemon=True
    )
    thread.start()
    assert wait_until(lambda: bool(said))
    assert "no images" in said[0]
    transport.offered = robot.offers()
    thread.join(5.0)
    assert found[0].odometry.name == ODOM


def test_two_topics_that_would_do_are_an_error(robot, transport):
    transport.offered = [*robot.offers(), Offer(topic="/odom2", message_type=ros.ODOMETRY)]
    options = {"stopped": lambda: False, "on_waiting": print}
    with pytest.raises(AmbiguousTopicError, match="--odometry"):
        discover(transport, TopicSettings(), QUICK, **options)
    named = TopicSettings(odometry="/odom2")
    assert discover(transport, named, QUICK, **options).odometry.name == "/odom2"


def test_remapped_names_go_both_ways(transport):
    transport.offered = [
        Offer(topic="/r1/odom", message_type=ros.ODOMETRY),
        Offer(topic=ODOM, message_type="a/msg/B"),
    ]
    remapped = Remapped(transport, {ODOM: "/r1/odom"})
    got: list[Received] = []
    remapped.subscribe(ODOM, ros.ODOMETRY, got.append, latched=False, depth=1)
    transport.send("/r1/odom", b"x")
    assert [offer.topic for offer in remapped.offers()] == [ODOM]
    assert got[0].topic == ODOM


def test_the_intake_never_grows():
    intake = Intake(IMAGE, frames=1, claims=3)
    for k in range(100):
        for topic in (IMAGE, ODOM):
            intake.receive(Received(topic=topic, message_type="", data=b"", received_ns=k))
    assert [(m.topic, m.received_ns) for m in intake.take(0.0)] == [
        (ODOM, 97),
        (ODOM, 98),
        (IMAGE, 99),
        (ODOM, 99),
    ]
    assert intake.dropped == {IMAGE: 99, ODOM: 97}
    assert intake.take(0.0) == []


def test_a_compressed_image_that_claims_a_gigabyte_is_not_decoded():
    gray = np.zeros((8, 8), np.uint8)
    jpeg = bytearray(simplejpeg.encode_jpeg(gray[:, :, None], 90, "GRAY", "444"))
    at = jpeg.index(b"\xff\xc0") + 5  # start of frame: height and width
    struct.pack_into(">HH", jpeg, at, 40_000, 30_000)
    png = bytearray(cv2.imencode(".png", gray)[1].tobytes())
    struct.pack_into(">II", png, 16, 40_000, 30_000)
    for data in (jpeg, png):
        message = SimpleNamespace(format="", data=np.frombuffer(bytes(data), np.uint8))
        with pytest.raises(UndecodableImageError, match="claims 1200000000 pixels"):
            decode_image(GrayDecoder("/cam"), message, IntakeSettings().largest_image_px)


# -- playing and altering ------------------------------------------------------------------------------


def test_a_recording_is_played_in_its_order_and_time(transport):
    with ExitStack() as stack:
        recording = as_bag(open_recording(DEMO), stack)
        player = Player(transport, rate=1000.0)
        player.advertise(types_of(recording))
        began = time.monotonic()
        player.play(messages_of(recording, stack))
    assert time.monotonic() - began < 10.0
    assert player.sent == sum(map(len, transport.published.values()))
    assert len(transport.published["/camera/image_raw/compressed"]) == 120
    stamps = [STORE.deserialize_cdr(data, ros.ODOMETRY).header.stamp for data in transport.published["/odom"]]
    assert stamps == sorted(stamps, key=lambda stamp: (stamp.sec, stamp.nanosec))


def test_a_hijacked_topic_lies_in_its_span_only(robot, transport):
    transport.offered = robot.offers()
    events: list[str] = []
    spec = AttackSpec.of("odometry-offset", axis="x", magnitude=2.0, start=10, stop=20)
    hijack = Hijack(transport, quick_settings(), [spec], names={}, on_event=events.append)
    thread = threading.Thread(target=hijack.run, daemon=True)
    thread.start()
    assert wait_until(lambda: IMAGE in transport.handlers)
    robot.introduce(transport)
    robot.drive(transport, 0, 50, pause_s=0.002)
    transport.send(ODOM, b"damaged")
    assert wait_until(lambda: len(transport.published["/odom_attacked"]) == 51), events
    hijack.stop()
    thread.join(5.0)
    sent = transport.published["/odom_attacked"]
    assert sent[-1] == b"damaged", "what cannot be read goes on as it is"
    honest = [k for k in range(50) if sent[k] == robot.odometry(k)]
    lies = [k for k in range(50) if k not in honest]
    assert len(lies) == 10
    assert lies == list(range(lies[0], lies[0] + 10))
    lie = STORE.deserialize_cdr(sent[lies[0]], ros.ODOMETRY)
    assert lie.pose.pose.position.x == pytest.approx(2.0)
    assert lie.child_frame_id == "base_link"


def test_a_hijacked_camera_freezes(robot, transport):
    transport.offered = robot.offers()
    spec = AttackSpec.of("camera-freeze", start=10)
    hijack = Hijack(
        transport, quick_settings(), [spec], names={IMAGE: "/cam/lie"}, on_event=lambda text: None
    )
    thread = threading.Thread(target=hijack.run, daemon=True)
    thread.start()
    assert wait_until(lambda: INFO in transport.handlers)
    robot.introduce(transport)
    robot.drive(transport, 0, 40, pause_s=0.002)
    assert wait_until(lambda: len(transport.published["/cam/lie"]) == 40)
    hijack.stop()
    thread.join(5.0)
    images = [STORE.deserialize_cdr(data, ros.IMAGE) for data in transport.published["/cam/lie"]]
    assert (images[-1].data == images[-2].data).all()
    assert images[-1].header.stamp != images[-2].header.stamp
    assert (images[0].data != images[1].data).any()


def rig_with_imu() -> Rig:
    frames = TransformTree()
    frames.add("base_link", "imu", SE3([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [0.0, 0.0, 0.0]))
    frames.add("base_link", "cam", SE3.identity())
    return Rig(frames=frames, body="base_link", image_frame="cam")


def test_every_kind_of_message_is_rewritten_to_what_it_shall_claim():
    rig = rig_with_imu()
    stamps = {"stamp_ns": 5, "received_ns": 6}
    imu = MotionClaim(source="/imu", kind="imu", angular_rad_s=[1.0, 2.0, 3.0], **stamps)
    message = messages.imu(imu, "imu")
    lie = replace(imu, angular_rad_s=np.array([4.0, 5.0, 6.0]))
    again = rewritten(message, ros.IMU, (lie,), rig, None)
    (read,) = ImuReader("/imu", rig.R_body_imu("imu"))(again, 6, 0)
    assert read.angular_rad_s == pytest.approx([4.0, 5.0, 6.0])

    origin = GeodeticPoint(latitude_deg=48.0, longitude_deg=11.0, altitude_m=500.0)
    fix = PositionClaim(source="/fix", frame_id="enu", kind="gnss", position_m=[0.0, 0.0, 0.0], **stamps)
    message = messages.fix(fix, origin, "base_link")
    reader = claim_reader(
        rig, ros.Topic(name="/fix", message_type=ros.FIX, count=1), as_odometry=False, first=message
    )
    again = rewritten(message, ros.FIX, (replace(fix, position_m=np.array([3.0, 4.0, 0.0])),), rig, origin)
    assert reader(again, 6, 0)[0].position_m == pytest.approx([3.0, 4.0, 0.0], abs=1e-6)

    pose = PositionClaim(
        source="/pose", frame_id="map", kind="localisation", position_m=[1.0, 0.0, 0.0], **stamps
    )
    message = messages.localisation(pose)
    lie = replace(pose, position_m=np.array([9.0, 8.0, 7.0]))
    again = rewritten(message, ros.POSE_COVARIANCE, (lie,), rig, None)
    (read,) = PoseReader("/pose", as_odometry=False)(again, 6, 0)
    assert read.position_m == pytest.approx([9.0, 8.0, 7.0])

    odometry = PoseClaim(source=ODOM, frame_id="odom", T_odom_body=SE3.identity(), **stamps)
    twist = MotionClaim(
        source=ODOM, kind="twist", linear_m_s=[1.0, 0.0, 0.0], angular_rad_s=[0.0, 0.0, 0.0], **stamps
    )
    message = messages.odometry(odometry, twist, "base_link")
    lies = (odometry, replace(twist, linear_m_s=np.array([0.0, 5.0, 0.0])))
    assert rewritten(message, ros.ODOMETRY, lies, rig, None).twist.twist.linear.y == 5.0


# -- DDS within one process ----------------------------------------------------------------------------


def test_dds_carries_bytes_between_participants_and_names_what_does_not_fit(robot):
    domain = 100 + (os.getpid() + 2) % 100
    settings = DdsSettings(interface="lo")
    sender, receiver = DdsTransport(settings, domain=domain), DdsTransport(settings, domain=domain)
    try:
        late: list[Received] = []
        latched = sender.advertise("/tf_static", ros.TRANSFORMS, latched=True)
        latched.publish(robot.tf())
        latched.publish(robot.tf() + bytes(4))  # a robot has several who tell transforms
        plain = sender.advertise("/volatile", ros.TRANSFORMS, latched=False)
        image = sender.advertise(IMAGE, ros.IMAGE, latched=False)
        receiver.subscribe("/tf_static", ros.TRANSFORMS, late.append, latched=True, depth=10)
        assert wait_until(lambda: len(late) == 2), "who comes late gets all that is latched"
        assert late[0].data[: len(robot.tf())] == robot.tf()
        got: list[Received] = []
        receiver.subscribe(IMAGE, ros.IMAGE, got.append, latched=False, depth=5)
        receiver.subscribe("/volatile", ros.TRANSFORMS, got.append, latched=True, depth=5)
        assert wait_until(lambda: sender.subscribers(IMAGE) == 1)
        image.publish(robot.image(3))
        assert wait_until(lambda: len(got) == 1)
        assert got[0].data[: len(robot.image(3))] == robot.image(3)
        assert wait_until(lambda: "durability" in receiver.faults().get("/volatile", ""))
        offers = {offer.topic: offer for offer in receiver.offers()}
        assert offers["/tf_static"].latched
        assert not offers[IMAGE].latched
        assert offers[IMAGE].message_type == ros.IMAGE
        assert IMAGE not in {offer.topic for offer in sender.offers()}, "our own topics are left out"
        receiver.reset()
        assert wait_until(lambda: sender.subscribers(IMAGE) == 0)
        plain.publish(robot.tf())
    finally:
        sender.close()
        receiver.close()
    assert wait_until(
        lambda: not [t for t in threading.enumerate() if t.name == "belie-dds" and t.is_alive()]
    )


# -- command line ---------------------------------------------------------------------------------------


def run(*arguments: str):
    return CliRunner().invoke(app, [*arguments])


def test_every_setting_is_printed_and_read_back(tmp_path):
    result = run("live", "dds", "--print-config", "--odometry", "/odom", "--false-alarms-per-hour", "2")
    assert result.exit_code == 0
    settings = parse_live_settings(tomllib.loads(result.output))
    assert settings.topics.odometry == "/odom"
    assert settings.detector.sequential.false_alarms_per_hour == 2.0
    assert settings.join.patience_ms == 150.0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["live", "dds", "--remap", "odom=x"], "expected /NAME:=/OTHER"),
        (["live", "dds", "--config", "no.toml"], "cannot read the configuration"),
        (["live", "zenoh", "--endpoint", "udp/x:1"], "expected tcp/"),
        (["attack", "--live", "dds", "odometry-ofset"], "did you mean"),
        (["attack", "drive.mcap", "-o", "x.mcap"], "SPEC"),
        (["play", "no.mcap", "dds"], "does not exist"),
    ],
)
def test_wrong_usage_is_one_line(arguments, told):
    result = run(*arguments)
    assert result.exit_code == 2
    assert told in result.output
    assert "Traceback" not in result.output


def test_an_unknown_key_and_an_absent_router_are_one_line(tmp_path):
    config = tmp_path / "live.toml"
    config.write_text("[intake]\nframe = 1\n")
    result = run("live", "dds", "--config", str(config))
    assert (result.exit_code, "intake.frame" in result.output) == (2, True)
    result = run("live", "zenoh", "--endpoint", f"tcp/127.0.0.1:{free_port()}", "--list")
    assert (result.exit_code, "no Zenoh router" in result.output) == (2, True)


def test_the_dashboard_takes_no_name_for_markup():
    board = Board(state="watching", watching=True)
    result = CheckResult(
        check="hiding", source="/det", status=Status.UNDECIDED, reason="car [/b] is missing", object="[/b]"
    )
    board.note(answer_of(result))
    board.fault("/det", "malformed message", "x")
    console = Console(width=160, record=True, file=io.StringIO())
    one = Input(
        topic="/[/b]", message_type="", received=0, dropped=0, lost=0, age_s=None, rate_hz=None, silent=True
    )
    console.print(drawn_picture(board.picture((one,))))
    shown = console.export_text()
    assert "age [s]" in shown
    assert "car [/b] is missing" in shown


def test_reasons_of_objects_with_names_of_their_own_do_not_pile_up():
    board = Board()
    for k in range(1000):
        name = "".join(chr(ord("a") + int(digit)) for digit in str(k))
        result = CheckResult(check="hiding", source="/det", status=Status.UNDECIDED, reason=f"{name} is gone")
        board.note(answer_of(result))
    assert len(board.undecided) <= 201
    assert sum(board.undecided.values()) == 1000


def answer_of(result: CheckResult) -> Answer:
    frame = Frame(camera="/cam", stamp_ns=0, received_ns=0, image=np.zeros((4, 4), np.uint8))
    verdict = Verdict(frame=0, stamp_ns=0, status=result.status, latency_ms=1.0, checks=(result,))
    return Answer(verdict=verdict, frame=frame, decode_ms=1.0, answered_ns=1)


def test_the_dashboard_shows_faults():
    board = Board(state="watching", watching=True)
    board.fault(ODOM, "clock jump", "back by 3 s")
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(drawn_picture(board.picture(())))
    assert "clock jump" in console.export_text()
