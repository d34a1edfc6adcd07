"""What became of the attacks: caught, how late and how rightly, or why missed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median

import numpy as np

from belie.evaluation.bench.rivals import RivalMaker
from belie.evaluation.bench.store import RunRecord
from belie.evaluation.bench.suite import Suite
from belie.evaluation.bench.tables.cells import rate, share, span
from belie.evaluation.bench.tables.selections import (
    condition,
    families,
    family_label,
    grouped,
    judged,
    largest_magnitude,
)
from belie.evaluation.bench.tables.table import NOTHING, Table


def success_table(suite: Suite, records: Sequence[RunRecord], makers: Mapping[str, RivalMaker]) -> Table:
    """Attacks caught, by family and condition; a sweep is told at its largest magnitude."""
    rows = []
    for family in families(suite):
        largest = largest_magnitude(suite, family)
        own = [r for r in records if r.family == family and r.magnitude == largest]
        for name, part in grouped(own, condition):
            cells = [rate(judged(part, rival, makers)) for rival in suite.rivals]
            rows.append((family_label(suite, family, largest), name, *cells))
    return Table(
        title="Attacks caught",
        note="Caught of tried, with Wilson's 95 % interval; – where a detector does not judge such attacks.",
        head=("attack", "where", *suite.rivals),
        rows=tuple(rows),
    )


def delay_table(suite: Suite, records: Sequence[RunRecord], makers: Mapping[str, RivalMaker]) -> Table:
    """How late the hits came, and how often the first alert was the right one."""
    rows = []
    for rival in suite.rivals:
        for goal, own in grouped(judged(records, rival, makers), lambda r: r.family or ""):
            hits = [r for r in own if r.caught]
            frames = [r.delay_frames for r in hits if r.delay_frames is not None]
            ms = [r.delay_ms for r in hits if r.delay_ms is not None]
            answered = [r for r in own if r.right_first is not None]
            if not answered:
                continue
            before = sum(len(r.before_onset) for r in own)
            during = sum(r.during for r in own)
            after = sum(len(r.aftermath) for r in own)
            rows.append(
                (
                    rival, goal, f"{median(frames):g} / {np.percentile(frames, 95):.0f}" if frames else NOTHING,
                    f"{median(ms):.0f} / {np.percentile(ms, 95):.0f}" if ms else NOTHING,
                    f"{sum(bool(r.right_first) for r in answered)}/{len(answered)}",
                    share(len(hits), len(hits) + during), f"{before} / {during} / {after}",
                )
            )  # fmt: skip
    return Table(
        title="Delay and attribution",
        note="Delay from the first lying message to the alert, median / 95th percentile. Right first: in how many "
        "of the attacks with an alert the first one named the right kind, source and object. Right of all: the share "
        "of all alerts within the attack that did. False alerts: before the attack / within it, of something else / "
        "after it, all runs together; who accuses all the time is right at times.",
        head=(
            "detector", "attack", "delay, frames", "delay, ms", "right first", "right of all",
            "false alerts: before / within / after",
        ),
        rows=tuple(rows),
    )  # fmt: skip


def miss_table(
    records: Sequence[RunRecord], rivals: Sequence[str], makers: Mapping[str, RivalMaker]
) -> Table:
    """Why attacks were missed, as the detector's own checks say; sweeps and ramps have tables of their own."""
    rows = []
    for rival in rivals:
        missed = [
            r for r in judged(records, rival, makers) if r.caught is False and not r.unit and r.why_missed
        ]
        for family, own in grouped(missed, lambda r: r.family or ""):
            groups = sorted(
                grouped(own, lambda r: f"{condition(r)}|{r.why_missed}"), key=lambda group: -len(group[1])
            )
            for name, part in groups:
                where, _, why = name.partition("|")
                nearest = max((r.nearest for r in part if r.nearest is not None), default=None)
                told = NOTHING if nearest is None else f"{nearest:.2f}"
                sizes = [max(r.object_px) for r in part if r.object_px]
                rows.append((rival, family, where, str(len(part)), why, told, span(sizes)))
    return Table(
        title="What was missed, and why",
        note="What the check that should have found it said most of the time while the attack lasted, numbers left "
        "out, and how near its statistic came to its threshold (1 accuses); and how large the attacked objects "
        "were. Who shows no checks gives no reason.",
        head=("detector", "attack", "where", "missed", "why", "statistic / threshold", "object, px"),
        rows=tuple(rows),
    )
