"""The camera's own motion over the latest frames: what claims on both sides of a gap are held against.

A message that is left out must not hide what the next one says: the pose after the gap is compared with the last one
before it, by the motion that the camera has seen meanwhile.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from belie.geometry import SE3, FloatArray
from belie.types import VisualEstimate

_FRAMES = 900  # half a minute at 30 Hz; the map's scale has crept too far by then


@dataclass(frozen=True, slots=True)
class _Step:
    start_ns: int
    T_prev_cur: SE3
    covariance: FloatArray


@dataclass(slots=True)
class SeenPath:
    """Steps of the camera that it vouches for, one after the other, in one map."""

    _steps: deque[_Step] = field(default_factory=lambda: deque(maxlen=_FRAMES))
    _map_id: int = -1
    _stamp_ns: int = 0

    def add(self, estimate: VisualEstimate | None) -> None:
        """Go one frame further; where the camera does not vouch for a step, the path begins anew."""
        if estimate is None or estimate.reason is not None or estimate.inliers == 0:
            self._steps.clear()
            return
        if (estimate.previous_stamp_ns, estimate.map_id) != (self._stamp_ns, self._map_id):
            self._steps.clear()
        self._steps.append(_Step(estimate.previous_stamp_ns, estimate.T_prev_cur, estimate.covariance))
        self._map_id, self._stamp_ns = estimate.map_id, estimate.stamp_ns

    def stretches(self, latest: VisualEstimate) -> Iterator[VisualEstimate]:
        """The motion to the latest frame from each frame before the last, the nearest first.

        Errors of neighbouring frames are alike, since they show the same corners: standard deviations add up, not
        variances.

        Examples
        --------
        >>> import numpy as np
        >>> path = SeenPath()
        >>> for i in range(1, 4):
        ...     seen = VisualEstimate(
        ...         stamp_ns=i, previous_stamp_ns=i - 1, T_prev_cur=SE3.exp([0, 0, 1, 0, 0, 0]),
        ...         covariance=np.eye(6) * 1e-4, corners=9, matches=9, inliers=9, parallax_px=5.0)
        ...     path.add(seen)
        >>> [(two.previous_stamp_ns, two.T_prev_cur.t[2].round(3)) for two in path.stretches(seen)]
        [(1, np.float64(2.0)), (0, np.float64(3.0))]
        """
        if not self._steps or self._stamp_ns != latest.stamp_ns:
            return
        last = self._steps[-1]
        T, total = last.T_prev_cur, last.covariance
        for count, step in enumerate(list(self._steps)[-2::-1], start=2):
            # T_1 exp(x) T = T_1 T exp(Ad(T)^-1 x)
            turned = T.inverse().adjoint()
            total = total + turned @ step.covariance @ turned.T
            T = step.T_prev_cur @ T
            yield replace(latest, previous_stamp_ns=step.start_ns, T_prev_cur=T, covariance=count * total)
