"""Names of axes to unit vectors."""

from __future__ import annotations

import numpy as np

from belie.attacks.catalogue import ROTATIONS, VEHICLE_AXES
from belie.attacks.source import BodyAxes
from belie.geometry import FloatArray

# Columns: forward, left, up in body coordinates.
_BODY_VEHICLE = {
    "flu": np.eye(3),
    "rdf": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
}


def vehicle_rotation(body_axes: BodyAxes) -> FloatArray:
    """``R_body_vehicle``, shape (3, 3): its columns are forward, left and up in body coordinates.

    >>> vehicle_rotation("rdf") @ np.array([1.0, 0.0, 0.0])
    array([0., 0., 1.])
    """
    return _BODY_VEHICLE[body_axes].copy()


def body_axis(axis: str, body_axes: BodyAxes) -> FloatArray:
    """Unit vector of an axis in body coordinates, shape (3,).

    x, y, z are the body's own coordinates; forward, left, up the vehicle's; roll, pitch, yaw the axes of
    right-handed turns about forward, left, up.

    >>> body_axis("yaw", "rdf")
    array([ 0., -1.,  0.])
    """
    if axis in ("x", "y", "z"):
        return np.asarray(np.eye(3)["xyz".index(axis)])
    names = ROTATIONS if axis in ROTATIONS else VEHICLE_AXES
    return np.asarray(_BODY_VEHICLE[body_axes][:, names.index(axis)].copy())


def world_direction(axis: str, R_world_body: FloatArray, body_axes: BodyAxes) -> FloatArray:
    """Unit vector of a translation axis in the coordinates of a claim, shape (3,).

    >>> R_left_turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    >>> world_direction("forward", R_left_turn, "flu"), world_direction("x", R_left_turn, "flu")
    (array([0., 1., 0.]), array([1., 0., 0.]))
    """
    direction = body_axis(axis, body_axes)
    return direction if axis in ("x", "y", "z") else np.asarray(R_world_body @ direction)
