"""The outcome of a suite as files: Markdown, one self-contained page, and reports of the runs that one wants to see."""

from __future__ import annotations

import platform
import subprocess
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import jinja2

from belie.evaluation.bench.curves import roc_figure
from belie.evaluation.bench.rivals import RivalMaker
from belie.evaluation.bench.single_runs import figure_5, figure_6
from belie.evaluation.bench.store import RunRecord, Store
from belie.evaluation.bench.suite import Suite
from belie.evaluation.bench.summary import Summary
from belie.evaluation.bench.sweep import FACTORS
from belie.evaluation.bench.words import markdown
from belie.evaluation.config_toml import to_toml


def write_outcome(
    suite: Suite,
    summary: Summary,
    records: Sequence[RunRecord],
    makers: Mapping[str, RivalMaker],
    store: Store,
    reports: Sequence[tuple[str, str]] = (),
) -> Path:
    """Write ``table.md``, ``suite.toml`` and ``index.html`` into the store; gives the page."""
    how = how_it_was_run(makers)
    toml = to_toml(suite) if not (suite.drives or suite.real or suite.attacks) else suite_toml(suite)
    (store.folder / "table.md").write_text(markdown(suite, summary, how), encoding="utf-8")
    (store.folder / "suite.toml").write_text(toml, encoding="utf-8")
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("belie.evaluation"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    first = suite.rivals[0]
    lists = [
        (f"Missed by {first}", summary.missed),
        (f"False alerts of {first} on honest recordings", summary.false_alerts),
        ("Attacks that a recording offers nothing for", summary.not_applicable),
        ("Runs that failed", [f"{run}: {error}" for run, error in summary.failures]),
    ]
    page = environment.get_template("bench.html.j2").render(
        suite=suite,
        summary=summary,
        how=how,
        figure_5=figure_5(records, store, suite.rivals),
        figure_6=figure_6(records, store, suite.rivals),
        roc_figure=roc_figure(records, suite.rivals),
        factors=(FACTORS[0], FACTORS[-1]),
        reports=reports,
        lists=[(title, lines) for title, lines in lists if lines],
        suite_toml=toml,
    )
    path = store.folder / "index.html"
    path.write_text(page, encoding="utf-8")
    return path


def suite_toml(suite: Suite) -> str:
    """A suite as TOML that `load_suite` reads: what differs from the defaults.

    >>> from belie.evaluation.bench.suite import load_suite, parse_suite
    >>> import tomllib
    >>> suite = load_suite("quick")
    >>> parse_suite(tomllib.loads(suite_toml(suite))) == suite
    True
    """
    from belie.evaluation.config_toml import toml_value

    values = suite.model_dump(mode="json", exclude_defaults=True)
    tables = {name: value for name, value in values.items() if _is_table(value)}
    lines = [f"{name} = {toml_value(value)}" for name, value in values.items() if name not in tables]
    for name, value in tables.items():
        for entry in value if isinstance(value, list) else [value]:
            lines += ["", f"[[{name}]]" if isinstance(value, list) else f"[{name}]"]
            lines += [f"{key} = {toml_value(item)}" for key, item in entry.items() if item is not None]
    return "\n".join(lines) + "\n"


def _is_table(value: object) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and bool(value) and isinstance(value[0], dict))


def how_it_was_run(makers: Mapping[str, RivalMaker]) -> str:
    """With which code, when, on what."""
    commit = _commit()
    settings = {
        maker.config.sequential.false_alarms_per_hour for maker in makers.values() if maker.config is not None
    }
    rate = (
        f", stated false-alarm rate {', '.join(f'{r:g}' for r in sorted(settings))} an hour"
        if settings
        else ""
    )
    return (
        f"belie {version('belie')}{f', commit {commit}' if commit else ''}{rate}; "
        f"{datetime.now(UTC):%Y-%m-%d}, {platform.machine()}, Python {platform.python_version()}."
    )


def _commit() -> str:
    """Of the checkout that belie runs from, with a plus where files differ; empty for an installed package."""
    here = Path(__file__).resolve().parent

    def git(*arguments: str) -> str:
        return subprocess.run(
            ["git", "-C", str(here), *arguments], capture_output=True, text=True, check=True, timeout=10
        ).stdout.strip()

    try:
        if not git("ls-files", "--error-unmatch", str(here / "__init__.py")):
            return ""
        return git("rev-parse", "--short", "HEAD") + (
            "+" if git("status", "--porcelain", "--", "src") else ""
        )
    except (OSError, subprocess.SubprocessError):
        return ""
