"""What a frame costs."""

from __future__ import annotations

from collections.abc import Sequence

from belie.evaluation.bench.store import RunRecord
from belie.evaluation.bench.suite import Suite
from belie.evaluation.bench.tables.cells import middle, p50_p95
from belie.evaluation.bench.tables.selections import grouped
from belie.evaluation.bench.tables.table import NOTHING, Table


def latency_table(suite: Suite, records: Sequence[RunRecord]) -> Table:
    """What a frame costs."""
    rows = []
    for rival in suite.rivals:
        own = [r for r in records if r.rival == rival]
        for name, part in grouped(own, lambda r: f"{r.place} {r.size}"):
            decode = [ms for r in part for ms in r.decode_ms]
            seeing = [ms for r in part for ms in r.seeing_ms]
            rows.append(
                (rival, name, p50_p95(part), middle(seeing) if any(seeing) else NOTHING, middle(decode))
            )
    return Table(
        title="Latency",
        note="Milliseconds a frame, p50 / p95; p50 of visual odometry, part of it, and of decoding, "
        "apart. Where several processes share "
        "the machine, as in all "
        "suites but latency, figures are too high.",
        head=("detector", "where", "p50 / p95", "of it seeing", "decoding"),
        rows=tuple(rows),
    )
