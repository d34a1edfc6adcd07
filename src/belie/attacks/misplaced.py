"""An object claimed where it is not, or smaller than it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from belie.attacks.objects import image_box_px
from belie.geometry import SE3, CameraModel, clipped_box_px
from belie.types import Detection

_UNKNOWN_SIZE_M = (2.0, 1.5)  # for shifting what has neither a box nor dimensions: about a car's


def shifted(target: Detection, dx: float, dy: float, model: CameraModel | None) -> Detection | None:
    """The object moved by so many of its boxes' widths and heights, at the same depth; None out of the image.

    >>> camera = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
    >>> car = Detection(label="car", score=1.0, box_px=[300, 200, 340, 220], position_m=[0, 0, 10.0])
    >>> moved = shifted(car, 1.0, 0.5, camera)
    >>> moved.box_px.tolist(), moved.position_m.round(3).tolist()
    ([340.0, 210.0, 380.0, 230.0], [0.8, 0.2, 10.0])
    """
    box_px = image_box_px(target, model)
    position_m, T_cam_obj = target.position_m, target.T_cam_obj
    if box_px is not None:
        by_px = (box_px[2:] - box_px[:2]) * (dx, dy)
    elif model is not None and position_m is not None:
        by_px = np.array([dx, dy]) * _UNKNOWN_SIZE_M * (model.fx, model.fy) / max(position_m[2], 1.0)
    else:
        return target
    if position_m is not None and model is not None and position_m[2] > 0.0:
        at_px = model.project(position_m[None]) + by_px
        position_m = position_m[2] * np.append(model.normalize(at_px)[0], 1.0)
        T_cam_obj = None if T_cam_obj is None else SE3(T_cam_obj.R, position_m)
    moved_px = None
    if target.box_px is not None:
        moved_px = target.box_px + np.tile(by_px, 2)
        moved_px = moved_px if model is None else clipped_box_px(moved_px, model)
        if moved_px is None:
            return None
    return replace(target, box_px=moved_px, position_m=position_m, T_cam_obj=T_cam_obj)


def shrunk(target: Detection, factor: float) -> Detection:
    """The object with every side multiplied, about its middle.

    >>> shrunk(Detection(label="car", score=1.0, box_px=[0, 0, 8, 4]), 0.5).box_px
    array([2., 1., 6., 3.])
    """
    box_px, dimensions_m = target.box_px, target.dimensions_m
    if box_px is not None:
        middle_px = np.tile(0.5 * (box_px[:2] + box_px[2:]), 2)
        box_px = middle_px + factor * (box_px - middle_px)
    return replace(
        target, box_px=box_px, dimensions_m=None if dimensions_m is None else factor * dimensions_m
    )
