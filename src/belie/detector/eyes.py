"""What the default profile asks of its eyes: no claim comes near them, so what they saw once can be told again."""

from __future__ import annotations

from typing import Protocol

from belie.geometry import FloatArray
from belie.types import Frame, GrayImage, VisualEstimate


class Eyes(Protocol):
    """The motion of a camera from its images alone; `belie.odometry.VisualOdometry` is one."""

    def update(self, frame: Frame) -> VisualEstimate:
        """The camera's motion since the previous frame."""
        ...

    def scene(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Corners of the latest image with known depth: undistorted (N, 2), 1/Z (N,) and its deviation (N,)."""
        ...

    def half(self) -> GrayImage | None:
        """The image of the last `update` at half its size, where it was made for it."""
        ...
