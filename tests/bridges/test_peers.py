"""Real middleware on loopback: a process that plays a bag, a process that watches; the answers of `belie check`."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import time
from pathlib import Path

import pytest
from live_tools import BELIE, DEMO, LIKE_CHECK, free_port, wait_until, watch_under_attack

from belie.attacks import attack
from belie.detector import Config
from belie.evaluation.run import run_detector
from belie.recordings import open_recording, write_mcap
from belie.types.json_lines import json_line

pytestmark = pytest.mark.slow

DEBIAN_ROSPY = Path("/usr/lib/python3/dist-packages/rospy")
ROUTER = """
import sys, threading, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"router"')
config.insert_json5("listen/endpoints", f'["tcp/127.0.0.1:{sys.argv[1]}"]')
config.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(config)
print("router up", flush=True)
threading.Event().wait()
"""
MASTER = "import sys, rosmaster; rosmaster.rosmaster_main(['rosmaster', '--core', '-p', sys.argv[1]])"


# A ROS 1 node as anybody writes it, with the messages that Debian generated: passes the odometry on, reads the alerts.
NODE = """
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
rospy.init_node("relay")
out = rospy.Publisher("/odom_relayed", Odometry, queue_size=100)
def relay(message):
    while out.get_num_connections() == 0:
        rospy.sleep(0.01)
    out.publish(message)
rospy.Subscriber("/odom", Odometry, relay, queue_size=1000)
def tell(message):
    for status in message.status:
        print("told:", status.name, status.level, flush=True)
rospy.Subscriber("/belie/alerts", DiagnosticArray, tell)
print("node up", flush=True)
rospy.spin()
"""


def in_ci() -> bool:
    """CI installs every peer: there, a missing one is a failure and no reason to skip."""
    return os.environ.get("CI") == "true"


@pytest.fixture(scope="session")
def attacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bundled drive with lies of two kinds."""
    path = tmp_path_factory.mktemp("live") / "attacked.mcap"
    recording = attack(
        open_recording(DEMO), ["paper-odometry:start=60", "position-offset:magnitude=3,start=90"]
    )
    write_mcap(
        path,
        recording,
        cameras=recording.cameras,
        body_axes=recording.body_axes,
        image_encoding="jpeg",
        geodetic_origin=recording.geodetic_origin,
    )
    return path


@pytest.fixture(scope="session")
def answers_of_check(attacked: Path) -> list[dict]:
    lines: list[str] = []
    run_detector(
        open_recording(attacked), Config(), on_verdict=lambda verdict: lines.append(json_line(verdict))
    )
    return comparable(lines)


def comparable(lines: list[str]) -> list[dict]:
    answers = [json.loads(line) for line in lines]
    for answer in answers:
        del answer["latency_ms"]  # the one thing that may differ
    return answers


def assert_same(lines: list[str], expected: list[dict]) -> None:
    """Tells the first difference; pytest would print both lists whole."""
    got = comparable(lines)
    assert [answer["frame"] for answer in got] == [answer["frame"] for answer in expected]
    for answer, asked in zip(got, expected, strict=True):
        for key, value in asked.items():
            assert answer[key] == value, f"frame {asked['frame']}, {key}"


def live_config(tmp_path: Path, more: str = "") -> Path:
    path = tmp_path / "live.toml"
    path.write_text(LIKE_CHECK + more)
    return path


def test_dds(attacked, answers_of_check, start, tmp_path):
    domain = str(100 + os.getpid() % 100)
    network = ["--domain", domain, "--interface", "lo"]
    config = live_config(tmp_path, "[dds]\nreliable = true\n")
    evidence, out = tmp_path / "evidence", tmp_path / "live.jsonl"
    options = ["--config", str(config), "--json", str(out), "--evidence", str(evidence), *network]
    live = start([*BELIE, "live", "dds", *options], "live")
    live.wait_for("waiting")
    good = config.read_text()
    config.write_text(good + "frame = 3\n")
    live.popen.send_signal(signal.SIGHUP)
    live.wait_for("reload refused")
    config.write_text('metrics = "nowhere"\n' + good)
    live.popen.send_signal(signal.SIGHUP)
    play = start([*BELIE, "play", str(attacked), "dds", *network, "--wait", "1"], "play")
    live.wait_for("the old ones stay: metrics 'nowhere'")  # told once topics are there, and sinks are opened
    play.wait_for("played")
    assert wait_until(lambda: len(out.read_text().splitlines()) == len(answers_of_check))
    began = time.monotonic()
    assert live.stop(signal.SIGTERM) == 1, live.said()
    assert time.monotonic() - began < 2.0 + 1.0, "stops within 2 s; the interpreter's own end comes on top"
    assert_same(out.read_text().splitlines(), answers_of_check)
    (bag,) = evidence.glob("*.mcap")
    alerts = run_detector(open_recording(bag), Config()).alerts
    assert {traced.raised.alert.type.value for traced in alerts} == {"odometry_spoofing", "position_spoofing"}


