"""``belie demo``: a bundled drive, attacked and checked before your eyes."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from belie.attacks import AttackLabel
    from belie.evaluation.run import Run
    from belie.types import Verdict

DRIVE = "demo_drive.mcap"
# What lies, when, and in plain words; the first two seconds of a stream teach the check how noisy it is.
ATTACKS = (
    (
        "detections-hide:object=1,start=3.5s,stop=5s",
        "the detector hides the van ahead for 1.5 s",
    ),
    (
        "position-offset:axis=x,magnitude=3,start=6s,stop=7.5s",
        "GNSS jumps 3 m to the east for 1.5 s",
    ),
    (
        "odometry-offset:axis=left,rate=0.2,start=9s,stop=10s",
        "odometry drifts 0.2 m a frame to the left for 1 s",
    ),
    (
        "detections-relabel:object=90,to=bird,start=10.5s,stop=11.5s",
        "the detector calls a parked van a bird for 1 s",
    ),
)
NOT_CAUGHT = 1
_STYLES = {"consistent": "green", "contradicted": "bold red", "undecided": "yellow"}


def demo(
    report: Annotated[
        Path, typer.Option("--report", metavar="FILE.html", help="Where to write the report.")
    ] = Path("belie-demo.html"),
    speed: Annotated[
        float,
        typer.Option("--speed", metavar="X", help="Times real time at most; 0: as fast as it goes.", min=0.0),
    ] = 4.0,
) -> None:
    """Attack a bundled drive and catch the lies, live; no recording, network or GPU is needed.

    A car drives through a street (rendered by 'belie simulate demo'); its odometry, its GNSS and its object detector
    lie for a while. Every frame is checked as it comes; a table and a report that explains every figure close the
    show.

    \b
    Exit codes: 0 every lie was caught and nothing else, 1 not so, 2 the report cannot be written.
    """  # noqa: D301 (\b keeps the lines of the examples)
    from rich.console import Console

    from belie.evaluation.report import write_report
    from belie.types import RecordingError

    if not report.resolve().parent.is_dir():
        raise RecordingError(f"--report {report}: the folder {report.parent} does not exist")
    console = Console(file=sys.stdout, highlight=False, width=None if sys.stdout.isatty() else 110)
    with as_file(files("belie.cli") / DRIVE) as drive:
        run, labels = watch(drive, console, speed=speed)
    score = run.score(labels)
    print_outcome(console, run, labels)
    write_report(run, report, labels=labels)
    console.print(f"report: {report} (every answer, the trajectories, and the frames at the alerts)")
    if score.hits < len(labels) or score.false_alerts or score.wrong_attributions:
        raise typer.Exit(NOT_CAUGHT)


def watch(drive: Path, console: Console, *, speed: float) -> tuple[Run, tuple[AttackLabel, ...]]:
    """Attack and check a recording with a running status line; the run, and what was true."""
    from belie.attacks import attack
    from belie.detector import Config, Detector
    from belie.evaluation.run import run_detector
    from belie.recordings import open_recording

    recording = open_recording(drive)
    attacked = attack(recording, [spec for spec, _ in ATTACKS])
    labels = attacked.labels
    stamps_ns = attacked.frame_stamps_ns()
    console.print(
        f"A drive of {(stamps_ns[-1] - stamps_ns[0]) * 1e-9:.0f} s, {len(stamps_ns)} frames, "
        f"with {len(labels)} lies in it:"
    )
    for label, (_, words) in zip(labels, ATTACKS, strict=True):
        console.print(f"  from {(label.onset_ns - stamps_ns[0]) * 1e-9:4.1f} s  {words}")
    with _status(console) as show:
        show("compiling the kernels: some seconds, the first time only")
        detector = Detector(attacked.cameras, Config())
        began_s = time.monotonic()

        def on_verdict(verdict: Verdict) -> None:
            t_s = (verdict.stamp_ns - int(stamps_ns[0])) * 1e-9
            lying = [
                label.sources[0] for label in labels if label.onset_ns <= verdict.stamp_ns < label.end_ns
            ]
            for alert in verdict.alerts:
                named = "" if alert.object is None else f" of object {alert.object}"
                console.print(
                    f"  [bold red]ALERT[/] {t_s:4.1f} s  {alert.type.value}{named} by {alert.source}"
                )
            show(_line(verdict, t_s, lying))
            if speed > 0.0 and console.is_terminal:
                time.sleep(max(0.0, began_s + t_s / speed - time.monotonic()))

        run = run_detector(attacked, Config(), detector=detector, labels=labels, on_verdict=on_verdict)
    return run, labels


def _line(verdict: Verdict, t_s: float, lying: list[str]) -> str:
    """The running status: time, what every check says, and what truly lies."""
    answers = "  ".join(
        f"{result.check} [{_STYLES[result.status.value]}]{result.status.value}[/]"
        for result in verdict.checks
    )
    truth = f"  [dim](lying now: {', '.join(lying)})[/]" if lying else ""
    return f"{t_s:5.1f} s  {verdict.latency_ms:4.1f} ms  {answers}{truth}"


@contextmanager
def _status(console: Console) -> Iterator[Callable[[str], None]]:
    """A line that is written over and over; nothing where there is no terminal."""
    if not console.is_terminal:
        yield lambda text: None
        return
    with console.status("") as status:
        yield status.update


def print_outcome(console: Console, run: Run, labels: tuple[AttackLabel, ...]) -> None:
    """One line for every lie: whether, when and as what it was caught."""
    from rich.table import Table

    score = run.score(labels)
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    for column in ("lie", "told by", "caught", "after"):
        table.add_column(column)
    for scored, (_, words) in zip(score.labels, ATTACKS, strict=True):
        caught = "[bold red]no[/]" if scored.hit is None else f"[green]{scored.label.alert.value}[/]"
        after = (
            ""
            if scored.delay_frames is None or scored.delay_ms is None
            else f"{scored.delay_frames} frames, {scored.delay_ms / 1e3:.2f} s"
        )
        table.add_row(words, ", ".join(scored.label.sources), caught, after)
    console.print()
    console.print(table)
    latency = sorted(run.trace.latency_ms)[len(run.trace.latency_ms) // 2]
    console.print(
        f"{len(run.trace)} frames, {latency:.1f} ms each (median); false alerts {len(score.false_alerts)} "
        f"in {score.honest_s:.1f} s of honest driving"
    )
