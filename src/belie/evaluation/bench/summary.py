"""From the records of a suite to its tables: pooled counts with their intervals, nothing by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from belie.evaluation.bench.published import TABLE_I, Published
from belie.evaluation.bench.rivals import RivalMaker
from belie.evaluation.bench.store import RunRecord
from belie.evaluation.bench.suite import Attacks, Suite
from belie.evaluation.intervals import poisson_upper, wilson_interval
from belie.types import AlertType

GOALS: Mapping[str, str] = {
    "OS": "odometry spoofing", "PS": "position spoofing", "OH": "obstacle hiding", "OM": "object misclassification",
}  # fmt: skip
_FOG = {"light-fog": "light fog", "heavy-fog": "heavy fog"}
_ENOUGH = 0.95
_HOUR_S = 3600.0
_TIMES_S = (10.0, 30.0, 60.0)
NOTHING = "–"


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table for terminal, Markdown and page alike.

    Parameters
    ----------
    title, note : str
        What it shows, and how to read it.
    head : tuple of str
        Its columns.
    rows : tuple of tuple of str
        Its cells.
    published : tuple of int
        Columns of figures that others published.
    """

    title: str
    note: str = ""
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    published: tuple[int, ...] = ()


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
        *_when(_sweeps(suite), lambda: smallest_table(suite, tried, makers)),
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
                _by((r for r in records if r.not_applicable), _reason), key=lambda g: -len(g[1])
            )
        ),
        failures=tuple(failures),
    )


def condition(record: RunRecord) -> str:
    """What the paper tells apart: fog, light or heavy; the highway; all else.

    >>> condition(RunRecord(key="", rival="", recording="", place="highway", weather="night", seed=1))
    'highway'
    """
    if record.weather == "real":
        return "real"
    return _FOG.get(record.weather) or ("highway" if record.place == "highway" else "no fog")


# -- the tables --------------------------------------------------------------------------------------


def table_i(suite: Suite, records: Sequence[RunRecord], makers: Mapping[str, RivalMaker]) -> Table:
    """The paper's Table I as measured here, beside what was published; its latency has `goal_latency_table`."""
    rows = []
    for rival in suite.rivals:
        own = [r for r in records if r.rival == rival and r.goal in GOALS and _is_judged(r, makers)]
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
        own = [r for r in records if r.rival == rival and r.goal in GOALS and _is_judged(r, makers)]
        published = _published(rival)
        if not own:
            continue
        measured = (_p50_p95([r for r in own if r.goal == goal]) for goal in GOALS)
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


