"""The cells of the tables: pooled counts with their intervals, times, shares."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import median

import numpy as np

from belie.evaluation.bench.store import RunRecord
from belie.evaluation.bench.tables.table import NOTHING
from belie.evaluation.intervals import poisson_upper, wilson_interval

HOUR_S = 3600.0
ENOUGH = 0.95  # of the trials: what counts as found


def rate(records: Sequence[RunRecord]) -> str:
    """Caught of tried, with Wilson's interval.

    >>> rate([RunRecord(key="", rival="", recording="", place="", weather="", seed=1, caught=True)] * 10)
    '10/10 (72–100 %)'
    """
    hits = sum(bool(r.caught) for r in records)
    interval = wilson_interval(hits, len(records))
    if interval is None:
        return NOTHING
    return f"{hits}/{len(records)} ({100 * interval[0]:.0f}–{100 * interval[1]:.0f} %)"


def smallest(records: Sequence[RunRecord], magnitudes: Sequence[float], unit: str) -> str:
    """The last magnitude, from the strongest, before less than 95 % are found."""
    best = NOTHING if not records else f"> {magnitudes[0]:g} {unit}"
    for magnitude in magnitudes:
        trials = [r for r in records if r.magnitude == magnitude]
        if not trials or sum(bool(r.caught) for r in trials) < ENOUGH * len(trials):
            break
        best = f"{magnitude:g} {unit} ({len(trials)})"
    return best


def furthest(records: Sequence[RunRecord], time_s: float, unit: str) -> str:
    """Largest of rate x time to the alert, at most `time_s`."""
    reached = []
    for r in records:
        if r.magnitude is None or _attacked_s(r) < time_s - 1.0:
            continue
        caught_s = r.delay_ms * 1e-3 if r.caught and r.delay_ms is not None else float("inf")
        reached.append((abs(r.magnitude) * min(caught_s, time_s), abs(r.magnitude)))
    if not reached:
        return NOTHING
    distance, speed = max(reached)
    return f"{distance:.2g} {unit.removesuffix('/s')} ({speed:g} {unit})"


def _attacked_s(record: RunRecord) -> float:
    """How long an attack without end lasted."""
    if not record.honest_s or record.onset is None:
        return 0.0
    per_frame_s = record.honest_s / max(record.onset, 1)
    return (record.frames - record.onset) * per_frame_s


def false_alerts(honest: Sequence[RunRecord]) -> str:
    """False alerts of honest runs and the time they come from; a rate where an hour was driven, its bound always.

    >>> false_alerts([RunRecord(key="", rival="", recording="", place="", weather="", seed=1, honest_s=7.0)])
    '0 in 7 s (at most 1540 an hour)'
    """
    seconds, count = sum(r.honest_s for r in honest), sum(len(r.false_alerts) for r in honest)
    if not seconds:
        return NOTHING
    hourly = f", {per_hour(count, seconds)} an hour" if seconds >= HOUR_S else ""
    return (
        f"{count} in {duration(seconds)}{hourly} (at most {per_hour(poisson_upper(count), seconds)} an hour)"
    )


def duration(seconds: float) -> str:
    """In seconds, minutes or hours.

    >>> duration(6.9), duration(714.0), duration(7692.0)
    ('7 s', '11.9 min', '2.1 h')
    """
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.1f} min" if seconds < HOUR_S else f"{seconds / HOUR_S:.1f} h"


def per_hour(count: float, seconds: float) -> str:
    """Three digits: no more are known."""
    return f"{float(f'{HOUR_S * count / seconds:.3g}'):g}" if seconds else NOTHING


def p50_p95(records: Iterable[RunRecord]) -> str:
    """Latency of every frame, ms: median and 95th percentile."""
    values = [ms for r in records for ms in r.latency_ms]
    return f"{np.percentile(values, 50):.1f} / {np.percentile(values, 95):.1f}" if values else NOTHING


def middle(values: Sequence[float]) -> str:
    """The median."""
    return f"{median(values):.1f}" if values else NOTHING


def span(values: Sequence[int]) -> str:
    """Smallest to largest.

    >>> span([40, 22]), span([7]), span([])
    ('22–40', '7', '–')
    """
    return NOTHING if not values else "–".join(dict.fromkeys((f"{min(values)}", f"{max(values)}")))


def share(part: int, whole: int) -> str:
    """In per cent.

    >>> share(1, 4), share(0, 0)
    ('25 %', '–')
    """
    return f"{100 * part / whole:.0f} %" if whole else NOTHING
