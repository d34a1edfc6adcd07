"""Which object an attack is about: one that stays in view, so that hiding or renaming it is an attack at all.

The largest object is often a parked car that is about to pass: to leave out what leaves anyway harms nobody, and no
detector should say a word. The paper's obstacle stands or drives ahead.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable

import numpy as np

from belie.evaluation.bench.cases import AttackCase
from belie.evaluation.bench.memory import MemoryRecording
from belie.types import AttackError, DetectionClaim, Step

_BEFORE, _AFTER = (
    15,
    25,
)  # frames around the onset: known before, and in view well past the paper's ten frames
_SHARE = 0.8  # of the messages in which the honest detector reports it


def targeted(recording: MemoryRecording, attack: AttackCase) -> str:
    """The specification, with the object that it is about.

    Raises
    ------
    AttackError
        If no object stays in view.
    """
    if attack.target != "staying":
        return attack.spec
    track_id = staying_object(recording, attack.onset)
    if track_id is None:
        raise AttackError(f"{attack.spec}: no object stays in view around frame {attack.onset}")
    return f"{attack.spec},object={track_id}"


def staying_object(recording: MemoryRecording, onset: int) -> str | None:
    """Track id of the largest object that is reported from well before an onset to well after it, or None."""
    steps = recording.joined[max(0, onset - _BEFORE) : onset + _AFTER]
    messages: Counter[str] = Counter()
    seen: dict[tuple[str, str], list[float]] = defaultdict(list)
    for step in steps:
        for claim in step.claims:
            if isinstance(claim, DetectionClaim):
                messages[claim.source] += 1
                for d in claim.detections:
                    if d.box_px is not None and d.track_id:
                        width, height = (d.box_px[2:] - d.box_px[:2]).tolist()
                        seen[claim.source, d.track_id].append(width * height)
    stays = {
        key: min(areas)
        for key, areas in seen.items()
        if len(areas) >= _SHARE * messages[key[0]] and messages[key[0]] > 1
    }
    return max(stays, key=lambda key: stays[key])[1] if stays else None


def size_px(steps: Iterable[Step], track_id: str) -> tuple[int, int] | None:
    """Width and height of the first box that is told of an object, or None: a small one is missed for its size."""
    for step in steps:
        for claim in step.claims:
            for d in claim.detections if isinstance(claim, DetectionClaim) else ():
                if d.track_id == track_id and d.box_px is not None:
                    width, height = np.rint(d.box_px[2:] - d.box_px[:2]).astype(int).tolist()
                    return width, height
    return None
