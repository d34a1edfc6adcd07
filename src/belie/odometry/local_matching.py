"""Ψ and Θ of equation (6) for one object: its corners followed, and the motion that most of them agree on.

One kernel from corner to corner: an object has two dozen, and ten calls for each object cost as much as the work.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from belie.geometry import compiled
from belie.odometry.tracking import track_level

_TOLERANCE_PX = 2.0  # window pixels (an object is 64): objects are neither flat nor rigid
LEAST_AGREEING = 3


@compiled()
def match_corners(
    before: Any,
    after: Any,
    start: Any,
    leads: Any,
    iterations: int,
    min_correlation: float,
    min_eigenvalue: float,
) -> tuple[Any, Any, int, tuple[float, float, float, float], float]:
    """Follow corners from window to window and fit the similarity that most of them agree on.

    Parameters
    ----------
    before, after : tuples of three images
        Pictures of `View`.
    start : array (N, 2)
        Corners in the window before, and where they are expected in the other one.
    leads : array (N,), bool
        Corners that are sure to be the object's: they alone vote, if enough of them are found.
    iterations, min_correlation, min_eigenvalue
        As `tracking.track`.

    Returns
    -------
    found : array (N, 2)
    agreeing : array (N,), bool
        Found, and moved as the similarity says.
    votes : int
        How many of those that voted agree.
    similarity : four floats
        Scale times cosine and sine, and the shift, window pixels.
    squared_error : float
        Mean over those votes, window px².
    """
    n = start.shape[0]
    found = start.copy()
    alive = np.isfinite(start[:, 0]) & np.isfinite(start[:, 1])
    correlation = np.zeros(n)
    scale = 0.25
    for level in range(2, -1, -1):
        if after[level].shape[0] and before[level].shape[0]:
            track_level(
                before[level], after[level], start, found, alive, correlation, scale, iterations, min_eigenvalue, 0.0,
                level == 0,
            )  # fmt: skip
        scale *= 2.0
    led = 0
    for k in range(n):
        alive[k] = alive[k] and correlation[k] >= min_correlation
        led += alive[k] and leads[k]
    voters = np.flatnonzero(alive & leads) if led >= LEAST_AGREEING else np.flatnonzero(alive)
    agreeing = np.zeros(n, np.bool_)
    if not len(voters):
        return found, agreeing, 0, (1.0, 0.0, 0.0, 0.0), 0.0
    c, s, tx, ty, agree, squared = _fit_similarity(start[voters], found[voters], _TOLERANCE_PX)
    for k in range(n):
        if alive[k]:
            dx = c * start[k, 0] - s * start[k, 1] + tx - found[k, 0]
            dy = s * start[k, 0] + c * start[k, 1] + ty - found[k, 1]
            agreeing[k] = dx * dx + dy * dy <= _TOLERANCE_PX * _TOLERANCE_PX
    votes = 0
    for i in range(len(voters)):
        agreeing[voters[i]] = agree[i]
        votes += agree[i]
    return found, agreeing, votes, (c, s, tx, ty), squared


@compiled()
def _fit_similarity(a: Any, b: Any, tolerance: float) -> tuple[float, float, float, float, Any, float]:
    """Scale times (cos, sin) and shift of ``b = z a + t`` that most pairs agree on; which do; their squared error."""
    n = a.shape[0]
    best = -1
    bc, bs, bx, by = 1.0, 0.0, 0.0, 0.0
    limit = tolerance * tolerance
    agree = np.zeros(n, np.bool_)
    middle_x = middle_y = 0.0
    for k in range(n):
        middle_x += a[k, 0] / n
        middle_y += a[k, 1] / n
    for i in range(n):
        for j in range(i, n):
            c, s = 1.0, 0.0  # i == j: a pure shift
            if j > i:
                dx, dy = a[j, 0] - a[i, 0], a[j, 1] - a[i, 1]
                length2 = dx * dx + dy * dy
                if length2 < 100.0:
                    continue
                ex, ey = b[j, 0] - b[i, 0], b[j, 1] - b[i, 1]
                c = (dx * ex + dy * ey) / length2
                s = (dx * ey - dy * ex) / length2
                if c < 0.6 or c > 1.6 or abs(s) > 0.25:
                    continue
            tx = b[i, 0] - c * a[i, 0] + s * a[i, 1]
            ty = b[i, 1] - s * a[i, 0] - c * a[i, 1]
            count = 0
            for k in range(n):
                rx = c * a[k, 0] - s * a[k, 1] + tx - b[k, 0]
                ry = s * a[k, 0] + c * a[k, 1] + ty - b[k, 1]
                if rx * rx + ry * ry <= limit:
                    count += 1
            # Where two motions share the box, the expected one is the object's.
            mx = c * middle_x - s * middle_y + tx - middle_x
            my = s * middle_x + c * middle_y + ty - middle_y
            if mx * mx + my * my <= 4.0 * limit:
                count += n // 4
            if count > best:
                best = count
                bc, bs, bx, by = c, s, tx, ty
    for _ in range(3):
        count = 0
        ax = ay = ux = uy = 0.0
        for k in range(n):
            rx = bc * a[k, 0] - bs * a[k, 1] + bx - b[k, 0]
            ry = bs * a[k, 0] + bc * a[k, 1] + by - b[k, 1]
            agree[k] = rx * rx + ry * ry <= limit
            if agree[k]:
                count += 1
                ax += a[k, 0]
                ay += a[k, 1]
                ux += b[k, 0]
                uy += b[k, 1]
        if count < 2:
            break
        ax, ay, ux, uy = ax / count, ay / count, ux / count, uy / count
        power = cross = turn = 0.0
        for k in range(n):
            if agree[k]:
                px, py = a[k, 0] - ax, a[k, 1] - ay
                qx, qy = b[k, 0] - ux, b[k, 1] - uy
                power += px * px + py * py
                cross += px * qx + py * qy
                turn += px * qy - py * qx
        if power > 25.0 * count:
            bc, bs = cross / power, turn / power
        bx, by = ux - bc * ax + bs * ay, uy - bs * ax - bc * ay
    error = 0.0
    count = 0
    for k in range(n):
        if agree[k]:
            rx = bc * a[k, 0] - bs * a[k, 1] + bx - b[k, 0]
            ry = bs * a[k, 0] + bc * a[k, 1] + by - b[k, 1]
            error += rx * rx + ry * ry
            count += 1
    return bc, bs, bx, by, agree, error / max(count, 1)
