"""``--tui``: streams with rate and age, the verdicts, their floors, the last alerts; drawn with rich."""

from __future__ import annotations

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Column, Table
from rich.text import Text

from belie.bridges.board import Picture
from belie.bridges.sinks.sink import SinkBase
from belie.types import Status

_STYLE = {Status.CONSISTENT: "green", Status.UNDECIDED: "yellow", Status.CONTRADICTED: "bold red"}
_ALERTS = 8


def drawn_picture(picture: Picture) -> RenderableType:
    """A picture as tables.

    >>> from belie.bridges.board import Board
    >>> console = Console(width=80, record=True, file=open("/dev/null", "w"))
    >>> console.print(drawn_picture(Board(state="waiting for /odom").picture(())))
    >>> "waiting for /odom" in console.export_text()
    True
    """
    faults = [f"{fault.topic or 'belie'}: {fault.kind}" for fault in picture.recent_faults()]
    title = f"{picture.state}   " + "  ".join(f"{k} {n}" for k, n in sorted(picture.statuses.items()))
    head = Text(title, style="bold" if picture.watching else "yellow")
    parts: list[RenderableType] = [head, _inputs(picture), _checks(picture), _alerts(picture)]
    if faults:
        parts.append(Panel(Text("\n".join(faults)), title="faults of the last 10 s", border_style="yellow"))
    return Group(*parts)


def _table(*titles: str, style: str = "") -> Table:
    # As text: what stands in brackets, a unit or an object's label, is no markup.
    return Table(*(Column(Text(title)) for title in titles), expand=True, box=None, style=style)


def _add(table: Table, *cells: str | Text, style: str | None = None) -> None:
    table.add_row(*(Text(cell) if isinstance(cell, str) else cell for cell in cells), style=style)


def _inputs(picture: Picture) -> Table:
    table = _table("input", "rate [Hz]", "age [s]", "received", "dropped", "lost")
    for one in picture.inputs:
        _add(
            table,
            one.topic,
            "-" if one.rate_hz is None else f"{one.rate_hz:.1f}",
            "never" if one.age_s is None else f"{one.age_s:.2f}",
            str(one.received),
            str(one.dropped),
            str(one.lost),
            style="red" if one.silent else None,
        )
    return table


def _checks(picture: Picture) -> Table:
    table = _table("check", "source", "status", "statistic / threshold", "floor", "reason")
    if picture.answer is None:
        return table
    for check in picture.answer.verdict.checks:
        figures = (
            ""
            if check.statistic is None or check.threshold is None
            else f"{check.statistic:.3g} / {check.threshold:.3g} {check.unit}"
        )
        source = f"{check.source} {check.object}" if check.object else check.source
        status = Text(check.status.value, style=_STYLE[check.status])
        _add(table, check.check, source, status, figures, check.floor or "", check.reason)
    return table


def _alerts(picture: Picture) -> Table:
    table = _table("alert", "source", "object", "frame", "since [s]", style="red")
    for frame, alert in list(picture.alerts)[-_ALERTS:]:
        since = f"{alert.onset_ns / 1e9:.2f}"
        _add(table, alert.type.value, alert.source, alert.object or "", str(frame), since)
    return table


class DashboardSink(SinkBase):
    """Redraws at every tick, in the session's own thread: a terminal that is slow delays no frame."""

    def __init__(self, console: Console | None = None) -> None:
        self._live = Live(console=console or Console(), auto_refresh=False, screen=console is None)
        self._live.start()

    def tick(self, picture: Picture) -> None:
        """Redraw."""
        self._live.update(drawn_picture(picture), refresh=True)

    def close(self, timeout_s: float) -> None:
        """Give the terminal back."""
        self._live.stop()
