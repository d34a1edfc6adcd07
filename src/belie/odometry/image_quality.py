"""Why an image tells nothing: the reasons behind UNDECIDED."""

from __future__ import annotations

from belie.types import GrayImage

_DARK_GRAY = 12.0  # mean gray value; below it a scene's shades drown in two gray levels of sensor noise
_FLAT_GRAY = 6.0  # standard deviation: a wall, thick fog or a cover
_FEW_CORNERS = 15
_SAMPLE_STRIDE = 8


def why_nothing_is_seen(image: GrayImage, corners: int) -> str | None:
    """The reason why an image with so few corners tells nothing, or None where it has enough.

    >>> import numpy as np
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
