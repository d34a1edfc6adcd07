"""How the parts of an actor move within it: wheels roll, legs swing, lamps go on and off."""

from __future__ import annotations

import math

import numpy as np

from belie.geometry import FloatArray
from belie.simulation.world import Part


def part_pose(part: Part, travelled_m: float, t_s: float) -> FloatArray | None:
    """``T_obj_part``, shape (4, 4), after a way, or None if the part is not shown now.

    >>> wheel = Part(meshes=(), pivot_m=(1.0, 0.0, 0.3), rolling_radius_m=0.3)
    >>> (part_pose(wheel, 0.3 * math.pi, 0.0) @ [1.0, 0.0, 0.6, 1.0]).round(6) + 0.0
    array([1., 0., 0., 1.])
    >>> part_pose(Part(meshes=(), shown_s=((0.0, 2.0),)), 0.0, 3.0) is None
    True
    """
    if part.shown_s and not any(start <= t_s < stop for start, stop in part.shown_s):
        return None
    if part.rolling_radius_m > 0.0:
        angle = travelled_m / part.rolling_radius_m
    elif part.swing_rad != 0.0:
        angle = part.swing_rad * math.sin(2.0 * math.pi * travelled_m / part.stride_m + part.phase_rad)
    else:
        return np.eye(4)
    c, s = math.cos(angle), math.sin(angle)
    x, _, z = part.pivot_m
    return np.array(
        [
            [c, 0.0, s, x - c * x - s * z],
            [0.0, 1.0, 0.0, 0.0],
            [-s, 0.0, c, z + s * x - c * z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
