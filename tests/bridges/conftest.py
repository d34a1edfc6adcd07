"""Fixtures of the live tests; what they are made of is in live_tools.py."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from live_tools import FakeTransport, Process, Robot


@pytest.fixture
def robot() -> Robot:
    return Robot()


@pytest.fixture
def transport() -> FakeTransport:
    return FakeTransport()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Process]]:
    """Starts a process; all are stopped in the end."""
    started: list[Process] = []

    def run(command: list[str], name: str, env: dict[str, str] | None = None) -> Process:
        process = Process(command, tmp_path / f"{name}.log", env)
        started.append(process)
        return process

    yield run
    for process in reversed(started):
        process.stop(timeout_s=5.0)
