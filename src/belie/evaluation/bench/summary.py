"""From the records of a suite to all that it came to: its tables, and lists of what to look at."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from belie.evaluation.bench.rivals import RivalMaker
from belie.evaluation.bench.store import RunRecord
from belie.evaluation.bench.suite import Suite
from belie.evaluation.bench.tables.attacks import delay_table, miss_table, success_table
from belie.evaluation.bench.tables.honest import honest_table
from belie.evaluation.bench.tables.latency import latency_table
from belie.evaluation.bench.tables.magnitudes import smallest_table, stealth_table
from belie.evaluation.bench.tables.paper import GOALS, goal_latency_table, table_i
from belie.evaluation.bench.tables.selections import grouped, sweeps
from belie.evaluation.bench.tables.table import Table
from belie.evaluation.trace import without_numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """All that a suite came to."""

    tables: tuple[Table, ...]
    missed: tuple[str, ...]
    false_alerts: tuple[str, ...]
    not_applicable: tuple[str, ...]
    failures: tuple[tuple[str, str], ...]


def summarise(
    suite: Suite,
    records: Sequence[RunRecord],
    makers: Mapping[str, RivalMaker],
    failures: Sequence[tuple[str, str]] = (),
    closed_loop: Table | None = None,
) -> Summary:
    """The tables of a suite, of what has finished.

    Examples
    --------
    >>> from belie.evaluation.bench.suite import load_suite
    >>> summarise(load_suite("quick"), [], {}).tables
    ()
    """
    tried = [r for r in records if r.not_applicable is None]
    tables = [
        *_when(any(r.goal in GOALS for r in tried), lambda: table_i(suite, tried, makers)),
        *_when(any(r.spec is None for r in tried), lambda: honest_table(suite, tried)),
        *_when(any(r.spec for r in tried), lambda: success_table(suite, tried, makers)),
        *_when(any(r.spec for r in tried), lambda: delay_table(suite, tried, makers)),
        *_when(any(r.spec for r in tried), lambda: miss_table(tried, suite.rivals, makers)),
        *_when(sweeps(suite), lambda: smallest_table(suite, tried, makers)),
        *_when(any(g.ramp for g in suite.attacks), lambda: stealth_table(suite, tried, makers)),
        *([closed_loop] if closed_loop else []),
        *_when(any(r.goal in GOALS for r in tried), lambda: goal_latency_table(suite, tried, makers)),
        *_when(bool(tried), lambda: latency_table(suite, tried)),
    ]
    first = suite.rivals[0]
    return Summary(
        tables=tuple(table for table in tables if table.rows),
        missed=tuple(
            f"{r.recording}, {r.spec}{f': {r.why_missed}' if r.why_missed else ''}"
            for r in tried
            if r.rival == first and r.caught is False and not r.unit
        ),
        false_alerts=tuple(
            f"{r.recording}: {one}"
            for r in tried
            if r.rival == first and r.spec is None
            for one in r.false_alerts
        ),
        not_applicable=tuple(
            # Of one kind the first stands for all, with its numbers: they say what to set.
            f"{len(own)} x {own[0].family}: {own[0].not_applicable}"
            for _, own in sorted(
                grouped((r for r in records if r.not_applicable), _reason), key=lambda g: -len(g[1])
            )
        ),
        failures=tuple(failures),
    )


def _when(wanted: object, make: Callable[[], Table]) -> list[Table]:
    return [make()] if wanted else []


def _reason(record: RunRecord) -> str:
    return f"{record.family}: {without_numbers(record.not_applicable or '')}"
