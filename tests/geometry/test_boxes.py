"""Boxes of objects in space: corners before, behind and across the camera, through every lens."""

from types import SimpleNamespace

import numpy as np
import pytest

from belie.geometry import SE3, CameraModel, box_iou, clipped_box_px, projected_box_px, so3_exp

PINHOLE = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
BARREL = CameraModel(
    width=640,
    height=480,
    fx=500,
    fy=500,
    cx=319.5,
    cy=239.5,
    model="radial_tangential",
    distortion=(-0.3, 0.1, 0.0, 0.0),
)
FISHEYE = CameraModel(
    width=640,
    height=480,
    fx=200,
    fy=200,
    cx=319.5,
    cy=239.5,
    model="equidistant",
    distortion=(0.0, 0.0, 0.0, 0.0),
)
# x forward along the optical axis, y to the left, z up.
AHEAD = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def solid(x, y, z, size=(4.0, 2.0, 1.0), R=AHEAD):
    return SimpleNamespace(
        T_cam_obj=SE3(R, np.array([x, y, z], float)), position_m=None, dimensions_m=np.array(size)
    )


def test_the_near_face_makes_the_box():
    left, top, right, bottom = projected_box_px(solid(0, 0, 12), PINHOLE)
    assert (left, right) == pytest.approx((320 - 50, 320 + 50))  # 2 m at 10 m
    assert (top, bottom) == pytest.approx((240 - 25, 240 + 25))


def test_turning_makes_it_wider():
    aside = projected_box_px(solid(0, 0, 12, R=so3_exp(np.array([0, np.pi / 2, 0])) @ AHEAD), PINHOLE)
    assert aside[2] - aside[0] == pytest.approx(500 * 4 / 11)


def test_behind_is_nothing_and_partly_behind_is_cut_off():
    assert projected_box_px(solid(0, 0, -12), PINHOLE) is None
    beside = projected_box_px(solid(2.5, 0.5, 1.0), PINHOLE)  # from one metre behind us to three before
    assert beside[2] == 640.0
    assert beside[0] == pytest.approx(320 + 500 * 1.5 / 3.0)
    assert projected_box_px(solid(40, 0, 10), PINHOLE) is None


@pytest.mark.parametrize("camera", [BARREL, FISHEYE], ids=["barrel", "fisheye"])
def test_through_a_lens_what_is_far_out_does_not_fold_back(camera):
    for x in (30.0, 100.0, 1000.0):
        box_px = projected_box_px(solid(x, 0, 10, size=(1.0, 1.0, 1.0)), camera)
        assert box_px is None or box_px[0] > 500
    centre = projected_box_px(solid(0, 0, 12), camera)
    assert 0.5 * (centre[0] + centre[2]) == pytest.approx(320.0)
    wall = projected_box_px(solid(0, 0, 3, size=(0.1, 200.0, 200.0)), camera)
    np.testing.assert_allclose(wall, [0, 0, 640, 480], atol=12.0)  # the fisheye sees beyond half a sphere


def test_what_is_not_known():
    no_size = SimpleNamespace(T_cam_obj=SE3.identity(), position_m=None, dimensions_m=None)
    nowhere = SimpleNamespace(T_cam_obj=None, position_m=None, dimensions_m=np.ones(3))
    assert projected_box_px(no_size, PINHOLE) is None
    assert projected_box_px(nowhere, PINHOLE) is None


def test_overlap():
    box = np.array([0.0, 0.0, 4.0, 2.0])
    assert box_iou(box, box) == 1.0
    assert box_iou(box, box + 10) == 0.0
    assert box_iou(np.zeros(4), np.zeros(4)) == 0.0
    assert clipped_box_px(np.array([10.0, 10.0, 10.0, 20.0]), PINHOLE) is None
