"""What the scenes share: manoeuvre names, camera mounts, smooth changes, parts of the road."""

from __future__ import annotations

import math

import numpy as np

from belie.geometry import SE3, FloatArray, so3_exp
from belie.simulation.motion import Path

_R_BODY_CAM = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def require_manoeuvre(name: str, known: tuple[str, ...]) -> None:
    """Refuse what a scene does not know.

    >>> require_manoeuvre("dance", ("straight", "curve"))
    Traceback (most recent call last):
        ...
    ValueError: no manoeuvre dance: known are straight, curve
    """
    if name not in known:
        raise ValueError(f"no manoeuvre {name}: known are {', '.join(known)}")


def mount(x_m: float, y_m: float, z_m: float, *, pitch_down_deg: float = 0.0) -> SE3:
    """``T_body_cam`` of a camera that looks ahead.

    >>> mount(1.0, 0.0, 1.5).apply(np.array([[0.0, 0.0, 10.0]]))
    array([[11. ,  0. ,  1.5]])
    """
    pitch = so3_exp(np.array([0.0, math.radians(pitch_down_deg), 0.0]))
    return SE3(pitch @ _R_BODY_CAM, np.array([x_m, y_m, z_m]))


def smooth_step(u: float) -> float:
    """From 0 at 0 to 1 at 1 without jerk at the ends.

    >>> smooth_step(-1.0), smooth_step(0.5), smooth_step(2.0)
    (0.0, 0.5, 1.0)
    """
    u = min(max(u, 0.0), 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u * u)


def beside(path: Path, way_m: float, left_m: float, up_m: float = 0.0, turn_rad: float = 0.0) -> SE3:
    """Frame at a way along a path, shifted to the left and turned."""
    turn = so3_exp(np.array([0.0, 0.0, turn_rad]))
    return path.frame(way_m) @ SE3(turn, np.array([0.0, left_m, up_m]))


def offset_path(path: Path, left_m: float, step_m: float = 4.0) -> Path:
    """The path that runs beside another at a distance to the left."""
    ways = np.linspace(0.0, path.length_m, max(8, math.ceil(path.length_m / step_m)))
    return Path(np.array([beside(path, float(way), left_m).t for way in ways]))


def centre_line(path: Path, step_m: float = 1.0) -> FloatArray:
    """Points along a path, shape (N, 3)."""
    ways = np.linspace(0.0, path.length_m, max(2, math.ceil(path.length_m / step_m)))
    return np.array([path.at(float(way)) for way in ways])
