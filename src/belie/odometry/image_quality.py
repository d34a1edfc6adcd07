"""What an image can tell: how noisy it is, and the reasons behind UNDECIDED."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from belie.types import GrayImage

_DARK_GRAY = 12.0  # mean gray value; below it a scene's shades drown in two gray levels of sensor noise
_FLAT_GRAY = 6.0  # standard deviation: a wall, thick fog or a cover
_FEW_CORNERS = 15
_SAMPLE_STRIDE = 8
_SAMPLES = 5000  # pixels
_LEAST_NOISE = 0.5  # gray: values are rounded to whole ones (0.3), and compression smooths real noise away


def why_nothing_is_seen(image: GrayImage, corners: int) -> str | None:
    """The reason why an image with so few corners tells nothing, or None where it has enough.

    >>> why_nothing_is_seen(np.full((48, 64), 128, np.uint8), 0)
    'blank: gray values vary by 0.0 only (blank wall, fog or a covered lens)'
    >>> why_nothing_is_seen(np.full((48, 64), 128, np.uint8), 100) is None
    True
    """
    if corners >= _FEW_CORNERS:
        return None
    sample = image[::_SAMPLE_STRIDE, ::_SAMPLE_STRIDE]
    mean, spread = float(sample.mean()), float(sample.std())
    if mean < _DARK_GRAY:
        return f"dark: mean gray value {mean:.0f}"
    if spread < _FLAT_GRAY:
        return f"blank: gray values vary by {spread:.1f} only (blank wall, fog or a covered lens)"
    return f"too few corners: {corners} (fog, motion blur or a plain scene)"


def sensor_noise(image: GrayImage) -> float:
    """Standard deviation of the noise of an image's pixels, gray values; never below 0.5.

    What a Laplacian that ignores edges and slopes leaves (Immerkaer, "Fast noise variance estimation", CVIU 64, 1996),
    by the median over some 5000 pixels, which texture moves less than the mean.

    >>> noisy = 100.0 + 4.0 * np.random.default_rng(0).standard_normal((240, 320))
    >>> 3.5 < sensor_noise(noisy.round().astype(np.uint8)) < 4.5
    True
    """
    stride = max(_SAMPLE_STRIDE, round(math.sqrt(image.size / _SAMPLES)))
    height, width = image.shape

    def beside(dy: int, dx: int) -> npt.NDArray[np.int32]:
        return image[1 + dy : height - 1 + dy : stride, 1 + dx : width - 1 + dx : stride].astype(np.int32)

    edges = beside(-1, 0) + beside(1, 0) + beside(0, -1) + beside(0, 1)
    corners = beside(-1, -1) + beside(-1, 1) + beside(1, -1) + beside(1, 1)
    laplacian = np.abs(4 * beside(0, 0) - 2 * edges + corners).ravel()
    if not len(laplacian):
        return _LEAST_NOISE
    middle = (len(laplacian) - 1) // 2
    return max(float(np.partition(laplacian, middle)[middle]) / (6.0 * 0.6745), _LEAST_NOISE)
