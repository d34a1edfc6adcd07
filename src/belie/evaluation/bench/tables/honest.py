"""False alerts where nothing was attacked."""

from __future__ import annotations

from collections.abc import Sequence

from belie.evaluation.bench.store import RunRecord
from belie.evaluation.bench.suite import Suite
from belie.evaluation.bench.tables.cells import HOUR_S, duration, per_hour, share
from belie.evaluation.bench.tables.selections import grouped, place_and_condition
from belie.evaluation.bench.tables.table import NOTHING, Table
from belie.evaluation.intervals import poisson_upper


def honest_table(suite: Suite, records: Sequence[RunRecord]) -> Table:
    """False alerts on honest recordings."""
    honest = [r for r in records if r.spec is None]
    rows = []
    for rival in suite.rivals:
        own = [r for r in honest if r.rival == rival]
        places = list(grouped(own, place_and_condition))
        for name, part in (*places, *([("all", own)] if len(places) > 1 else [])):
            seconds, alerts = sum(r.honest_s for r in part), sum(len(r.false_alerts) for r in part)
            undecided = share(sum(r.undecided for r in part), sum(r.frames for r in part))
            rows.append(
                (
                    rival, name, str(len(part)), duration(seconds), str(alerts),
                    per_hour(alerts, seconds) if seconds >= HOUR_S else NOTHING,
                    per_hour(poisson_upper(alerts), seconds), undecided,
                )
            )  # fmt: skip
    return Table(
        title="False alerts on honest recordings",
        note="A false alert is any alert. The upper bound is Garwood's, one-sided, 95 %: so many an hour "
        "are not excluded. A rate an hour is given where an hour was driven.",
        head=(
            "detector",
            "where",
            "runs",
            "driven",
            "false alerts",
            "an hour",
            "an hour, at most",
            "frames undecided",
        ),
        rows=tuple(rows),
    )
