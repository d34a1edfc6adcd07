"""``--json FILE``: the lines of ``belie check --json``."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path

from belie.bridges.board import Answer, Board
from belie.bridges.settings import RetrySettings
from belie.bridges.sinks.outlet import Outlet
from belie.bridges.sinks.sink import SinkBase
from belie.types import Verdict
from belie.types.json_lines import json_line

STDOUT = Path("-")


class JsonLinesSink(SinkBase):
    """Appends one line a frame; a disk that is slow or full delays no frame.

    Examples
    --------
    >>> import tempfile
    >>> from belie.types import Status
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sink = JsonLinesSink(Path(folder) / "out.jsonl", Board(), RetrySettings())
    ...     sink.close(1.0)
    """

    def __init__(self, path: Path, board: Board, retry: RetrySettings) -> None:
        self._stack = ExitStack()
        self._out = (
            sys.stdout if path == STDOUT else self._stack.enter_context(path.open("a", encoding="utf-8"))
        )
        self._outlet: Outlet[Verdict] = Outlet("json", self._write, retry, board.sink("json"))

    def _write(self, verdict: Verdict) -> None:
        self._out.write(json_line(verdict) + "\n")
        self._out.flush()

    def answer(self, answer: Answer) -> None:
        """Queue the line."""
        self._outlet.give(answer.verdict)

    def close(self, timeout_s: float) -> None:
        """Write what waits, and close the file."""
        self._outlet.close(timeout_s)
        self._stack.close()
