"""A transport within one process, messages made by hand, and real peers on loopback, each started and stopped."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from belie.bridges.settings import LiveSettings, parse_live_settings
from belie.bridges.wire import Offer, Received, now_ns
from belie.geometry import SE3, CameraModel, so3_exp
from belie.recordings import messages
from belie.recordings import topics as ros
from belie.recordings.messages import STORE
from belie.types import PoseClaim

DEMO = Path(__file__).resolve().parents[2] / "src" / "belie" / "cli" / "demo_drive.mcap"
IMAGE, INFO, ODOM, TF = "/cam/image_raw", "/cam/camera_info", "/odom", "/tf_static"
BELIE = [sys.executable, "-c", "from belie.cli.main import app; app()"]

# Nothing may be dropped, and frames wait longer than `belie check` holds them, for a machine that is busy with other
# tests delays messages, too: then the answers must be the same.
LIKE_CHECK = """
[intake]
frames = 1000
claims = 100000
awaited = ["odometry", "imu", "position", "detections"]
settle_s = 0.5
[join]
reorder_window_ms = 3000
patience_ms = 5000
max_waiting_frames = 500
"""


@dataclass
class FakeTransport:
    """Topics within one process; `send` plays the robot."""

    name: str = "fake"
    offered: list[Offer] = field(default_factory=list)
    handlers: dict[str, list[tuple[str, Callable[[Received], None]]]] = field(default_factory=dict)
    published: dict[str, list[bytes]] = field(default_factory=dict)
    missing: dict[str, int] = field(default_factory=dict)
    wrong: dict[str, str] = field(default_factory=dict)

    def offers(self) -> tuple[Offer, ...]:
        return tuple(self.offered)

    def subscribe(self, topic, message_type, receive, *, latched, depth) -> None:
        self.handlers.setdefault(topic, []).append((message_type, receive))

    def advertise(self, topic, message_type, *, latched):
        sent = self.published.setdefault(topic, [])

        class Out:
            def publish(self, data: bytes) -> None:
                sent.append(data)

        return Out()

    def subscribers(self, topic: str) -> int:
        return len(self.handlers.get(topic, ()))

    def lost(self) -> dict[str, int]:
        return dict(self.missing)

    def faults(self) -> dict[str, str]:
        return dict(self.wrong)

    def reset(self) -> None:
        self.handlers.clear()

    def close(self) -> None:
        self.reset()

    def send(self, topic: str, data: bytes, received_ns: int | None = None) -> None:
        for message_type, receive in list(self.handlers.get(topic, ())):
            stamp = now_ns() if received_ns is None else received_ns
            receive(Received(topic=topic, message_type=message_type, data=data, received_ns=stamp))


MODEL = CameraModel(width=320, height=240, fx=200.0, fy=200.0, cx=159.5, cy=119.5)


class Robot:
    """Makes the messages of a robot that drives past a wall, 20 frames a second."""

    period_ns = 50_000_000

    def __init__(self, model: CameraModel = MODEL) -> None:
        self.model = model
        rng = np.random.default_rng(0)
        # Smooth: between tiles of eight pixels, passed at six an image, corners are mistaken for their neighbours, and
        # no odometry can be vouched for.
        wall = cv2.GaussianBlur(rng.integers(0, 256, (480, 4800), dtype=np.uint8), (15, 15), 2.0)
        self.wall = cv2.normalize(wall, None, 0, 255, cv2.NORM_MINMAX)

    def offers(self) -> list[Offer]:
        return [
            Offer(topic=IMAGE, message_type=ros.IMAGE),
            Offer(topic=INFO, message_type=ros.CAMERA_INFO),
            Offer(topic=ODOM, message_type=ros.ODOMETRY),
        ]

    def tf(self) -> bytes:
        forward_from_optical = SE3([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0.0, 0.0, 1.0])
        message = messages.transforms([("base_link", "cam_optical_frame", forward_from_optical)], 0)
        return bytes(STORE.serialize_cdr(message, ros.TRANSFORMS))

    def info(self, k: int, model: CameraModel | None = None) -> bytes:
        message = messages.camera_info(model or self.model, k * self.period_ns, "cam_optical_frame")
        return bytes(STORE.serialize_cdr(message, ros.CAMERA_INFO))

    def image(self, k: int, stamp_ns: int | None = None) -> bytes:
        left = 6 * (k % 600)
        gray = np.ascontiguousarray(self.wall[:240, left : left + 320])
        stamp = k * self.period_ns if stamp_ns is None else stamp_ns
        message = messages.image(gray, stamp, "cam_optical_frame", "mono8")
        return bytes(STORE.serialize_cdr(message, ros.IMAGE))

    def odometry(self, k: int, yaw_rad: float = 0.0) -> bytes:
        stamp = k * self.period_ns
        # The wall moves to the left: the robot drives to its right.
        pose = SE3(so3_exp(np.array([0.0, 0.0, yaw_rad])), np.array([0.0, -0.18 * k, 0.0]))
        claim = PoseClaim(source=ODOM, frame_id="odom", stamp_ns=stamp, received_ns=stamp, T_odom_body=pose)
        return bytes(STORE.serialize_cdr(messages.odometry(claim, None, "base_link"), ros.ODOMETRY))

    def introduce(self, transport: FakeTransport) -> None:
        transport.send(TF, self.tf())
        transport.send(INFO, self.info(0))

    def drive(self, transport: FakeTransport, first: int, count: int, pause_s: float = 0.005) -> None:
        for k in range(first, first + count):
            transport.send(ODOM, self.odometry(k))
            transport.send(IMAGE, self.image(k))
            time.sleep(pause_s)


def quick_settings(**groups) -> LiveSettings:
    values = {"intake": {"settle_s": 0.05, "frames": 100, "start_frames": 100}, **groups}
    return parse_live_settings(values)


def wait_until(condition: Callable[[], bool], timeout_s: float = 20.0) -> bool:
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.01)
    return False


def free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


class Process:
    """A peer; what it says on stderr lies in a file."""

    def __init__(self, command: list[str], log: Path, env: dict[str, str] | None = None) -> None:
        self.log = log
        self._out = log.open("wb")
        self.popen = subprocess.Popen(
            command, stdout=self._out, stderr=self._out, env=os.environ | (env or {}), start_new_session=True
        )

    def said(self) -> str:
        return self.log.read_text(errors="replace")

    def wait_for(self, text: str, timeout_s: float = 60.0) -> None:
        ended = lambda: self.popen.poll() is not None  # noqa: E731
        if not wait_until(lambda: text in self.said() or ended(), timeout_s) or text not in self.said():
            raise AssertionError(f"{text!r} was not said in {timeout_s:g} s:\n{self.said()}")

    def stop(self, number: int = signal.SIGTERM, timeout_s: float = 10.0) -> int:
        if self.popen.poll() is None:
            self.popen.send_signal(number)
        try:
            return self.popen.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            return self.popen.wait()
        finally:
            self._out.close()


def watch_under_attack(
    start: Callable[..., Process], folder: Path, spec: str, part: str, topic: str, domain_offset: int
) -> tuple[list[dict], Process]:
    """The bundled drive over DDS, one of its topics hijacked, watched by belie: its alerts, and the hijacker.

    `part`, `topic`: the flag of `belie live` that takes in the lies, and where they are.
    `domain_offset` sets tests apart.
    """
    network = ["--domain", str(100 + (os.getpid() + domain_offset) % 100), "--interface", "lo"]
    config = folder / "live.toml"
    config.write_text(LIKE_CHECK + "[dds]\nreliable = true\n")
    flags = [*network, "--config", str(config)]
    out = folder / "live.jsonl"
    hijack = start([*BELIE, "attack", "--live", "dds", spec, *flags], "attack")
    live = start([*BELIE, "live", "dds", *flags, "--json", str(out), part, topic], "live")
    live.wait_for("waiting")
    play = start([*BELIE, "play", str(DEMO), "dds", *network, "--wait", "2"], "play")
    play.wait_for("played")
    assert wait_until(lambda: len(out.read_text().splitlines()) == 120), live.said()
    assert live.stop(signal.SIGINT) == 1, live.said()
    hijack.stop(signal.SIGINT)
    return [a for line in out.read_text().splitlines() for a in json.loads(line)["alerts"]], hijack
