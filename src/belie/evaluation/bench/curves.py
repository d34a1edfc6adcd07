"""The curves of a suite, as SVG to be set into a page: detection and delay against false alarms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from belie.evaluation.bench.store import RunRecord
from belie.evaluation.bench.sweep import FACTORS
from belie.evaluation.bench.tables.cells import duration
from belie.evaluation.bench.tables.paper import GOALS
from belie.evaluation.figures import svg
from belie.types import AlertType

_COLOURS = ("#1b6ca8", "#c26a00", "#6a4c93", "#3a7d44", "#8c564b", "#5c6166")
ALERT_OF_GOAL: Mapping[str, AlertType] = {
    "OS": AlertType.ODOMETRY_SPOOFING, "PS": AlertType.POSITION_SPOOFING, "OH": AlertType.OBSTACLE_HIDING,
    "OM": AlertType.OBJECT_MISCLASSIFICATION,
}  # fmt: skip


def colour_of(rival: str, rivals: Sequence[str]) -> str:
    """The same colour for the same detector in every figure.

    >>> colour_of("default", ["default", "paper"])
    '#1b6ca8'
    """
    return _COLOURS[rivals.index(rival) % len(_COLOURS)]


def operating_curve(
    records: Sequence[RunRecord], rival: str, alert: str
) -> list[tuple[float, float, float | None]]:
    """(False alarms an hour, share caught, median delay in frames) for every factor of the thresholds."""
    own = [r for r in records if r.rival == rival and r.not_applicable is None]
    honest = [r for r in own if r.spec is None]
    hours = _honest_s(records, rival) / 3600.0
    delays = [r.delays[alert] for r in own if r.delays and alert in r.delays and r.alert == alert]
    if not hours or not delays:
        return []
    rises = np.zeros(len(FACTORS))
    for r in honest:
        rises += np.array((r.episodes or {}).get(alert, [0] * len(FACTORS)))
    curve = []
    for k in range(len(FACTORS)):
        found = [float(delay) for row in delays if (delay := row[k]) is not None]
        curve.append((rises[k] / hours, len(found) / len(delays), float(np.median(found)) if found else None))
    return curve


def _honest_s(records: Sequence[RunRecord], rival: str) -> float:
    return sum(
        r.honest_s for r in records if r.rival == rival and r.spec is None and r.not_applicable is None
    )


def roc_figure(records: Sequence[RunRecord], rivals: Sequence[str]) -> str:
    """Share caught, and median delay, against false alarms; empty where nothing can be drawn."""
    goals = [g for g in GOALS if any(operating_curve(records, r, ALERT_OF_GOAL[g].value) for r in rivals)]
    if not goals:
        return ""

    driven_s = max(_honest_s(records, rival) for rival in rivals)
    # Of less than an hour an hourly rate would be told with digits that nobody has measured.
    hours, unit = (1.0, "an hour") if driven_s >= 3600.0 else (driven_s / 3600.0, f"in {duration(driven_s)}")

    def draw(figure: Any) -> None:
        axes = figure.subplots(2, len(goals), squeeze=False, sharex=True)
        drawn: dict[str, Any] = {}
        for column, goal in enumerate(goals):
            for rival in rivals:
                curve = operating_curve(records, rival, ALERT_OF_GOAL[goal].value)
                if not curve:
                    continue
                x = np.array([max(rate, 0.0) for rate, _, _ in curve]) * hours
                colour, now = colour_of(rival, rivals), int(np.argmin(np.abs(np.array(FACTORS) - 1.0)))
                for row, values in enumerate(
                    ([c[1] for c in curve], [np.nan if c[2] is None else c[2] for c in curve])
                ):
                    (drawn[rival],) = axes[row, column].plot(
                        x, values, color=colour, label=rival, linewidth=1.4
                    )
                    axes[row, column].plot(x[now], values[now], "o", color=colour, markersize=5)
            axes[0, column].set_title(GOALS[goal], fontsize=9.0)
            axes[0, column].set_ylim(-0.03, 1.03)
            axes[1, column].set_xscale("symlog", linthresh=1.0)
            axes[1, column].set_xlim(left=0.0)
            axes[1, column].xaxis.set_major_formatter("{x:g}")
            axes[1, column].set_xlabel(f"false alarms {unit}")
            axes[1, column].set_ylim(bottom=0.0, top=max(1.0, axes[1, column].get_ylim()[1]))
        axes[0, 0].set_ylabel("share caught")
        axes[1, 0].set_ylabel("median delay, frames")
        shown = [rival for rival in rivals if rival in drawn]  # not every detector judges every attack
        figure.legend(
            [drawn[r] for r in shown], shown, loc="outside upper center", ncols=len(shown), fontsize=8.0
        )

    return svg(draw, (2.6 * len(goals) + 1.0, 4.4), "roc")
