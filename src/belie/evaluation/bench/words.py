"""A suite's outcome as Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from belie.evaluation.bench.suite import Suite
from belie.evaluation.bench.summary import Summary
from belie.evaluation.bench.tables.table import Table

_MOST_LISTED = 40


def markdown(suite: Suite, summary: Summary, how: str) -> str:
    """All tables, and what was missed, raised falsely, not applicable, or failed.

    Parameters
    ----------
    suite : Suite
        That was run.
    summary : Summary
        What it came to.
    how : str
        One line on where, when and with which code it was run.
    """
    lines = [f"# {suite.title}", "", suite.description, "", how, ""]
    for table in summary.tables:
        lines += [f"## {table.title}", "", table.note, "", *markdown_table(table), ""]
    lines += listed("Missed by the first detector", summary.missed)
    lines += listed("False alerts of the first detector", summary.false_alerts)
    lines += listed("Attacks that a recording offers nothing for", summary.not_applicable)
    lines += listed("Runs that failed", [f"{run}: {error}" for run, error in summary.failures])
    return "\n".join(lines).rstrip() + "\n"


def markdown_table(table: Table) -> Iterator[str]:
    """A pipe table; figures to the right.

    >>> list(markdown_table(Table(title="t", head=("a", "b"), rows=(("x", "1"),))))
    ['| a | b |', '|---|---:|', '| x | 1 |']
    """
    words = {i for row in table.rows for i, cell in enumerate(row) if not is_figure(cell)}
    yield f"| {' | '.join(table.head)} |"
    yield f"|{''.join('---|' if i in words else '---:|' for i in range(len(table.head)))}"
    for row in table.rows:
        yield f"| {' | '.join(row)} |"


def is_figure(cell: str) -> bool:
    """Whether a cell holds a figure, or nothing.

    >>> is_figure("10/10 (72–100 %)"), is_figure("–"), is_figure("sunny")
    (True, True, False)
    """
    return not cell or cell[0] in "–>" or cell[0].isdigit()


def listed(title: str, lines: Sequence[str]) -> list[str]:
    """A list under a heading; nothing of nothing, and no more than a person reads.

    >>> listed("x", [])
    []
    """
    if not lines:
        return []
    more = [f"- … and {len(lines) - _MOST_LISTED} more"] if len(lines) > _MOST_LISTED else []
    return [f"## {title}", "", *(f"- {line}" for line in lines[:_MOST_LISTED]), *more, ""]