def honest_table(suite: Suite, records: Sequence[RunRecord]) -> Table:
    """False alerts on honest recordings."""
    honest = [r for r in records if r.spec is None]
    rows = []
    for rival in suite.rivals:
        own = [r for r in honest if r.rival == rival]
        places = list(_by(own, _place_and_condition))
        for name, part in (*places, *([("all", own)] if len(places) > 1 else [])):
            seconds, alerts = sum(r.honest_s for r in part), sum(len(r.false_alerts) for r in part)
            undecided = _share(sum(r.undecided for r in part), sum(r.frames for r in part))
            rows.append(
                (
                    rival, name, str(len(part)), duration(seconds), str(alerts),
                    _hourly(alerts, seconds) if seconds >= _HOUR_S else NOTHING,
                    _hourly(poisson_upper(alerts), seconds), undecided,
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


def success_table(suite: Suite, records: Sequence[RunRecord], makers: Mapping[str, RivalMaker]) -> Table:
    """Attacks caught, by family and condition; a sweep is told at its largest magnitude."""
    rows = []
    for family in _families(suite):
        largest = _largest(suite, family)
        own = [r for r in records if r.family == family and r.magnitude == largest]
        for name, part in _by(own, condition):
            cells = [rate(_judged(part, rival, makers)) for rival in suite.rivals]
            rows.append((_label(suite, family, largest), name, *cells))
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
        for goal, own in _by(_judged(records, rival, makers), lambda r: r.family or ""):
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
                    _share(len(hits), len(hits) + during), f"{before} / {during} / {after}",
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
            r for r in _judged(records, rival, makers) if r.caught is False and not r.unit and r.why_missed
        ]
        for family, own in _by(missed, lambda r: r.family or ""):
            groups = sorted(
                _by(own, lambda r: f"{condition(r)}|{r.why_missed}"), key=lambda group: -len(group[1])
            )
            for name, part in groups:
                where, _, why = name.partition("|")
                nearest = max((r.nearest for r in part if r.nearest is not None), default=None)
                told = NOTHING if nearest is None else f"{nearest:.2f}"
                sizes = [max(r.object_px) for r in part if r.object_px]
                rows.append((rival, family, where, str(len(part)), why, told, _span(sizes)))
    return Table(
        title="What was missed, and why",
        note="What the check that should have found it said most of the time while the attack lasted, numbers left "
        "out, and how near its statistic came to its threshold (1 accuses); and how large the attacked objects "
        "were. Who shows no checks gives no reason.",
        head=("detector", "attack", "where", "missed", "why", "statistic / threshold", "object, px"),
        rows=tuple(rows),
    )


def smallest_table(suite: Suite, records: Sequence[RunRecord], makers: Mapping[str, RivalMaker]) -> Table:
    """The smallest lie that is found in 95 % of the trials, all larger ones being found as well."""
    rows = []
    for group in _sweeps(suite):
        own = [r for r in records if r.family == group.family]
        for name, part in _by(own, condition):
            cells = [
                smallest(_judged(part, rival, makers), group.magnitudes, group.unit) for rival in suite.rivals
            ]
            rows.append((group.family, name, f"{group.within or 'any'}", *cells))
    return Table(
        title="The smallest lie that is found",
        note=f"Smallest magnitude of which at least {100 * _ENOUGH:.0f} % of the trials are found within "
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
        for name, part in _by(own, condition):
            for time_s in _TIMES_S:
                cells = [furthest(_judged(part, rival, makers), time_s, group.unit) for rival in suite.rivals]
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


def latency_table(suite: Suite, records: Sequence[RunRecord]) -> Table:
    """What a frame costs."""
    rows = []
    for rival in suite.rivals:
        own = [r for r in records if r.rival == rival]
        for name, part in _by(own, lambda r: f"{r.place} {r.size}"):
            decode = [ms for r in part for ms in r.decode_ms]
            seeing = [ms for r in part for ms in r.seeing_ms]
            rows.append(
                (rival, name, _p50_p95(part), _median(seeing) if any(seeing) else NOTHING, _median(decode))
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


# -- their cells -------------------------------------------------------------------------------------


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
        if not trials or sum(bool(r.caught) for r in trials) < _ENOUGH * len(trials):
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


def _p50_p95(records: Iterable[RunRecord]) -> str:
    values = [ms for r in records for ms in r.latency_ms]
    return f"{np.percentile(values, 50):.1f} / {np.percentile(values, 95):.1f}" if values else NOTHING


def _median(values: Sequence[float]) -> str:
    return f"{median(values):.1f}" if values else NOTHING


def false_alerts(honest: Sequence[RunRecord]) -> str:
    """False alerts of honest runs and the time they come from; a rate where an hour was driven, its bound always.

    >>> false_alerts([RunRecord(key="", rival="", recording="", place="", weather="", seed=1, honest_s=7.0)])
    '0 in 7 s (at most 1540 an hour)'
    """
    seconds, count = sum(r.honest_s for r in honest), sum(len(r.false_alerts) for r in honest)
    if not seconds:
        return NOTHING
    hourly = f", {_hourly(count, seconds)} an hour" if seconds >= _HOUR_S else ""
    return (
        f"{count} in {duration(seconds)}{hourly} (at most {_hourly(poisson_upper(count), seconds)} an hour)"
    )


def duration(seconds: float) -> str:
    """In seconds, minutes or hours.

    >>> duration(6.9), duration(714.0), duration(7692.0)
    ('7 s', '11.9 min', '2.1 h')
    """
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.1f} min" if seconds < _HOUR_S else f"{seconds / _HOUR_S:.1f} h"


def _hourly(count: float, seconds: float) -> str:
    """Three digits: no more are known."""
    return f"{float(f'{_HOUR_S * count / seconds:.3g}'):g}" if seconds else NOTHING


def _span(values: Sequence[int]) -> str:
    """Smallest to largest.

    >>> _span([40, 22]), _span([7]), _span([])
    ('22–40', '7', '–')
    """
    return NOTHING if not values else "–".join(dict.fromkeys((f"{min(values)}", f"{max(values)}")))


def _share(part: int, whole: int) -> str:
    return f"{100 * part / whole:.0f} %" if whole else NOTHING


# -- selections --------------------------------------------------------------------------------------


def _when(wanted: object, make: Callable[[], Table]) -> list[Table]:
    return [make()] if wanted else []


def _families(suite: Suite) -> list[str]:
    return list(dict.fromkeys(group.family for group in suite.attacks))


def _sweeps(suite: Suite) -> list[Attacks]:
    return [group for group in suite.attacks if len(group.magnitudes) > 1 and not group.ramp]


def _largest(suite: Suite, family: str) -> float | None:
    group = next(group for group in suite.attacks if group.family == family)
    return group.magnitudes[0] if group.magnitudes else None


def _label(suite: Suite, family: str, magnitude: float | None) -> str:
    unit = next(group.unit for group in suite.attacks if group.family == family)
    return family if magnitude is None else f"{family}, {magnitude:g} {unit}"


def _is_judged(record: RunRecord, makers: Mapping[str, RivalMaker]) -> bool:
    maker = makers.get(record.rival)
    return record.alert is not None and (maker is None or AlertType(record.alert) in maker.judges)


def _judged(records: Iterable[RunRecord], rival: str, makers: Mapping[str, RivalMaker]) -> list[RunRecord]:
    return [r for r in records if r.rival == rival and _is_judged(r, makers)]


def _by(
    records: Iterable[RunRecord], name: Callable[[RunRecord], str]
) -> Iterator[tuple[str, list[RunRecord]]]:
    groups: dict[str, list[RunRecord]] = {}
    for record in records:
        groups.setdefault(name(record), []).append(record)
    yield from groups.items()


def _place_and_condition(record: RunRecord) -> str:
    return record.place if record.weather == "real" else f"{record.place} {record.weather}"


def _reason(record: RunRecord) -> str:
    from belie.evaluation.trace import without_numbers

    return f"{record.family}: {without_numbers(record.not_applicable or '')}"
