"""What may go wrong beside a running robot, done to one `belie live dds` after the other by a real peer on loopback."""

from __future__ import annotations

import os
import signal
import struct
import threading
import time
from collections.abc import Iterator
from dataclasses import replace

import psutil
import pytest
from live_tools import BELIE, IMAGE, INFO, MODEL, ODOM, TF, Process, Robot, wait_until

from belie.bridges.settings import DdsSettings
from belie.bridges.transports.dds import DdsTransport
from belie.bridges.wire import Publisher, Received
from belie.geometry import CameraModel
from belie.recordings import messages
from belie.recordings import topics as ros
from belie.recordings.messages import STORE

pytestmark = pytest.mark.slow

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN, STALE = 0, 1, 3
KINDS = {TF: ros.TRANSFORMS, INFO: ros.CAMERA_INFO, ODOM: ros.ODOMETRY, IMAGE: ros.IMAGE}


class Peer:
    """A robot that drives in a thread of its own, twenty images a second, and hears what belie diagnoses."""

    def __init__(self, domain: int) -> None:
        self.robot, self.domain = Robot(), domain
        self.next, self.odometry_stops = 100, False
        self.model: CameraModel = MODEL
        self._lock, self._stop = threading.Lock(), threading.Event()
        self._heard: list[dict[str, tuple[int, str, dict[str, str]]]] = []
        self._observer = self.participant()
        self._observer.subscribe("/diagnostics", DIAGNOSTICS, self._hear, latched=False, depth=100)
        self.join()
        self._thread = threading.Thread(target=self._drive, daemon=True)
        self._thread.start()

    def participant(self) -> DdsTransport:
        """Another peer of the same network."""
        return DdsTransport(DdsSettings(interface="lo"), domain=self.domain)

    def join(self) -> None:
        """Announce the topics, anew where they were announced before."""
        self._transport = self.participant()
        self.out: dict[str, Publisher] = {
            topic: self._transport.advertise(topic, kind, latched=topic in (TF, INFO))
            for topic, kind in KINDS.items()
        }
        self.out[TF].publish(self.robot.tf())

    def restart(self) -> None:
        """Leave the network without a word, and come back."""
        with self._lock:
            self._transport.close()
            time.sleep(1.0)
            self.join()

    def _drive(self) -> None:
        while not self._stop.wait(self.robot.period_ns * 1e-9):
            with self._lock:
                k = self.next
                self.next += 1
                if not self.odometry_stops:
                    self.out[ODOM].publish(self.robot.odometry(k))
                self.out[INFO].publish(self.robot.info(k, self.model))
                self.out[IMAGE].publish(self.robot.image(k))

    def send(self, topic: str, data: bytes) -> None:
        """Send one message more."""
        with self._lock:
            self.out[topic].publish(data)

    def _hear(self, received: Received) -> None:
        message = STORE.deserialize_cdr(received.data, DIAGNOSTICS)
        self._heard.append(
            {
                one.name: (one.level, one.message, {v.key: v.value for v in one.values})
                for one in message.status
            }
        )

    def is_told(self, name: str, level: int, text: str = "", timeout_s: float = 15.0) -> bool:
        """Whether a status of this name, level and text is published from now on."""
        since = len(self._heard)

        def found() -> bool:
            told = [heard[name] for heard in self._heard[since:] if name in heard]
            return any(one == level and text in said for one, said, _ in told)

        return wait_until(found, timeout_s)

    def answered(self) -> int:
        """Frames that were answered, by the last diagnostics."""
        values = self._heard[-1]["belie: monitor"][2] if self._heard else {}
        return sum(int(count) for key, count in values.items() if key.startswith("frames "))

    def is_answered(self) -> bool:
        """Whether frames go on being answered from now on."""
        before = self.answered()
        return wait_until(lambda: self.answered() > before + 10, 20.0)

    def close(self) -> None:
        """Stop driving and leave."""
        self._stop.set()
        self._thread.join(5.0)
        self._transport.close()
        self._observer.close()


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Process]:
    folder = tmp_path_factory.mktemp("faults")
    config = folder / "live.toml"
    config.write_text("[intake]\nsettle_s = 0.5\n[answers]\nperiod_s = 0.2\nstale_after_s = 0.5\n")
    network = ["--domain", str(domain()), "--interface", "lo"]
    process = Process([*BELIE, "live", "dds", "--config", str(config), *network], folder / "live.log")
    process.wait_for("start")
    yield process
    process.stop()


@pytest.fixture(scope="module")
def peer(live: Process) -> Iterator[Peer]:
    peer = Peer(domain())
    live.wait_for("ready")
    assert peer.is_answered(), live.said()
    yield peer
    peer.close()


def domain() -> int:
    return 100 + (os.getpid() + 6) % 100


