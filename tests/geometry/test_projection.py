"""The compiled projection: the same pixels as OpenCV's, and a Jacobian that is its derivative."""

import cv2
import numpy as np
import pytest

from belie.geometry import CameraModel, flat_camera, project_normalized

SIZE = {"width": 752, "height": 480, "fx": 460.0, "fy": 455.0, "cx": 370.0, "cy": 245.0}
CAMERAS = {
    "pinhole": CameraModel(**SIZE),
    "plumb_bob": CameraModel(**SIZE, model="radial_tangential", distortion=(-0.29, 0.08, 1e-3, -5e-4)),
    "plumb_bob_k3": CameraModel(
        **SIZE, model="radial_tangential", distortion=(-0.29, 0.08, 1e-3, -5e-4, 0.01)
    ),
    "rational": CameraModel(
        **SIZE, model="rational", distortion=(0.3, -0.1, 1e-3, -5e-4, 0.02, 0.6, -0.05, 0.01)
    ),
    "thin_prism": CameraModel(
        **SIZE,
        model="rational",
        distortion=(-0.2, 0.05, 1e-3, 2e-3, 0, 0, 0, 0, 2e-3, -1e-3, 3e-3, 1e-3),
    ),
    "tilted": CameraModel(
        **SIZE,
        model="rational",
        distortion=(-0.2, 0.05, 1e-3, 2e-3, 0, 0, 0, 0, 2e-3, -1e-3, 3e-3, 1e-3, 0.02, -0.03),
    ),
    "fisheye": CameraModel(**SIZE, model="equidistant", distortion=(-0.02, 0.004, -0.003, 0.001)),
}


@pytest.fixture(params=sorted(CAMERAS))
def camera(request):
    return CAMERAS[request.param]


def points_in_view(camera):
    u, v = np.meshgrid(np.linspace(5, camera.width - 6, 23), np.linspace(5, camera.height - 6, 17))
    return camera.normalize(np.column_stack([u.ravel(), v.ravel()]))


def test_agrees_with_opencv(camera):
    points = points_in_view(camera)
    ours = np.array([project_normalized(flat_camera(camera), *p)[:2] for p in points])
    rays = np.column_stack([points, np.ones(len(points))])
    np.testing.assert_allclose(ours, camera.project(rays), atol=1e-6)
    if camera.model == "rational":
        direct, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), camera.K, np.array(camera.distortion))
        np.testing.assert_allclose(ours, direct[:, 0], atol=1e-6)


def test_jacobian_is_the_derivative(camera):
    flat, step = flat_camera(camera), 1e-6
    for x, y in points_in_view(camera)[::7]:
        jacobian = np.array(project_normalized(flat, x, y)[2:]).reshape(2, 2)
        by_x = np.subtract(
            project_normalized(flat, x + step, y)[:2], project_normalized(flat, x - step, y)[:2]
        )
        by_y = np.subtract(
            project_normalized(flat, x, y + step)[:2], project_normalized(flat, x, y - step)[:2]
        )
        np.testing.assert_allclose(jacobian, np.column_stack([by_x, by_y]) / (2 * step), rtol=1e-5, atol=1e-3)


def test_centre_of_a_fisheye_is_regular():
    flat = flat_camera(CAMERAS["fisheye"])
    np.testing.assert_allclose(
        project_normalized(flat, 0.0, 0.0), (370.0, 245.0, 460.0, 0.0, 0.0, 455.0), atol=1e-9
    )
    np.testing.assert_allclose(project_normalized(flat, 1e-7, 0.0)[2], 460.0, atol=1e-3)


def test_far_outside_the_view_is_not_folded_back():
    # At this radius the polynomial has turned, and would put the point inside the image.
    camera = CAMERAS["plumb_bob"]
    assert np.isnan(project_normalized(flat_camera(camera), 3.0, 0.0)).all()
