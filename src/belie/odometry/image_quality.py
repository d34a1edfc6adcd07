"""What an image can tell: how noisy it is, and the reasons behind UNDECIDED."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from belie.geometry import compiled
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
    return max(_median_laplacian(image, stride) / (6.0 * 0.6745), _LEAST_NOISE)


@compiled()
def _median_laplacian(image: Any, stride: int) -> float:
    """Lower median of the absolute Laplacian at every `stride`-th pixel, by counting; 0 without any."""
    height, width = image.shape
    counts = np.zeros(16 * 255 + 1, np.int64)
    samples = 0
    for y in range(1, height - 1, stride):
        for x in range(1, width - 1, stride):
            edges = np.int64(image[y - 1, x]) + image[y + 1, x] + image[y, x - 1] + image[y, x + 1]
            corners = (
                np.int64(image[y - 1, x - 1])
                + image[y - 1, x + 1]
                + image[y + 1, x - 1]
                + image[y + 1, x + 1]
            )
            counts[abs(4 * np.int64(image[y, x]) - 2 * edges + corners)] += 1
            samples += 1
    middle = (samples + 1) // 2
    seen = 0
    for value in range(counts.shape[0]):
        seen += counts[value]
        if seen >= middle:
            return float(value)
    return 0.0
