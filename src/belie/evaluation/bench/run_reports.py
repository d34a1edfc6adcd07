"""Reports of the runs that one wants to see: what belie missed or raised falsely, and one of each kind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from belie.attacks import attack
from belie.evaluation.bench.cases import runs_of
from belie.evaluation.bench.memory import MemoryRecording
from belie.evaluation.bench.recorded import load
from belie.evaluation.bench.rivals import RivalMaker
from belie.evaluation.bench.store import RunRecord, Store
from belie.evaluation.bench.suite import Suite
from belie.evaluation.bench.targets import targeted
from belie.evaluation.report import write_report
from belie.evaluation.run import run_detector


def write_reports(
    suite: Suite,
    records: Sequence[RunRecord],
    makers: Mapping[str, RivalMaker],
    store: Store,
    cache: Path,
    most: int,
) -> list[tuple[str, str]]:
    """Name and link (from the store's folder) of up to `most` reports; those that are there are not written again."""
    wanted = chosen(records, makers, most)
    cases = {
        case.key(makers[case.rival].key): case
        for _, cases in (runs_of(suite) if wanted else [])
        for case in cases
    }
    links, loaded = [], dict[str, MemoryRecording]()
    for why, record in wanted:
        path = store.folder / "reports" / f"{record.key}.html"
        if not path.exists():
            case, config = cases[record.key], makers[record.rival].config
            assert config is not None
            if case.recording.key not in loaded:
                loaded.clear()
                loaded[case.recording.key] = load(case.recording, cache)
            frames = loaded[case.recording.key]
            if case.attack is None:
                write_report(run_detector(frames, config), path)
            else:
                attacked = attack(frames, targeted(frames, case.attack))
                labels = attacked.labels
                write_report(run_detector(attacked, config, labels=labels), path, labels=labels)
        links.append(
            (f"{why}: {record.rival}, {record.recording}, {record.spec or 'honest'}", f"reports/{path.name}")
        )
    return links


def chosen(
    records: Sequence[RunRecord], makers: Mapping[str, RivalMaker], most: int
) -> list[tuple[str, RunRecord]]:
    """What is worth a look, with why: false alerts and misses of the first profile, then a hit of each family."""
    ours = [r for r in records if (m := makers.get(r.rival)) is not None and m.config is not None]
    first = [r for r in ours if r.rival == ours[0].rival and r.not_applicable is None] if ours else []
    false = [("false alert", r) for r in first if r.spec is None and r.false_alerts]
    missed = [("missed", r) for r in first if r.caught is False and r.magnitude is None]
    hits = {r.family: ("caught", r) for r in reversed(first) if r.caught}
    half = max(1, most // 2)
    return [*false[:half], *missed[:half], *reversed(hits.values())][:most]
