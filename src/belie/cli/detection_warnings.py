"""What is amiss with the detections that were read: a line each on stderr, with counts and what to do."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from belie.checks.objects.class_groups import ClassGroups
    from belie.evaluation.told_objects import ToldObjects

_MOST_NAMED = 5
_LONGEST = 40  # characters of a label


def tell_detections(
    recording: object,
    told: Iterable[ToldObjects] = (),
    classes: ClassGroups | None = None,
    *,
    least_share: float = 0.0,
) -> None:
    """Say what of a file was left out, that boxes are about other frames, and which labels no group of `classes` holds.

    Labels are told of where that share of all boxes has such: a few road signs among cars need no group.

    >>> tell_detections(object())
    """
    lines = list(getattr(recording, "warnings", ()))
    for stream in told:
        lines += [words] if (words := stream.timing_in_words()) else []
        found = {} if classes is None else stream.ungrouped(classes)
        if found and sum(found.values()) >= least_share * stream.boxes:
            named = ", ".join(f"{_quoted(label)} ({n})" for label, n in list(found.items())[:_MOST_NAMED])
            more = f" and {len(found) - _MOST_NAMED} more" if len(found) > _MOST_NAMED else ""
            count = f"{sum(found.values())} of {stream.boxes} boxes"
            lines.append(
                f"{stream.source}: {count} have labels that no class group holds: {named}{more}; each is a group of "
                "its own, not known to stand on the ground: if that is no attack, put them into objects.classes.groups "
                "(belie config) and give that file with --config"
            )
    for line in lines:
        print(f"belie: warning: {line}", file=sys.stderr)


def _quoted(label: str) -> str:
    """A label as it stands, shortened: whoever tells of boxes may call them anything."""
    return f"'{label}'" if len(label) <= _LONGEST else f"'{label[:_LONGEST]}…'"
