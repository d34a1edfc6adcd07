"""The paper's Table I: as measured here, beside what was published."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from belie.evaluation.bench.published import TABLE_I, Published
from belie.evaluation.bench.rivals import RivalMaker
from belie.evaluation.bench.store import RunRecord
from belie.evaluation.bench.suite import Suite
from belie.evaluation.bench.tables.cells import false_alerts, p50_p95, rate
from belie.evaluation.bench.tables.selections import is_judged
from belie.evaluation.bench.tables.table import NOTHING, Table

GOALS: Mapping[str, str] = {
    "OS": "odometry spoofing", "PS": "position spoofing", "OH": "obstacle hiding", "OM": "object misclassification",
}  # fmt: skip


def table_i(suite: Suite, records: Sequence[RunRecord], makers: Mapping[str, RivalMaker]) -> Table:
    """The paper's Table I as measured here, beside what was published; its latency has `goal_latency_table`."""
    rows = []
    for rival in suite.rivals:
        own = [r for r in records if r.rival == rival and r.goal in GOALS and is_judged(r, makers)]
        published = _published(rival)
        fog = [r for r in own if "fog" in r.weather]
        clear = [r for r in own if "fog" not in r.weather]
        honest = [r for r in records if r.rival == rival and r.spec is None]
        theirs = (published.method, published.clear, published.fog) if published else (NOTHING,) * 3
        rows.append((rival, rate(clear), rate(fog), false_alerts(honest), *theirs))
    return Table(
        title="The paper's Table I, as measured here and as published",
        note="Caught: the right alert on the right source within the attack or a second after, with Wilson's 95 % "
        "interval, over the attacks that a detector judges at all. A success rate says little without the false "
        "alerts: those are of honest runs, and at most so many an hour are not excluded by so little driving. "
        "Published columns are others' figures, from other machines and recordings.",
        head=(
            "detector", "caught without fog", "caught in fog", "false alerts", "published as",
            "published: without fog", "published: in fog",
        ),
        rows=tuple(rows),
        published=(4, 5, 6),
    )  # fmt: skip


def goal_latency_table(suite: Suite, records: Sequence[RunRecord], makers: Mapping[str, RivalMaker]) -> Table:
    """What a frame costs under each of the paper's attacks, as measured and as published."""
    rows = []
    for rival in suite.rivals:
        own = [r for r in records if r.rival == rival and r.goal in GOALS and is_judged(r, makers)]
        published = _published(rival)
        if not own:
            continue
        measured = (p50_p95([r for r in own if r.goal == goal]) for goal in GOALS)
        theirs = published.latency_ms if published else {}
        told = (str(theirs.get(goal, NOTHING)) for goal in GOALS)
        rows.append((rival, *measured, published.method if published else NOTHING, *told))
    return Table(
        title="Latency by attack, as measured here and as published",
        note="Milliseconds a frame over all frames of the attacked runs, p50 / p95, decoding apart.",
        head=(
            "detector", *GOALS.values(), "published as", *(f"published: {name}" for name in GOALS.values())
        ),
        rows=tuple(rows),
        published=(5, 6, 7, 8, 9),
    )  # fmt: skip


def _published(rival: str) -> Published | None:
    return next((p for p in TABLE_I if p.like == rival), None)
