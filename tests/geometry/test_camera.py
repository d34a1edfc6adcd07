import numpy as np
import pytest

from belie.geometry import CameraModel

CAMERAS = {
    "pinhole": CameraModel(width=640, height=480, fx=500, fy=510, cx=320.5, cy=239.5),
    "plumb_bob": CameraModel(
        width=752, height=480, fx=420.5, fy=420.6, cx=355.2, cy=250.3,
        model="radial_tangential", distortion=(-0.29660776, 0.08081684, 1e-4, -2e-4),
    ),
    "rational": CameraModel(
        width=640, height=480, fx=400, fy=400, cx=320, cy=240,
        model="rational", distortion=(0.1, -0.02, 1e-4, 1e-4, 0.001, 0.12, -0.01, 0.002),
    ),
    "fisheye": CameraModel(
        width=640, height=480, fx=300, fy=300, cx=320, cy=240,
        model="equidistant", distortion=(-0.01, 0.02, -0.005, 0.001),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CAMERAS)
def test_normalize_inverts_project(name):
    camera = CAMERAS[name]
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-0.5, 0.5, (200, 2)), np.ones(200)]) * rng.uniform(1, 20, (200, 1))
    normalized = camera.normalize(camera.project(points))
    assert np.abs(normalized - points[:, :2] / points[:, 2:]).max() < 1e-5


def test_scaling_keeps_rays():
    camera = CAMERAS["plumb_bob"]
    half = camera.scaled(0.5)
    px = np.array([[100.0, 50.0], [600.0, 400.0]])
    np.testing.assert_allclose(half.normalize((px + 0.5) * 0.5 - 0.5), camera.normalize(px), atol=1e-9)


@pytest.mark.parametrize(
    "change", [{"fx": 0.0}, {"cx": float("nan")}, {"distortion": (1.0,)}, {"model": "odd"}, {"width": 0}]
)
def test_nonsense_is_refused(change):
    values = {"width": 640, "height": 480, "fx": 500.0, "fy": 500.0, "cx": 320.0, "cy": 240.0} | change
    with pytest.raises(ValueError):  # noqa: PT011
        CameraModel(**values)
