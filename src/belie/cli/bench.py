"""``belie bench``: detectors against attacks, measured."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from belie.cli.options import ConfigFile, FalseAlarms

if TYPE_CHECKING:
    from belie.evaluation.bench.summary import Summary

RUN_FAILED = 1


def bench(
    suite: Annotated[
        str,
        typer.Argument(
            metavar="[SUITE]", help="One of --list, or a TOML file of your own.", show_default=True
        ),
    ] = "quick",
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="results/", help="Folder for results; one folder a suite in it."
        ),
    ] = Path("results"),
    rival: Annotated[
        list[str] | None,
        typer.Option(
            "--rival", metavar="NAME|module:Class", help="Measure this one, too (or one of your own)."
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="NAME", help="Of the suite's detectors, this one only."),
    ] = None,
    config: ConfigFile = None,
    false_alarms_per_hour: FalseAlarms = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", metavar="N", help="Processes.", min=1)] = 0
    or os.cpu_count()
    or 1,
    cache: Annotated[
        str,
        typer.Option(
            "--cache",
            metavar="FOLDER",
            help="Of rendered pictures; belie/bench in XDG_CACHE_HOME if not given.",
        ),
    ] = "",
    cache_limit: Annotated[
        float,
        typer.Option(
            "--cache-limit", metavar="GB", help="Size of that folder; what is longest unused goes.", min=0.1
        ),
    ] = 20.0,
    reports: Annotated[
        int,
        typer.Option(
            "--reports",
            metavar="N",
            help="Write the reports of so many runs: misses and false alerts first.",
            min=0,
        ),
    ] = 6,
    listed: Annotated[bool, typer.Option("--list", help="List the suites, and stop.")] = False,
    show: Annotated[
        bool, typer.Option("--print", help="Print the suite as TOML, to copy and edit, and stop.")
    ] = False,
) -> None:
    """Run detectors over attacked and honest recordings, and say how good each is.

    Recordings are rendered once and kept; finished runs are kept, too: the same command goes on where it was
    interrupted, and with the same seeds gives the same table. Results are a table here, Markdown, one page that needs
    nothing else (index.html), and every frame's verdict as Parquet.

    \b
    Examples:
      belie bench                          every kind of attack, in a minute
      belie bench paper -o results/        the paper's table, measured
      belie bench quick --print > mine.toml   edit it, then: belie bench mine.toml
      belie bench quick --rival mydetector:Mine

    \b
    Exit codes: 0 all ran, 1 some runs failed, 2 usage or data error, or no attack could be tried.
    """  # noqa: D301 (\b keeps the lines of the examples)
    from belie.evaluation.bench.suite import commented_keys, load_suite, shipped_suites, suite_text

    if listed:
        for name in shipped_suites():
            print(f"{name:10} {load_suite(name).title}")
        return
    if show:
        shipped = suite in shipped_suites()
        print(f"{suite_text(suite)}\n{commented_keys()}" if shipped else _own_text(Path(suite)), end="")
        return
    from belie.cli.settings import config_from_flags
    from belie.evaluation.bench.cache import CacheSettings
    from belie.evaluation.bench.loops import loop_table
    from belie.evaluation.bench.page import write_outcome
    from belie.evaluation.bench.rivals import rival_maker
    from belie.evaluation.bench.run_reports import write_reports
    from belie.evaluation.bench.runner import run_suite
    from belie.evaluation.bench.store import Store
    from belie.evaluation.bench.summary import summarise
    from belie.types import ConfigError

    chosen = load_suite(suite)
    rivals = tuple(dict.fromkeys((*(only or chosen.rivals), *(rival or ()))))
    chosen = chosen.model_copy(update={"rivals": rivals})
    settings = config_from_flags(config, None, false_alarms_per_hour)
    makers = {name: rival_maker(name, settings) for name in rivals}
    store, kept = Store(output / Path(suite).stem), CacheSettings(folder=cache, limit_gb=cache_limit)
    with _bar(f"bench {Path(suite).stem}") as advance:
        outcome = run_suite(chosen, store, cache=kept, config=settings, jobs=jobs, on_progress=advance)
    records = store.load(outcome.keys)
    summary = summarise(
        chosen, records, makers, outcome.failures, loop_table(chosen.closed_loop, settings, store)
    )
    links = write_reports(chosen, records, makers, store, kept.path(), reports)
    page = write_outcome(chosen, summary, records, makers, store, links)
    _print(summary)
    resumed = f", {outcome.resumed} of them before" if outcome.resumed else ""
    finished = len(set(store.finished(outcome.keys)))  # closed loops are runs, too
    print(f"{finished} of {len(outcome.keys)} runs{resumed}; {page}")
    for what in summary.not_applicable:
        print(f"not tried: {what}", file=sys.stderr)
    for line in _failed(outcome.failures):
        print(f"failed: {line}", file=sys.stderr)
    if outcome.failures:
        raise typer.Exit(RUN_FAILED)
    attacks = [r for r in records if r.spec]
    if not finished or (attacks and all(r.not_applicable for r in attacks)):
        raise ConfigError(_nothing_run(len(attacks), ", ".join(rivals)))


def _own_text(path: Path) -> str:
    from belie.evaluation.bench.suite import load_suite

    load_suite(path)  # of what is no suite it tells why
    return path.read_text(encoding="utf-8")


def _failed(failures: Iterable[tuple[str, str]]) -> Iterator[str]:
    """One line an error: what is wrong with a recording or a detector fails many runs."""
    runs: dict[str, list[str]] = {}
    for run, error in failures:
        runs.setdefault(error, []).append(run)
    for error, (first, *more) in runs.items():
        yield f"{first}{f' (and {len(more)} more)' if more else ''}: {error}"


def _nothing_run(attacks: int, rivals: str) -> str:
    if attacks:
        return f"no attack was run: of {attacks} none could be tried on its recording (why: above)"
    return f"nothing was run: {rivals} judge none of the suite's attacks, and it leaves out honest recordings"


def _print(summary: Summary) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 200, highlight=False)
    for table in summary.tables:
        shown = Table(title=table.title, title_justify="left", box=None, padding=(0, 2, 0, 0))
        for index, cell in enumerate(table.head):
            shown.add_column(cell, style="dim" if index in table.published else None)
        for row in table.rows:
            shown.add_row(*row)
        console.print(shown)
        console.print()


@contextmanager
def _bar(text: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on stderr; nothing where that is no terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (TextColumn(text), BarColumn(), MofNCompleteColumn(), TextColumn("runs"), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not sys.stderr.isatty()) as bar:
        task = bar.add_task(text, total=None)
        yield lambda settled, total: bar.update(task, completed=settled, total=total)
