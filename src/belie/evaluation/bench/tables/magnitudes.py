"""How small a lie is still found, and how far one gets unnoticed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from belie.evaluation.bench.rivals import RivalMaker
from belie.evaluation.bench.store import RunRecord
from belie.evaluation.bench.suite import Suite
from belie.evaluation.bench.tables.cells import ENOUGH, furthest, smallest
from belie.evaluation.bench.tables.selections import condition, grouped, judged, sweeps
from belie.evaluation.bench.tables.table import NOTHING, Table

_TIMES_S = (10.0, 30.0, 60.0)


def smallest_table(suite: Suite, records: Sequence[RunRecord], makers: Mapping[str, RivalMaker]) -> Table:
    """The smallest lie that is found in 95 % of the trials, all larger ones being found as well."""
    rows = []
    for group in sweeps(suite):
        own = [r for r in records if r.family == group.family]
        for name, part in grouped(own, condition):
            cells = [
                smallest(judged(part, rival, makers), group.magnitudes, group.unit) for rival in suite.rivals
            ]
            rows.append((group.family, name, f"{group.within or 'any'}", *cells))
    return Table(
        title="The smallest lie that is found",
        note=f"Smallest magnitude of which at least {100 * ENOUGH:.0f} % of the trials are found within "
        f"so many frames, every larger "
        "one too; in brackets the trials at that magnitude.",
        head=("attack", "where", "within, frames", *suite.rivals),
        rows=tuple(rows),
    )  # fmt: skip


def stealth_table(suite: Suite, records: Sequence[RunRecord], makers: Mapping[str, RivalMaker]) -> Table:
    """How far an attacker gets without an alert, choosing the best of the rates that were tried."""
    rows = []
    for group in (g for g in suite.attacks if g.ramp):
        own = [r for r in records if r.family == group.family]
        for name, part in grouped(own, condition):
            for time_s in _TIMES_S:
                cells = [furthest(judged(part, rival, makers), time_s, group.unit) for rival in suite.rivals]
                if any(cell != NOTHING for cell in cells):
                    rows.append((group.family, name, f"{time_s:g} s", *cells))
    return Table(
        title="How far an attacker gets unnoticed",
        note="The largest deviation reached within the time before the right alert, over all rates that "
        "were tried; the rate in "
        "brackets. Only runs that are long enough count.",
        head=("attack", "where", "within", *suite.rivals),
        rows=tuple(rows),
    )  # fmt: skip
