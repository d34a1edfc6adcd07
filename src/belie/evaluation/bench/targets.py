"""Which object an attack of a suite is about, and how large it is."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from belie.attacks import staying_objects
from belie.evaluation.bench.cases import AttackCase
from belie.evaluation.bench.memory import MemoryRecording
from belie.types import AttackError, DetectionClaim, Step


def targeted(recording: MemoryRecording, attack: AttackCase) -> str:
    """The specification, with the object that it is about.

    Raises
    ------
    AttackError
        If no object stays in view.
    """
    if attack.target != "staying":
        return attack.spec
    staying = staying_objects(recording, attack.onset)
    if not staying:
        raise AttackError(f"{attack.spec}: no object stays in view around frame {attack.onset}")
    return f"{attack.spec},object={staying[0].track_id}"


def size_px(steps: Iterable[Step], track_id: str) -> tuple[int, int] | None:
    """Width and height of the first box that is told of an object, or None: a small one is missed for its size."""
    for step in steps:
        for claim in step.claims:
            for d in claim.detections if isinstance(claim, DetectionClaim) else ():
                if d.track_id == track_id and d.box_px is not None:
                    width, height = np.rint(d.box_px[2:] - d.box_px[:2]).astype(int).tolist()
                    return width, height
    return None
