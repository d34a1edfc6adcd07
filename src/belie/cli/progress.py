"""A progress bar on stderr; nothing at all where that is no terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from belie.recordings import Recording


def frame_count(recording: Recording) -> int:
    """How many frames a recording holds, from its index: nothing is decoded."""
    return sum(stream.count for stream in recording.streams if stream.role == "image" and stream.used)


@contextmanager
def progress(text: str, total: int, *, enabled: bool = True) -> Iterator[Callable[[], None]]:
    """A bar that is moved on by calling what this yields.

    >>> with progress("checking", 10) as advance:
    ...     advance()
    """
    if not (enabled and sys.stderr.isatty()):
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn(text),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("frames"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=total)
        yield lambda: bar.advance(task)
