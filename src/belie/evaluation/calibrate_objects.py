"""How often a robot's object detector misses and misnames what it tracks, from attack-free driving.

A track that goes on after a gap was missed in between, unless something may have hidden it: gaps at the border, under
another box, or of small boxes are left out, as the object checks leave them out. Needs a detector that names its
tracks; without ids nothing is estimated. Intervals are Wilson's.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field

import numpy as np

from belie.detector import Config
from belie.detector.association import covered
from belie.evaluation.calibrate_part import SettingPath, TeachingPart
from belie.evaluation.intervals import wilson_interval
from belie.geometry import FloatArray
from belie.types import DetectionClaim

_LONGEST_S = 1.0  # a longer gap is an occlusion, or another object under an old id
_LEAST_TRACK = 10  # messages
_LEAST_MESSAGES = 200  # about objects; fewer say less than the prior
_BORDER_PX = 4.0


@dataclass(slots=True)
class Habits:
    """Counts of one detector, or of several."""

    messages: int = 0
    missed: int = 0
    gaps: int = 0
    misnamed: int = 0
    named: int = 0
    intervals_s: list[float] = field(default_factory=list)

    @property
    def miss_rate(self) -> float:
        """Share of messages without an object that is followed."""
        return self.missed / self.messages if self.messages else math.nan

    @property
    def confusion_rate(self) -> float:
        """Share of messages with a label of another group than the track mostly has."""
        return self.misnamed / self.named if self.named else math.nan

    def persistence_s(self) -> float | None:
        """For how long images share the cause of a miss: of a miss, how often the next message misses as well.

        XX
        """
        if not self.gaps or not self.intervals_s:
            return None
        lasts = (self.missed - self.gaps) / self.missed
        chance = (lasts - self.miss_rate) / (1.0 - self.miss_rate)
        return -float(np.median(self.intervals_s)) / math.log(chance) if 0.0 < chance < 1.0 else None


def object_habits(
    parts: Sequence[TeachingPart], config: Config, *, without: Set[tuple[str, str]] = frozenset()
) -> tuple[dict[SettingPath, object], dict[str, str], list[str]]:
    """Settings of the object checks, a note on each, and what was seen in words; nothing without tracked detections.

    Parameters
    ----------
    parts : sequence of TeachingPart
        Attack-free.
    config : Config
        Where to start from.
    without : set of (str, str)
        Streams and track ids that are not learned from: those that are accused are no witnesses of their innocence.

    Examples
    --------
    >>> object_habits([], Config())
    ({}, {}, [])
    """
    habits = Habits()
    for part in parts:
        _count(part, config, habits, without)
    if not habits.messages and not habits.named:
        return {}, {}, []
    if habits.messages < _LEAST_MESSAGES:
        few = f"Detections: {habits.messages} messages about tracked objects say too little; rates stay as they are."
        return {}, {}, [few]
    changes: dict[SettingPath, object] = {}
    words = []
    for name, count, whole, setting in (
        ("misses", habits.missed, habits.messages, "miss_rate"),
        ("misnames", habits.misnamed, habits.named, "confusion_rate"),
    ):
        interval = wilson_interval(count, whole)
        assert interval is not None
        share, low, high = (f"{100 * x:.2f}" for x in (count / whole, *interval))
        # The upper end: an optimistic rate accuses honest detectors.
        changes["objects", setting] = float(f"{min(max(interval[1], 1e-4), 0.9):.2g}")
        words.append(
            f"The detector {name} {share} % ({low} to {high} %) of {whole} messages about objects in plain view."
        )
    persistence = habits.persistence_s()
    if persistence is not None and habits.gaps >= 10:
        changes["objects", "persistence_s"] = float(f"{max(persistence, 0.005):.2g}")
    notes = {
        ".".join(path): f"calibrated: upper end of the interval, {habits.messages} messages"
        for path in changes
    }
    return changes, notes, words


def _count(part: TeachingPart, config: Config, habits: Habits, without: Set[tuple[str, str]]) -> None:
    ((_, camera),) = part.cameras.items()
    size = np.array([camera.model.width, camera.model.height], dtype=np.float64)
    by_source: dict[str, list[DetectionClaim]] = defaultdict(list)
    for step in part.steps():
        for claim in step.claims:
            if isinstance(claim, DetectionClaim):
                by_source[claim.source].append(claim)
    for source, claims in by_source.items():
        left_out = {track_id for name, track_id in without if name == source}
        ordered = sorted(claims, key=lambda claim: claim.stamp_ns)
        habits.intervals_s += [(b.stamp_ns - a.stamp_ns) * 1e-9 for a, b in itertools.pairwise(ordered)]
        _count_stream(ordered, size, config, habits, left_out)


def _count_stream(
    claims: Sequence[DetectionClaim], size: FloatArray, config: Config, habits: Habits, left_out: Set[str]
) -> None:
    tracks: dict[str, dict[int, tuple[FloatArray, str]]] = defaultdict(dict)
    boxes: list[FloatArray] = []
    for k, claim in enumerate(claims):
        seen = [d for d in claim.detections if d.box_px is not None]
        boxes.append(np.array([d.box_px for d in seen]).reshape(-1, 4))
        for d in seen:
            if d.track_id and d.track_id not in left_out and d.box_px is not None:
                tracks[d.track_id][k] = d.box_px, config.objects.classes.of(d.label)
    for track in tracks.values():
        if len(track) < _LEAST_TRACK:
            continue
        usual = Counter(group for _, group in track.values()).most_common(1)[0][0]
        numbers = sorted(track)
        for before, after in itertools.pairwise(numbers):
            box, group = track[before]
            if not _in_plain_view(box, size, config.objects.least_side_px):
                continue
            habits.named += 1
            habits.misnamed += group != usual
            habits.messages += 1
            gap = after - before - 1
            if not gap or (claims[after].stamp_ns - claims[before].stamp_ns) * 1e-9 > _LONGEST_S:
                continue
            if _hidden(track, boxes, before, after, config.objects.most_covered):
                continue
            habits.messages += gap
            habits.missed += gap
            habits.gaps += 1


def _in_plain_view(box: FloatArray, size: FloatArray, least_px: float) -> bool:
    inside = (box[:2] > _BORDER_PX).all() and (box[2:] < size - _BORDER_PX).all()
    return bool(inside and (box[2:] - box[:2]).max() >= least_px)


def _hidden(
    track: Mapping[int, tuple[FloatArray, str]],
    boxes: Sequence[FloatArray],
    before: int,
    after: int,
    most: float,
) -> bool:
    """Whether another box may have covered it in a gap."""
    first, last = track[before][0], track[after][0]
    for k in range(before + 1, after):
        fraction = (k - before) / (after - before)
        if covered(first + fraction * (last - first), boxes[k]) > most:
            return True
    return False
