"""What the damage of a recording took from it: one line on stderr, beside whatever a command says."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from belie.recordings import Recording

_TAKEN = {"undecodable": "cannot be decoded", "lost": "are gone, though its index counts them"}


def tell_damage(recording: Recording) -> None:
    """Say how many messages the last pass over a recording could not use; nothing where it used them all.

    >>> from types import SimpleNamespace
    >>> from belie.recordings import JoinCounts
    >>> tell_damage(SimpleNamespace(path="drive.mcap", streams=(), join_counts=JoinCounts()))
    """
    from belie.recordings.topics import camera_name

    counted = {camera_name(stream.topic): stream.count for stream in recording.streams if stream.used}
    found = [
        f"{count} of {counted.get(source, count)} messages of {source} {taken}"
        for kind, taken in _TAKEN.items()
        for source, count in getattr(recording.join_counts, kind).items()
    ]
    if found:
        print(
            f"belie: warning: {recording.path} is damaged: {', '.join(found)}; only the rest was used",
            file=sys.stderr,
        )