def test_zenoh(attacked, answers_of_check, start, tmp_path):
    port = str(free_port())
    start([sys.executable, "-c", ROUTER, port], "router").wait_for("router up")
    network = ["--endpoint", f"tcp/127.0.0.1:{port}"]
    out = tmp_path / "live.jsonl"
    options = ["--config", str(live_config(tmp_path)), "--json", str(out), *network]
    live = start([*BELIE, "live", "zenoh", *options], "live")
    live.wait_for("waiting")
    play = start([*BELIE, "play", str(attacked), "zenoh", *network, "--wait", "1"], "play")
    play.wait_for("played")
    assert wait_until(lambda: len(out.read_text().splitlines()) == len(answers_of_check)), live.said()
    assert live.stop(signal.SIGINT) == 1, live.said()
    assert_same(out.read_text().splitlines(), answers_of_check)


@pytest.mark.skipif(
    not in_ci() and not DEBIAN_ROSPY.is_dir(),
    reason="apt install python3-rosmaster python3-rospy python3-nav-msgs python3-geometry-msgs",
)
def test_ros1(attacked, answers_of_check, start, tmp_path):
    port = str(free_port())
    env = {
        "ROS_HOSTNAME": "127.0.0.1",
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_HOME": str(tmp_path / "ros"),
        "ROS_LOG_DIR": str(tmp_path / "ros"),
    }
    start(["/usr/bin/python3", "-c", MASTER, port], "master", env)
    time.sleep(2.0)
    out = tmp_path / "live.jsonl"
    node = start(["/usr/bin/python3", "-c", NODE], "node", env)
    node.wait_for("node up")
    topics = ["--odometry", "/odom_relayed"]
    options = ["--config", str(live_config(tmp_path)), "--json", str(out), *topics]
    live = start([*BELIE, "live", "ros1", *options], "live", env)
    live.wait_for("waiting")
    play = start([*BELIE, "play", str(attacked), "ros1", "--wait", "1"], "play", env)
    play.wait_for("played")
    assert wait_until(lambda: len(out.read_text().splitlines()) == len(answers_of_check)), live.said()
    assert wait_until(lambda: "told: belie: position_spoofing /gnss/fix" in node.said()), node.said()
    assert "told: belie: odometry_spoofing /odom_relayed 2" in node.said()
    assert live.stop(signal.SIGINT) == 1, live.said()
    lines = out.read_text().replace("/odom_relayed", "/odom").splitlines()
    assert_same(lines, answers_of_check)


def test_attack_on_a_running_robot(start, tmp_path):
    spec, topic = "paper-odometry:start=50", "/odom_attacked"
    alerts, hijack = watch_under_attack(start, tmp_path, spec, "--odometry", topic, 1)
    assert [(a["type"], a["source"]) for a in alerts] == [("odometry_spoofing", "/odom_attacked")]
    assert "messages altered" in hijack.said()


@pytest.mark.skipif(not in_ci() and shutil.which("mosquitto") is None, reason="apt install mosquitto")
def test_mqtt_broker_that_comes_late_and_restarts(start, tmp_path):
    import paho.mqtt.client as mqtt

    from belie.bridges.board import Board
    from belie.bridges.settings import MqttSettings, RetrySettings
    from belie.bridges.sinks.mqtt import MqttSink

    port = free_port()
    broker = [shutil.which("mosquitto") or "/usr/sbin/mosquitto", "-p", str(port)]
    board = Board()
    settings = MqttSettings(host="127.0.0.1", port=port, period_s=0.5, serial="cart7")
    sink = MqttSink(settings, RetrySettings(first_s=0.1, longest_s=1.0), board)
    try:
        sink.tick(board.picture(()))
        assert wait_until(lambda: board.sink("mqtt")["failed"] > 0), "there is no broker yet"
        first = start(broker, "broker")
        got: list[dict] = []
        listener = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        listener.on_message = lambda *args: got.append(json.loads(args[2].payload))
        listener.on_connect = lambda client, *_: client.subscribe("belie/v2/belie/cart7/state", qos=1)
        listener.reconnect_delay_set(1, 1)
        listener.connect_async("127.0.0.1", port)
        listener.loop_start()
        assert wait_until(lambda: sink.tick(board.picture(())) or bool(got))
        board.fault("/odom", "malformed message", "12 bytes")
        assert wait_until(lambda: sink.tick(board.picture(())) or bool(got[-1]["errors"]))
        assert got[-1]["errors"][0]["errorType"] == "malformed_message"
        assert got[-1]["errors"][0]["errorLevel"] == "WARNING"
        first.stop()
        start(broker, "broker-again")
        count = len(got)
        assert wait_until(lambda: sink.tick(board.picture(())) or len(got) > count, 30.0), (
            "comes back by itself"
        )
        listener.loop_stop()
    finally:
        sink.close(1.0)
