"""The short table at the end of ``belie check``."""

from __future__ import annotations

import math
import os
import sys
from typing import TYPE_CHECKING, TextIO

import numpy as np
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from belie.evaluation.report_words import attacked_words, never_decided, raised_words, why_missed
from belie.types import Status

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from belie.attacks import AttackLabel
    from belie.evaluation.run import Run
    from belie.evaluation.score import Score
    from belie.evaluation.traced_alert import TracedAlert

_MOST_REASONS = 5
_GAP = 2  # characters between columns
_PIPE_WIDTH = 120  # characters, where neither a terminal nor COLUMNS says


def print_summary(run: Run, *, labels: Iterable[AttackLabel] | None = None, to_stderr: bool = False) -> None:
    """Frames, span, alerts, undecided frames with reasons, latency; and the score, where there are labels."""
    stream = sys.stderr if to_stderr else sys.stdout
    console = Console(file=stream, width=_width(stream), highlight=False)
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True)
    table.add_column()
    table.add_row("recording", Text(f"{run.source} ({run.format}), profile {run.profile}"))
    table.add_row("frames", _frames(run))
    table.add_row("verdict", _verdict(run))
    if not run.has_claims:
        table.add_row(
            "claims", "none: no stream made one, so there was nothing to check but the camera itself"
        )
    for told in run.told:
        table.add_row("objects", Text(told.in_words()))
    for each in never_decided(run):
        table.add_row(Text("never decided", style="yellow"), Text(each))
    table.add_row("latency", _latency(run))
    console.print(table)
    _print_alerts(console, run)
    if labels is not None:
        _print_score(console, run, run.score(labels))
    _print_undecided(console, run)


def _frames(run: Run) -> str:
    seconds = float(run.trace.seconds[-1])
    rate = f", {(len(run.trace) - 1) / seconds:.1f} Hz" if seconds > 0 else ""
    return f"{len(run.trace)} in {seconds:.1f} s{rate}"


def _verdict(run: Run) -> Text:
    shares = ", ".join(f"{status.value} {run.trace.share(status):.1%}" for status in Status)
    if not run.alerts:
        return Text(f"no alert; frames {shares}")
    plural = "s" if len(run.alerts) > 1 else ""
    return Text.assemble((f"{len(run.alerts)} alert{plural}", "bold red"), f"; frames {shares}")


def _latency(run: Run) -> str:
    p50, p95 = np.percentile(run.trace.latency_ms, (50, 95))
    decode = float(np.median(run.trace.decode_ms))
    return f"p50 {p50:.1f} ms, p95 {p95:.1f} ms a frame; decoding apart: p50 {decode:.1f} ms"


def _width(stream: TextIO) -> int | None:
    """Of the console, in characters; None leaves it to the terminal."""
    if stream.isatty():
        return None
    columns = os.environ.get("COLUMNS", "")
    return int(columns) if columns.isdecimal() and int(columns) > 0 else _PIPE_WIDTH


def _print_alerts(console: Console, run: Run) -> None:
    heads = ("alert", "source", "raised at", "onset (estimate)", "delay")
    rows = []
    for alert in run.alerts:
        type, *others = _alert_row(run, alert)
        rows.append((Text(type, style="red"), *map(Text, others)))
    _print_rows(console, heads, rows, [alert.reason for alert in run.alerts])


def _print_rows(
    console: Console, heads: tuple[str, ...], rows: Sequence[tuple[Text, ...]], reasons: Sequence[str]
) -> None:
    """A table with a line below each row, over the whole width, why, where that is known: reasons are long."""
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    if sum(widths) + _GAP * len(widths) > console.width:
        widths = [0] * len(widths)
    for k, (row, reason) in enumerate(zip(rows, reasons, strict=True)):
        table = Table(box=None, padding=(0, _GAP, 0, 0), header_style="bold", show_header=k == 0)
        for head, width in zip(heads, widths, strict=True):
            table.add_column(head, min_width=width or None, overflow="fold")
        table.add_row(*row)
        console.print(table)
        if reason:
            console.print(Padding(Text(f"because {reason}"), (0, 0, 0, 2)))


def _alert_row(run: Run, traced: TracedAlert) -> tuple[str, ...]:
    raised, alert = traced.raised, traced.raised.alert
    started_s, raised_s = run.trace.since_start_s([alert.onset_ns, raised.stamp_ns])
    onset_frame = run.trace.frame_at(alert.onset_ns)
    return (
        alert.type.value,
        alert.source if traced.object is None else f"{traced.object} by {alert.source}",
        f"{raised_s:.2f} s, frame {raised.frame}",
        f"{started_s:.2f} s, frame {onset_frame}",
        f"{traced.delay_ns * 1e-9:.2f} s, {max(0, raised.frame - onset_frame)} frames",
    )


def _attacked(label: AttackLabel) -> str:
    """The streams that lie, and the objects that they lie about."""
    return f"{', '.join(label.sources)} {attacked_words(label)}".rstrip()


def _print_score(console: Console, run: Run, result: Score) -> None:
    rows, reasons = [], []
    for scored in result.labels:
        delay = (
            ""
            if scored.delay_frames is None or scored.delay_ms is None
            else f"{scored.delay_frames} frames, {scored.delay_ms / 1e3:.2f} s"
        )
        found = Text("hit", style="green") if scored.hit is not None else Text("MISS", style="bold red")
        rows.append((Text(scored.label.text), Text(_attacked(scored.label)), found, Text(delay)))
        reasons.append("" if scored.hit is not None else why_missed(run, scored.label))
    _print_rows(console, ("attack", "on", "result", "delay from first lie"), rows, reasons)
    bound = result.false_alerts_per_hour_upper
    known = (
        "" if bound is None else f" in {result.honest_s:.1f} s without attack (at most {bound:.0f}/h, 95 %)"
    )
    console.print(
        Text(
            f"hits {result.hits} of {len(result.labels)}; false alerts {len(result.false_alerts)}{known}; "
            f"wrong type or source {len(result.wrong_attributions)}"
        )
    )
    which = f" ({'; '.join(map(raised_words, result.aftermath))})" if result.aftermath else ""
    console.print(Text(f"alerts about honest frames after an attack {len(result.aftermath)}{which}"))


def _print_undecided(console: Console, run: Run) -> None:
    share, reasons = run.trace.share(Status.UNDECIDED), run.undecided_reasons()
    if not reasons or math.isnan(share):
        return
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    table.add_column(justify="right", no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column()
    for check, reason, frames in reasons[:_MOST_REASONS]:
        table.add_row(f"{frames / len(run.trace):.1%}", Text(check), Text(reason))
    console.print(Text("undecided, share of the frames"))
    console.print(table)
    if len(reasons) > _MOST_REASONS:
        console.print(Text(f"and {len(reasons) - _MOST_REASONS} rarer reasons"))
