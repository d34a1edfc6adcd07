"""How the parts of an actor move within it: wheels roll, legs swing, lamps go on and off."""

from __future__ import annotations

import math

import numpy as np

from belie.geometry import SE3, so3_exp
from belie.simulation.world import Part


def part_pose(part: Part, travelled_m: float, t_s: float) -> SE3 | None:
    """``T_obj_part`` after a way, or None if the part is not shown now.

    >>> wheel = Part(meshes=(), pivot_m=(1.0, 0.0, 0.3), rolling_radius_m=0.3)
    >>> part_pose(wheel, 0.3 * math.pi, 0.0).apply(np.array([[1.0, 0.0, 0.6]])).round(6) + 0.0
    array([[1., 0., 0.]])
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
        return SE3.identity()
    pivot = np.array(part.pivot_m)
    R = so3_exp(np.array([0.0, math.remainder(angle, 2.0 * math.pi), 0.0]))
    return SE3(R, pivot - R @ pivot)
