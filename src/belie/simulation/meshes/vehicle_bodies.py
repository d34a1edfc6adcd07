"""Measures of vehicles by class: cross-sections, windows, wheels, lamps; and the paints that they come in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from belie.geometry import FloatArray
from belie.simulation.world import Colour

PAINTS: tuple[Colour, ...] = (
    (0.80, 0.81, 0.82),
    (0.10, 0.11, 0.12),
    (0.60, 0.08, 0.07),
    (0.10, 0.20, 0.45),
    (0.42, 0.44, 0.46),
    (0.92, 0.92, 0.90),
    (0.16, 0.32, 0.22),
    (0.72, 0.52, 0.12),
    (0.32, 0.20, 0.16),
    (0.34, 0.52, 0.68),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """Shape of one class of vehicle.

    Parameters
    ----------
    sections : tuple
        From rear to front: x, half width, underside, belt line, roof, half width of the roof; metres.
    cabin : tuple of int
        First and last section of the roof.
    windows : tuple of (float, float)
        Side windows, from x to x.
    wheels_x : tuple of float
        Axles.
    wheel_m : float
        Radius of the wheels.
    lamp_z : tuple of float
        Height of headlamps and tail lamps.
    """

    sections: tuple[tuple[float, float, float, float, float, float], ...]
    cabin: tuple[int, int]
    windows: tuple[tuple[float, float], ...]
    wheels_x: tuple[float, ...]
    wheel_m: float
    lamp_z: tuple[float, float]
    has_rear_window: bool = True

    @property
    def length_m(self) -> float:
        """From bumper to bumper."""
        return self.sections[-1][0] - self.sections[0][0]

    @property
    def dimensions_m(self) -> tuple[float, float, float]:
        """Length, width, height."""
        table = np.array(self.sections)
        return self.length_m, 2.0 * float(table[:, 1].max()), float(table[:, 4].max()) + 0.03


BODIES: dict[str, Body] = {
    "car": Body(
        sections=(
            (-2.20, 0.82, 0.32, 0.86, 0.90, 0.68),
            (-2.12, 0.87, 0.25, 0.94, 0.98, 0.71),
            (-1.98, 0.89, 0.22, 0.97, 1.04, 0.71),
            (-1.42, 0.90, 0.20, 0.96, 1.40, 0.61),
            (-0.50, 0.90, 0.20, 0.95, 1.46, 0.60),
            (0.32, 0.90, 0.20, 0.93, 1.42, 0.60),
            (1.12, 0.89, 0.20, 0.90, 0.97, 0.72),
            (1.80, 0.86, 0.22, 0.80, 0.86, 0.64),
            (2.10, 0.80, 0.24, 0.68, 0.73, 0.58),
            (2.20, 0.70, 0.32, 0.60, 0.62, 0.48),
        ),
        cabin=(3, 5), windows=((-1.62, -0.66), (-0.56, 0.42)), wheels_x=(-1.32, 1.36), wheel_m=0.32,
        lamp_z=(0.64, 0.80),
    ),
    "van": Body(
        sections=(
            (-2.65, 0.93, 0.34, 1.12, 1.98, 0.84),
            (-2.58, 0.98, 0.26, 1.14, 2.10, 0.86),
            (-1.00, 1.00, 0.24, 1.14, 2.14, 0.86),
            (0.90, 1.00, 0.24, 1.14, 2.10, 0.84),
            (1.00, 1.00, 0.24, 1.14, 2.08, 0.83),
            (1.80, 0.98, 0.24, 1.12, 1.22, 0.82),
            (2.45, 0.94, 0.26, 0.94, 1.02, 0.76),
            (2.65, 0.84, 0.34, 0.80, 0.84, 0.66),
        ),
        cabin=(1, 4), windows=((0.08, 1.02),), wheels_x=(-1.72, 1.68), wheel_m=0.35, lamp_z=(0.78, 1.05),
    ),
    "truck": Body(
        sections=(
            (-4.20, 1.22, 0.85, 1.70, 3.40, 1.21),
            (-4.15, 1.25, 0.80, 1.70, 3.45, 1.24),
            (1.90, 1.25, 0.80, 1.70, 3.45, 1.24),
            (2.00, 1.12, 0.50, 1.65, 2.70, 1.02),
            (3.55, 1.15, 0.45, 1.65, 2.75, 1.02),
            (3.90, 1.15, 0.45, 1.62, 1.72, 1.10),
            (4.00, 1.10, 0.45, 1.40, 1.46, 1.04),
        ),
        cabin=(1, 4), windows=((2.45, 3.55),), wheels_x=(-2.9, -1.7, 2.9), wheel_m=0.48, lamp_z=(0.85, 1.0),
        has_rear_window=False,
    ),
    "bus": Body(
        sections=(
            (-5.70, 1.18, 0.40, 1.30, 2.95, 1.10),
            (-5.60, 1.25, 0.34, 1.30, 3.05, 1.16),
            (0.00, 1.25, 0.34, 1.30, 3.08, 1.16),
            (5.30, 1.25, 0.34, 1.28, 3.05, 1.16),
            (5.66, 1.22, 0.36, 1.10, 1.30, 1.14),
            (5.72, 1.16, 0.40, 1.00, 1.04, 1.08),
        ),
        cabin=(1, 3), windows=tuple((x, x + 1.32) for x in np.arange(-5.2, 4.6, 1.44).round(2).tolist()),
        wheels_x=(-3.2, 3.4), wheel_m=0.50, lamp_z=(0.75, 1.15),
    ),
}  # fmt: skip


def section_at(body: Body, x: float) -> FloatArray:
    """Half width, underside, belt, roof, half width of the roof at any x."""
    table = np.array(body.sections)
    return np.array([np.interp(x, table[:, 0], table[:, k]) for k in range(1, 6)])
