"""Single runs as the paper's figures 5 and 6 draw them: the statistic over its threshold, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from belie.attacks import parse_attack
from belie.evaluation.bench.curves import ALERT_OF_GOAL, colour_of
from belie.evaluation.bench.published import FIGURE_5, FIGURE_6
from belie.evaluation.bench.store import RunRecord, Store
from belie.evaluation.bench.tables.paper import GOALS
from belie.evaluation.figures import ALERT, QUIET, svg
from belie.types import AlertType

_TALL = 20.0  # times the threshold: beyond, a linear axis shows nothing else
_PATCH = "detections-patch"
_CHECKS = {
    AlertType.ODOMETRY_SPOOFING: "odometry",
    AlertType.POSITION_SPOOFING: "position",
    AlertType.OBSTACLE_HIDING: "hiding",
    AlertType.OBJECT_MISCLASSIFICATION: "misclassification",
}
_BEFORE, _AFTER = 30, 25  # frames drawn about the onset


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One column of a figure: an attack on a recording, run by several detectors.

    Parameters
    ----------
    title : str
        Above it.
    check : str
        The check that the attack should move.
    runs : tuple of RunRecord
        One a detector.
    published : str
        What the paper reports of its own run; drawn below.
    """

    title: str
    check: str
    runs: tuple[RunRecord, ...]
    published: str


def figure_5(records: Sequence[RunRecord], store: Store, rivals: Sequence[str]) -> str:
    """The four attacks, each at its first run, whatever came of it; empty where none was run."""
    panels = []
    for goal, title in GOALS.items():
        runs = _first([r for r in records if r.goal == goal])
        if runs:
            check = _CHECKS[ALERT_OF_GOAL[goal]]
            panels.append(Panel(title=title, check=check, runs=runs, published=FIGURE_5[goal]))
    return _drawn(panels, store, rivals, "figure5")


def figure_6(records: Sequence[RunRecord], store: Store, rivals: Sequence[str]) -> str:
    """The printed patch, likewise: one column for each thing that it does and each object that wears it."""
    panels = []
    patched = [r for r in records if r.spec and parse_attack(r.spec).name == _PATCH]
    for family in dict.fromkeys(r.family for r in patched):
        runs = _first([r for r in patched if r.family == family])
        if runs and runs[0].alert:
            check = _CHECKS[AlertType(runs[0].alert)]
            panels.append(Panel(title=str(family), check=check, runs=runs, published=FIGURE_6))
    return _drawn(panels, store, rivals, "figure6")


def _first(runs: Sequence[RunRecord]) -> tuple[RunRecord, ...]:
    """The first run that could be tried, as every detector went through it."""
    tried = [r for r in runs if r.not_applicable is None]
    return tuple(r for r in tried if (r.recording, r.spec) == (tried[0].recording, tried[0].spec))


def _drawn(panels: Sequence[Panel], store: Store, rivals: Sequence[str], name: str) -> str:
    if not panels:
        return ""
    shown = [r for r in rivals if r in ("default", "paper")] or list(rivals[:1])

    def draw(figure: Any) -> None:
        axes = figure.subplots(len(shown), len(panels), squeeze=False, sharex="col")
        for column, panel in enumerate(panels):
            for row, rival in enumerate(shown):
                axis = axes[row, column]
                run = next((r for r in panel.runs if r.rival == rival), None)
                if run is None:
                    axis.set_axis_off()
                    continue
                _draw_run(axis, store, run, panel.check, colour_of(rival, rivals))
                if column == 0:
                    axis.set_ylabel(f"{rival}\nstatistic / threshold")
            axes[0, column].set_title(panel.title, fontsize=9.0)
            below = panel.published.replace(", ", ",\n", 1)
            axes[-1, column].set_xlabel(f"frame\n{below}", fontsize=7.5)

    return svg(draw, (2.7 * len(panels) + 0.8, 2.1 * len(shown) + 0.8), name)


def _worst(store: Store, run: RunRecord, check: str) -> Iterator[tuple[int, float]]:
    """Frame and statistic over threshold, of several objects that of the one closest to its threshold."""
    import pyarrow.parquet as pq

    table = pq.read_table(store.frames / f"{run.key}.parquet").to_pydict()
    worst: dict[int, float] = {}
    columns = (table[name] for name in ("frame", "check", "statistic", "threshold"))
    for frame, name, statistic, threshold in zip(*columns, strict=True):
        if name == check and statistic is not None and threshold:
            worst[frame] = max(worst.get(frame, 0.0), statistic / threshold)
    yield from sorted(worst.items())


def _draw_run(axis: Any, store: Store, run: RunRecord, check: str, colour: str) -> None:
    onset = run.onset or 0
    begin, end = max(0, onset - _BEFORE), onset + _AFTER
    shown = [(frame, ratio) for frame, ratio in _worst(store, run, check) if begin <= frame <= end]
    axis.axvspan(onset, min(run.stop or run.frames, end), color=ALERT, alpha=0.12, linewidth=0)
    axis.axhline(1.0, color=QUIET, linewidth=0.9, linestyle="--")
    axis.plot([f for f, _ in shown], [r for _, r in shown], ".-", color=colour, linewidth=1.1, markersize=3.5)
    if run.caught and run.delay_frames is not None:
        axis.axvline(onset + run.delay_frames, color=ALERT, linewidth=1.1)
    axis.set_xlim(begin, end)
    if max((ratio for _, ratio in shown), default=0.0) > _TALL:
        axis.set_yscale("symlog", linthresh=2.0)
        axis.set_ylim(bottom=0.0)
