"""Eyes that look once: what the images showed in the honest run is told again in every run that attacks a claim."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from belie.detector.eyes import Eyes
from belie.geometry import FloatArray
from belie.types import Frame, GrayImage, VisualEstimate

Scene = tuple[FloatArray, FloatArray, FloatArray]


class OtherImagesError(Exception):
    """Not the images that were seen: this run must look for itself."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sight:
    """What one image showed, and what it took to see it."""

    frame: Frame
    estimate: VisualEstimate
    scene: Scene
    spent_ms: float


@dataclass(slots=True)
class LookingEyes:
    """Looks, and keeps what it sees in `sights`."""

    eyes: Eyes
    sights: list[Sight] = field(default_factory=list)

    def update(self, frame: Frame) -> VisualEstimate:
        """See the camera's motion since the previous frame."""
        began = time.perf_counter()
        estimate = self.eyes.update(frame)
        spent_ms = (time.perf_counter() - began) * 1e3
        self.sights.append(Sight(frame=frame, estimate=estimate, scene=self.eyes.scene(), spent_ms=spent_ms))
        return estimate

    def scene(self) -> Scene:
        """Corners of the latest image with known depth."""
        return self.sights[-1].scene if self.sights else self.eyes.scene()

    def half(self) -> GrayImage | None:
        """The image at half its size."""
        return self.eyes.half()


@dataclass(slots=True)
class RememberingEyes:
    """Tells again what was seen; `spent_ms` is what looking took then, as if it had been spent at the last update."""

    eyes: Eyes
    sights: list[Sight]
    spent_ms: float = 0.0
    _next: int = 0

    def update(self, frame: Frame) -> VisualEstimate:
        """The motion that was seen at this very image.

        Raises
        ------
        OtherImagesError
            If it is another image than was seen next.
        """
        if self._next >= len(self.sights) or self.sights[self._next].frame is not frame:
            raise OtherImagesError
        sight = self.sights[self._next]
        self._next += 1
        self.spent_ms = sight.spent_ms
        return sight.estimate

    def scene(self) -> Scene:
        """Corners of that image with known depth."""
        return self.sights[self._next - 1].scene if self._next else self.eyes.scene()

    def half(self) -> GrayImage | None:
        """None: images are not kept twice; who needs the half makes it."""
        return None