@pytest.fixture(autouse=True)
def survives(live: Process, peer: Peer) -> Iterator[None]:
    """Whatever is done to it, frames go on being answered, and memory does not run away."""
    before = psutil.Process(live.popen.pid).memory_info().rss
    yield
    assert peer.is_answered(), live.said()
    assert live.popen.poll() is None, live.said()
    assert "Traceback" not in live.said()
    assert psutil.Process(live.popen.pid).memory_info().rss - before < 100e6


def monitor(text: str) -> tuple[str, int, str]:
    return ("belie: monitor", WARN, text)


@pytest.mark.parametrize("topic", [ODOM, IMAGE, INFO, TF])
def test_damaged_bytes(peer, topic):
    peer.send(topic, b"\x00\x01\x00\x00" + b"\xff" * 60)
    assert peer.is_told(f"belie: input {topic}", WARN, "malformed message")


def test_bytes_of_another_type(peer):
    peer.send(ODOM, peer.robot.image(5))
    peer.send(IMAGE, peer.robot.odometry(5))
    assert peer.is_told(f"belie: input {IMAGE}", WARN, "malformed message")


def test_not_a_number(peer):
    message = STORE.deserialize_cdr(peer.robot.odometry(peer.next), ros.ODOMETRY)
    message.pose.pose.position = messages.new("geometry_msgs/msg/Point", x=float("nan"), y=0.0, z=0.0)
    peer.send(ODOM, bytes(STORE.serialize_cdr(message, ros.ODOMETRY)))
    assert peer.is_told(f"belie: input {ODOM}", WARN, "unusable value")


def test_an_image_whose_header_claims_a_gigabyte(peer):
    image = STORE.deserialize_cdr(peer.robot.image(5), ros.IMAGE)
    image.width, image.height, image.step = 40_000, 30_000, 40_000
    peer.send(IMAGE, bytes(STORE.serialize_cdr(image, ros.IMAGE)))
    assert peer.is_told(f"belie: input {IMAGE}", WARN, "undecodable image")


def test_an_image_whose_length_claims_a_gigabyte(peer):
    data = bytearray(peer.robot.image(6))
    struct.pack_into("<I", data, len(data) - 320 * 240 - 4, 1_000_000_000)
    peer.send(IMAGE, bytes(data))
    assert peer.is_told(f"belie: input {IMAGE}", WARN, "malformed message")


def test_ten_thousand_messages_a_second(peer):
    began_s, sent = time.monotonic(), 0
    while time.monotonic() - began_s < 5.0:
        data = peer.robot.odometry(peer.next)
        for _ in range(500):
            peer.out[ODOM].publish(data)
        sent += 500
        time.sleep(max(0.0, began_s + sent / 10_000 - time.monotonic()))
    assert sent / (time.monotonic() - began_s) > 5_000, "the test itself could not send as much"
    assert peer.is_told(f"belie: input {ODOM}", WARN, "flood")


def test_a_sensor_that_stops(peer):
    peer.odometry_stops = True
    assert peer.is_told(f"belie: input {ODOM}", STALE, "silent")
    assert peer.is_told(f"belie: odometry {ODOM}", STALE, "silent")
    peer.odometry_stops = False
    assert peer.is_told(f"belie: input {ODOM}", OK, timeout_s=30.0), "once earlier faults are ten seconds old"


def test_camera_info_that_changes(peer):
    peer.model = replace(MODEL, fx=210.0, fy=210.0)
    assert peer.is_told(*monitor("camera info changed"))
    peer.model = MODEL


@pytest.mark.parametrize("jump_s", [100, -50])
def test_a_clock_that_jumps(peer, live, jump_s):
    before = live.said().count("clock jump")
    with peer._lock:
        peer.next += 20 * jump_s
    assert peer.is_told(*monitor("clock jump"))
    assert live.said().count("clock jump") > before


def test_a_publisher_of_another_type(peer):
    other = peer.participant()
    other.advertise(ODOM, "std_msgs/msg/String", latched=False)
    try:
        assert peer.is_told(f"belie: input {ODOM}", WARN, "type mismatch: published as std_msgs/msg/String")
    finally:
        other.close()


def test_a_publisher_of_another_qos(peer):
    other = peer.participant()
    other.advertise(TF, ros.TRANSFORMS, latched=False)
    try:
        assert peer.is_told(f"belie: input {TF}", WARN, "QoS mismatch")
    finally:
        other.close()


def test_a_publisher_that_restarts(peer):
    peer.restart()
    assert peer.is_told(f"belie: input {IMAGE}", OK, timeout_s=30.0)


def test_settings_that_are_read_again_and_again(peer, live):
    process = psutil.Process(live.popen.pid)
    threads = []
    for _ in range(4):
        before = live.said().count("ready")
        live.popen.send_signal(signal.SIGHUP)
        assert wait_until(lambda before=before: live.said().count("ready") > before), live.said()
        assert peer.is_answered(), live.said()
        threads.append(process.num_threads())
    assert max(threads[1:]) <= threads[0], "each session ends its threads"
