"""Trajectories from above: what is drawn, in which plane, and positions brought into the odometry's frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from belie.evaluation.film import OBJECT_ALERTS
from belie.evaluation.run import Run
from belie.evaluation.trace import PositionTrace
from belie.evaluation.traced_alert import TracedAlert
from belie.geometry import FloatArray
from belie.types import AlertType


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacedPositions:
    """Position claims of one source on the ground: stamps (K,), metres (K, 2), and which lie in an alert."""

    source: str
    stamps_ns: npt.NDArray[np.int64]
    points: FloatArray
    in_alert: npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BirdView:
    """Points on the ground, (across, ahead), metres; NaN where unknown.

    Parameters
    ----------
    claimed, seen : array (N, 2)
        The camera, as claimed and as seen.
    in_alert : array (N,), bool
        Frames between the onset and the end of an alert on anything but a position or an object.
    apart_m : array (N,)
        Distance between claimed and seen position, height included.
    positions : tuple of PlacedPositions
        Position claims.
    across_name, ahead_name : str
        Names of the two axes.
    """

    claimed: FloatArray
    seen: FloatArray
    in_alert: npt.NDArray[np.bool_]
    apart_m: FloatArray
    positions: tuple[PlacedPositions, ...]
    across_name: str
    ahead_name: str


def bird_view(run: Run) -> BirdView | None:
    """What a run looks like from above; None without claimed trajectory."""
    trace = run.trace
    if not np.isfinite(trace.claimed_m).all(axis=1).any():
        return None
    optical = run.body_axes == "rdf"
    claimed, seen = _ground(trace.claimed_m, optical), _ground(trace.seen_m, optical)
    alerts = alerts_on_motion(run)
    of_odometry = [t for t in alerts if t.raised.alert.type is not AlertType.POSITION_SPOOFING]
    in_alert, doubtful = _within(of_odometry, trace.stamps_ns), _within(alerts, trace.stamps_ns)
    positions = []
    for position in trace.positions:
        shares_frame = bool(position.frame_id) and position.frame_id == trace.odometry_frame_id
        points = _ground(position.position_m, optical and shares_frame)
        placed = points if shares_frame else _placed(points, position, run, seen, doubtful)
        if placed is not None:
            source, stamps_ns = position.source, position.stamps_ns
            hot = _within([t for t in run.alerts if t.raised.alert.source == source], stamps_ns)
            positions.append(PlacedPositions(source=source, stamps_ns=stamps_ns, points=placed, in_alert=hot))
    return BirdView(
        claimed=claimed,
        seen=seen,
        in_alert=in_alert,
        apart_m=np.linalg.norm(trace.claimed_m - trace.seen_m, axis=1),
        positions=tuple(positions),
        across_name="to the right at the start" if optical else "x of the odometry",
        ahead_name="ahead at the start" if optical else "y of the odometry",
    )


def alerts_on_motion(run: Run) -> list[TracedAlert]:
    """The alerts that say something of the trajectory: a lie about an object leaves the camera's motion as it is."""
    return [traced for traced in run.alerts if traced.raised.alert.type not in OBJECT_ALERTS]


def _within(alerts: Iterable[TracedAlert], stamps_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Which stamps lie between the onset and the end of some alert."""
    found = np.zeros(len(stamps_ns), dtype=bool)
    for traced in alerts:
        start_ns = min(traced.raised.alert.onset_ns, traced.raised.stamp_ns)
        found |= (stamps_ns >= start_ns) & (stamps_ns <= traced.end_ns)
    return found


def _ground(position_m: FloatArray, optical: bool) -> FloatArray:
    """(x, z) where y points down, else (x, y)."""
    return np.asarray(position_m[:, [0, 2]] if optical else position_m[:, :2])


def _placed(
    points: FloatArray, position: PositionTrace, run: Run, seen: FloatArray, in_alert: npt.NDArray[np.bool_]
) -> FloatArray | None:
    """Positions turned and shifted onto what the camera saw outside of alerts; None if that is too little."""
    trace = run.trace
    honest = np.isfinite(seen).all(axis=1) & ~in_alert
    if honest.sum() < 2:
        return None
    stamps = trace.stamps_ns[honest].astype(np.float64)
    target = np.column_stack([np.interp(position.stamps_ns, stamps, column) for column in seen[honest].T])
    nearest = np.clip(np.searchsorted(trace.stamps_ns, position.stamps_ns), 0, len(trace) - 1)
    used = ~in_alert[nearest]
    used &= (position.stamps_ns >= stamps[0]) & (position.stamps_ns <= stamps[-1])
    if used.sum() < 3:
        return None
    return rotated_onto(points, target, used)


def rotated_onto(points: FloatArray, target: FloatArray, used: npt.NDArray[np.bool_]) -> FloatArray:
    """Turn and shift plane points onto their targets by least squares over those `used` (Kabsch, 1976).

    >>> points = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 1.0]])
    >>> target = points @ np.array([[0.0, 1.0], [-1.0, 0.0]]) + 3.0
    >>> bool(np.allclose(rotated_onto(points, target, np.ones(3, bool)), target))
    True
    """
    centre, goal = points[used].mean(axis=0), target[used].mean(axis=0)
    a, b = (points[used] - centre).T, (target[used] - goal).T
    angle = np.arctan2(float((a[0] * b[1] - a[1] * b[0]).sum()), float((a * b).sum()))
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray((points - centre) @ np.array([[c, s], [-s, c]]) + goal)
