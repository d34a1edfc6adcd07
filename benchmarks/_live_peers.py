"""Peers for benchmarks/live.py: processes of belie, and an observer of its diagnostics, on loopback DDS."""

from __future__ import annotations

import re
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

from belie.bridges.settings import DdsSettings
from belie.bridges.transports.dds import DdsTransport
from belie.bridges.wire import Received

BELIE = [sys.executable, "-c", "from belie.cli.main import app; app()"]
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


def network(domain: int) -> list[str]:
    """Flags that keep a process on loopback."""
    return ["--domain", str(domain), "--interface", "lo"]


def transport(domain: int) -> DdsTransport:
    """A participant of our own on loopback."""
    return DdsTransport(DdsSettings(interface="lo"), domain=domain)


def stamp_ns(data: bytes) -> int:
    """Header stamp of a message as CDR."""
    seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
    return int(seconds * 1_000_000_000 + nanoseconds)


class Live:
    """A ``belie live dds`` with a diagnostic message for every frame.

    Attributes
    ----------
    process : psutil.Process
        To ask for memory and processor time.
    """

    def __init__(self, folder: Path, domain: int, *flags: str, settings: str = "") -> None:
        config = folder / "live.toml"
        config.write_text(f"[answers]\nperiod_s = 0.0\n[intake]\nsettle_s = 0.5\n{settings}")
        self._log = folder / "live.log"
        self.json = folder / "live.jsonl"
        command = [*BELIE, "live", "dds", "--config", str(config), "--json", str(self.json), *network(domain)]
        self._popen = subprocess.Popen([*command, *flags], stderr=self._log.open("wb"))
        self.process = psutil.Process(self._popen.pid)
        self.wait_for("start")

    def said(self) -> str:
        """All of its log."""
        return self._log.read_text()

    def wait_for(self, text: str, timeout_s: float = 120.0) -> None:
        """Wait until it has said something."""
        deadline_s = time.monotonic() + timeout_s
        while text not in self.said():
            if time.monotonic() > deadline_s or self._popen.poll() is not None:
                raise SystemExit(f"belie live did not say {text!r}:\n{self.said()}")
            time.sleep(0.05)

    def cpu_s(self) -> float:
        """Processor time so far, user and system."""
        times = self.process.cpu_times()
        return float(times.user + times.system)

    def stop(self) -> tuple[int, int, float]:
        """Stop it; frames answered, messages dropped or lost (both counted), and how long it took [s]."""
        began_s = time.monotonic()
        self._popen.send_signal(signal.SIGTERM)
        self._popen.wait(20.0)
        found = re.search(
            r"stop: (\d+) frames answered, \d+ alerts, (\d+) messages dropped, (\d+) lost", self.said()
        )
        if found is None:
            raise SystemExit(f"belie live did not end as it should:\n{self.said()}")
        return int(found[1]), int(found[2]) + int(found[3]), time.monotonic() - began_s

    def alerts(self) -> int:
        """How many it raised, by its last line."""
        found = re.search(r"stop: \d+ frames answered, (\d+) alerts", self.said())
        return int(found[1]) if found else 0


class Observer:
    """Notes when the diagnostics of each frame arrive: stamp of the frame to receive time, ns."""

    def __init__(self, participant: DdsTransport) -> None:
        self.answered_ns: dict[int, int] = {}
        participant.subscribe("/diagnostics", DIAGNOSTICS, self._note, latched=False, depth=200)

    def _note(self, message: Received) -> None:
        self.answered_ns.setdefault(stamp_ns(message.data), message.received_ns)


@contextmanager
def child(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process of belie that is stopped in the end."""
    popen = subprocess.Popen([*BELIE, *arguments], stderr=subprocess.DEVNULL)
    try:
        yield popen
    finally:
        if popen.poll() is None:
            popen.send_signal(signal.SIGINT)
            try:
                popen.wait(10.0)
            except subprocess.TimeoutExpired:
                popen.kill()
