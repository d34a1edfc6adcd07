"""What others published, to stand in columns of its own beside what is measured here; never mixed with it.

From Xu, Deng, Zhang, *Detecting Perception-based Attacks using Visual Odometry*, Table I and section IV-B: measured
there in CARLA and Apollo on an i9-10900 with an RTX 2080 Ti, ten runs a cell. DetectorGuard judges obstacle hiding (OH)
only, PercepGuard object misclassification (OM) only; all of them are given as 0 % in fog.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """One row of the paper's Table I.

    Parameters
    ----------
    method : str
        As the paper calls it.
    like : str
        Our detector built in its manner.
    clear, fog : str
        Success without fog, and in fog.
    latency_ms : mapping of str to int
        By goal (PS, OS, OH, OM).
    """

    method: str
    like: str
    clear: str
    fog: str
    latency_ms: Mapping[str, int]


TABLE_I = (
    Published(method="DetectorGuard", like="objectness", clear="74 % (hiding)", fog="0 %", latency_ms={"OH": 119}),
    Published(method="PercepGuard", like="boxes", clear="99 % (misclassification)", fog="0 %", latency_ms={"OM": 435}),
    Published(
        method="the paper's detector", like="paper", clear="99.5 % (all)", fog="0 %",
        latency_ms={"PS": 82, "OS": 75, "OH": 64, "OM": 66},
    ),
)  # fmt: skip
# What its text says of figure 5, by goal.
FIGURE_5: Mapping[str, str] = {
    "OS": "published: the error surges to 132 px², threshold 40",
    "PS": "published: the step exceeds 20 m², the error stays normal",
    "OH": "published: the local error stays below 10 px², threshold 20",
    "OM": "published: the local error stays low, threshold 20",
}
# And of figure 6, its runs in the real world.
FIGURE_6 = "published: the local error stays low, the patch belongs to the scene"
