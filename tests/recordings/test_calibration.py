"""camera_info of every model to CameraModel."""

import numpy as np
import pytest

from belie.recordings.calibration import CameraInfo, camera_info_file, camera_model
from belie.types import CalibrationError, RecordingError

K = (500.0, 0, 319.5, 0, 510.0, 239.5, 0, 0, 1)


def model(*, D=(), name="plumb_bob", K=K, P=(), size=(640, 480), rectified=False, **fields):
    info = CameraInfo(
        width=fields.pop("width", 640),
        height=fields.pop("height", 480),
        distortion_model=name,
        D=D,
        K=K,
        P=P,
        **fields,
    )
    return camera_model(info, image_size=size, rectified=rectified, where="/camera_info")


@pytest.mark.parametrize(
    ("name", "D", "expected"),
    [
        ("plumb_bob", (), "pinhole"),
        ("plumb_bob", (0.0,) * 5, "pinhole"),
        ("plumb_bob", (0.1, 0.0, 0.0, 0.0), "radial_tangential"),
        ("plumb_bob", (0.1, 0.0, 0.0, 0.0, 0.2), "radial_tangential"),
        ("rational_polynomial", (0.1,) * 8, "rational"),
        ("rational_polynomial", (0.0,) * 8, "pinhole"),
        ("equidistant", (0.0,) * 4, "equidistant"),
        ("fisheye", (0.1,) * 4, "equidistant"),
        ("", (0.0,) * 5, "pinhole"),
    ],
)
def test_models(name, D, expected):
    assert model(name=name, D=D).model == expected


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"K": (0.0,) * 9}, "no calibration .*K is zero"),
        ({"K": ()}, "K is empty"),
        ({"name": "omnidirectional", "D": (0.1,) * 4}, "distortion model 'omnidirectional'"),
        ({"name": "", "D": (0.1,) * 5}, "distortion model ''"),
        ({"D": (0.1,) * 8}, "radial_tangential takes 4 or 5 coefficients, got 8"),
        ({"D": (float("nan"),) * 5}, "must be finite"),
        ({"size": (320, 240)}, "for 640x480 pixels, the images are 320x240"),
    ],
)
def test_unusable(fields, message):
    with pytest.raises(CalibrationError, match=message):
        model(**fields)


def test_rectified_images_use_the_projection():
    P = (400.0, 0, 300.0, 0, 0, 401.0, 200.0, 0, 0, 0, 1, 0)
    camera = model(D=(0.1,) * 5, P=P, rectified=True)
    assert (camera.fx, camera.fy, camera.cx, camera.model) == (400.0, 401.0, 300.0, "pinhole")


def test_binned_and_cropped_images():
    binned = model(binning=(2, 2), size=(320, 240))
    assert (binned.fx, binned.cx, binned.width) == (250.0, 159.5, 320)
    cropped = model(roi_xywh=(100, 50, 200, 100), size=(200, 100))
    assert (cropped.fx, cropped.cx, cropped.cy) == (500.0, 219.5, 189.5)


def test_size_zero_is_the_images_size():
    assert model(width=0, height=0, size=(320, 240)).width == 320


def test_camera_file(tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_text(
        "%YAML:1.0\nimage_width: 640\nimage_height: 480\n"
        "camera_matrix: {rows: 3, cols: 3, data: [500, 0, 319.5, 0, 510, 239.5, 0, 0, 1]}\n"
        "distortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}\n"
    )
    info = camera_info_file(path)
    assert info.K == K
    np.testing.assert_allclose(info.D, [0.1, 0, 0, 0, 0])
    path.write_text('{"image_width": 640, "image_height": 480, "camera_matrix": [[1,0,2],[0,1,2],[0,0,1]]}')
    assert camera_info_file(path).K[2] == 2.0
    for text in ("- a\n- b\n", "a: [1, 2\n", "camera_matrix: {data: [a, b]}\n", "image_width: wide\n"):
        path.write_text(text)
        with pytest.raises(RecordingError) as error:
            camera_info_file(path)
        assert "\n" not in str(error.value)
