"""The figures of the report, as SVG to be set into a page."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from belie.attacks import AttackLabel
from belie.detector.alerts import ALERT_OF_CHECK
from belie.evaluation.bird_view import BirdView, alerts_on_motion, bird_view
from belie.evaluation.film import OBJECT_ALERTS
from belie.evaluation.run import Run
from belie.evaluation.trace import NOT_RUN, STATUSES, CheckTrace
from belie.evaluation.traced_alert import TracedAlert
from belie.geometry import FloatArray
from belie.types import Status

CLAIMED, SEEN, ALERT, POSITION, LABEL, QUIET = (
    "#c26a00",
    "#1b6ca8",
    "#c8102e",
    "#6a4c93",
    "#555555",
    "#9aa0a6",
)
OWN = "#ffd400"  # where an accused object is by its own pixels
_MOST_POINTS = 1500
_MOST_POSITIONS = 60
_POSITION_STYLE = {
    "marker": "o",
    "markersize": 3.2,
    "markerfacecolor": "white",
    "markeredgewidth": 0.8,
    "linestyle": "",
}
_LIES = {  # by the unit that it is told in
    "deg/s": "false turn [deg/s]",
    "m/s": "false speed [m/s]",
    "m": "false position [m]",
    "s": "object hidden or misnamed [s]",
}
_ZOOM_NS = 1_500_000_000
_STYLE = {
    "svg.fonttype": "none",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#777777",
    "axes.labelcolor": "#333333",
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
}


def evidence_figure(run: Run, labels: Sequence[AttackLabel] = ()) -> str:
    """Statistic over threshold against time, a panel a check; alert spans, and label spans where given."""
    checks = [check for check in run.trace.checks if np.isfinite(check.ratio).any()]
    if not checks:
        return ""

    def draw(figure: Any) -> None:
        panels = figure.subplots(len(checks), 1, sharex=True, squeeze=False)[:, 0]
        for axes, check in zip(panels, checks, strict=True):
            _evidence_panel(axes, run, check, labels)
        panels[-1].set_xlabel("time since the first frame [s]")
        panels[-1].set_xlim(*_span(run))

    return svg(draw, (9.0, 0.6 + 1.75 * len(checks)), "evidence")


def _evidence_panel(axes: Any, run: Run, check: CheckTrace, labels: Iterable[AttackLabel]) -> None:
    lowest = 0.02
    seconds, ratio = _thinned(run.trace.seconds, np.clip(check.ratio, 1.15 * lowest, None))
    top = max(3.0, 2.0 * float(np.nanmax(ratio)))
    axes.set_yscale("log")
    axes.set_ylim(lowest, top)
    kind = ALERT_OF_CHECK.get(check.check)
    own = (t for t in run.alerts if (t.raised.alert.source, t.raised.alert.type) == (check.source, kind))
    _mark_alerts(axes, run, own)
    for label in labels:
        if check.source in label.sources and (label.alert not in OBJECT_ALERTS or label.alert is kind):
            start, end = run.trace.since_start_s([label.start_ns, label.end_ns])
            axes.plot([start, end], [top, top], color=LABEL, linewidth=6, solid_capstyle="butt", clip_on=True)
    axes.axhline(1.0, color=ALERT, linewidth=1.0, linestyle=(0, (5, 3)))
    axes.plot(seconds, ratio, color="#222222", linewidth=1.0)
    over = ratio > 1.0
    axes.plot(seconds[over], ratio[over], linestyle="", marker=".", markersize=3.5, color=ALERT)
    _mark_undecided(axes, run, check)
    axes.set_title(f"{check.check}  {check.source}", loc="left", fontsize=9.5, color="#222222")
    axes.set_yticks([0.1, 1.0], ["0.1", "alarm"])
    axes.minorticks_off()


def _mark_alerts(axes: Any, run: Run, alerts: Iterable[TracedAlert]) -> None:
    for traced in alerts:
        onset, raised, end = run.trace.since_start_s(
            [traced.raised.alert.onset_ns, traced.raised.stamp_ns, traced.end_ns]
        )
        axes.axvspan(min(onset, raised), max(end, raised), color=ALERT, alpha=0.12, linewidth=0)
        axes.axvline(raised, color=ALERT, linewidth=1.2)


def _mark_undecided(axes: Any, run: Run, check: CheckTrace) -> None:
    """A grey stripe along the bottom where the check could not decide, or did not run."""
    open_ = (check.status == STATUSES.index(Status.UNDECIDED)) | (check.status == NOT_RUN)
    _, share = _thinned(run.trace.seconds, open_.astype(float))
    seconds, _ = _thinned(run.trace.seconds, run.trace.seconds)
    transform = axes.get_xaxis_transform()
    axes.fill_between(
        seconds, 0.0, 0.06, where=share > 0.5, step="mid", color=QUIET, linewidth=0, transform=transform
    )


def trajectory_figure(run: Run) -> str:
    """Claimed and seen trajectory from above, at one scale; and how far they are apart over time."""
    view = bird_view(run)
    if view is None:
        return ""

    window = zoom_window(run)

    def draw(figure: Any) -> None:
        panels = figure.subplots(1, 2 if window is None else 3)
        _draw_above(panels[0], view)
        if window is not None:
            _draw_zoomed(panels[1], run, view, window)
        _draw_apart(panels[-1], run, view)

    return svg(draw, (9.0, 4.2 if window is None else 3.7), "trajectory")


def zoom_window(run: Run) -> slice | None:
    """The frames around the first alert about motion, where they are so few that the whole does not show them."""
    alerts = alerts_on_motion(run)
    if not alerts:
        return None
    first = alerts[0]
    start_ns = min(first.raised.alert.onset_ns, first.raised.stamp_ns) - _ZOOM_NS
    end_ns = min(first.end_ns, first.raised.stamp_ns + _ZOOM_NS) + _ZOOM_NS
    start, stop = np.searchsorted(run.trace.stamps_ns, [start_ns, end_ns])
    return slice(int(start), int(stop)) if 2 <= stop - start <= 0.5 * len(run.trace) else None


def _draw_zoomed(axes: Any, run: Run, view: BirdView, window: slice) -> None:
    claimed, seen, hot = view.claimed[window], view.seen[window], view.in_alert[window]
    known = np.isfinite(claimed).all(axis=1) & np.isfinite(seen).all(axis=1)
    if known.any():
        first = int(np.argmax(known))
        seen = seen - seen[first] + claimed[first]
    axes.plot(*seen.T, color=SEEN, linewidth=2.0, marker=".", markersize=4)
    axes.plot(*claimed.T, color=CLAIMED, linewidth=1.2, marker=".", markersize=4)
    axes.plot(*claimed[hot].T, color=ALERT, linestyle="", marker="o", markersize=4)
    first_ns, last_ns = run.trace.stamps_ns[window][[0, -1]]
    for placed in view.positions:
        inside = (placed.stamps_ns >= first_ns) & (placed.stamps_ns <= last_ns)
        for color, chosen in ((POSITION, inside & ~placed.in_alert), (ALERT, inside & placed.in_alert)):
            axes.plot(*placed.points[chosen].T, color=color, **_POSITION_STYLE)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"{view.across_name} [m]")
    axes.set_title("around the first alert", loc="left", fontsize=9.5)


def _draw_above(axes: Any, view: BirdView) -> None:
    stride = max(1, len(view.claimed) // _MOST_POINTS)
    axes.plot(*view.seen[::stride].T, color=SEEN, linewidth=2.4, label="seen by the camera")
    axes.plot(*view.claimed[::stride].T, color=CLAIMED, linewidth=1.2, label="claimed by the odometry")
    if view.in_alert.any():
        hot = np.where(view.in_alert[:, None], view.claimed, np.nan)
        axes.plot(*hot.T, color=ALERT, linewidth=2.6, label="claimed during an alert", solid_capstyle="round")
    for placed in view.positions:
        step = max(1, len(placed.points) // _MOST_POSITIONS)
        label = f"position claimed by {placed.source}"
        axes.plot(*placed.points[::step].T, color=POSITION, label=label, **_POSITION_STYLE)
        axes.plot(*placed.points[placed.in_alert].T, color=ALERT, **_POSITION_STYLE)
    known = view.claimed[np.isfinite(view.claimed).all(axis=1)]
    axes.plot(*known[0], marker="o", color="#222222", markersize=4, linestyle="")
    axes.annotate("start", known[0], textcoords="offset points", xytext=(5, 4), fontsize=8, color="#444444")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"{view.across_name} [m]")
    axes.set_ylabel(f"{view.ahead_name} [m]")
    axes.set_title("from above", loc="left", fontsize=9.5)
    axes.legend(fontsize=8, loc="best")


def _draw_apart(axes: Any, run: Run, view: BirdView) -> None:
    _mark_alerts(axes, run, alerts_on_motion(run))
    axes.plot(*_thinned(run.trace.seconds, view.apart_m), color="#222222", linewidth=1.1)
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(*_span(run))
    axes.set_xlabel("time since the first frame [s]")
    axes.set_ylabel("claimed and seen position apart [m]")
    axes.set_title("distance between the two", loc="left", fontsize=9.5)


def floor_figure(run: Run) -> str:
    """The minimum detectable lie over time, one panel a unit."""
    units = sorted({unit for check in run.trace.checks for unit in check.floors})
    if not units:
        return ""

    def draw(figure: Any) -> None:
        panels = figure.subplots(1, len(units), squeeze=False)[0]
        for axes, unit in zip(panels, units, strict=True):
            for check in run.trace.checks:
                if unit in check.floors:
                    line = _thinned(run.trace.seconds, check.floors[unit])
                    axes.plot(*line, linewidth=1.2, label=f"{check.check} {check.source}")
            axes.set_yscale("log")
            axes.set_xlim(*_span(run))
            axes.set_title(_LIES.get(unit, f"lie [{unit}]"), loc="left", fontsize=9.5)
            axes.set_xlabel("time [s]")
            axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axes.minorticks_off()
            axes.legend(fontsize=8)

    from matplotlib.ticker import FuncFormatter, LogLocator

    return svg(draw, (9.0, 2.5), "floor")


def latency_figure(run: Run) -> str:
    """Time of each update against time."""

    def draw(figure: Any) -> None:
        axes = figure.subplots()
        axes.plot(*_thinned(run.trace.seconds, run.trace.latency_ms), color=SEEN, linewidth=0.9)
        axes.axhline(
            float(np.percentile(run.trace.latency_ms, 95)), color=QUIET, linestyle=":", linewidth=1.2
        )
        axes.set_xlim(*_span(run))
        axes.set_ylim(0.0, 1.3 * float(np.percentile(run.trace.latency_ms, 99)))
        axes.set_xlabel("time since the first frame [s]")
        axes.set_ylabel("update [ms]")

    return svg(draw, (9.0, 1.9), "latency")


def _span(run: Run) -> tuple[float, float]:
    end = float(run.trace.seconds[-1])
    return 0.0, end if end > 0.0 else 1.0


def _thinned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """At most `_MOST_POINTS` points; of each bin the largest value is kept, so that no peak is lost."""
    if len(x) <= _MOST_POINTS:
        return x, y
    starts = np.linspace(0, len(x), _MOST_POINTS, endpoint=False).astype(int)
    return x[starts], np.fmax.reduceat(y, starts)


def svg(draw: Callable[[Any], None], size_in: tuple[float, float], name: str) -> str:
    """Draw without pyplot, so that nobody's global state is touched; ids are made unique in the page."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({**_STYLE, "svg.hashsalt": name}):
        figure = Figure(figsize=size_in, layout="constrained")
        draw(figure)
        out = io.StringIO()
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    svg = out.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    return re.sub(r'(id="|url\(#|href="#)', rf"\1{name}-", svg)
