"""Images without structure: black, white, gray, or covered by something plain."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median

from belie.checks.camera_settings import CameraSettings
from belie.checks.image_signature import ImageSignature

_LEAST_KNOWN = 4  # images before a median of them means anything
_LASTING = 10  # times the frames that make a fault: then a faint view is the usual one


@dataclass(slots=True)
class BlankRun:
    """A run of images without structure; `abrupt`: the one before the first had its usual structure."""

    since_ns: int
    abrupt: bool
    count: int = 0


class Blankness:
    """Tells blank images, and whether the scene went at once (a cover) or slowly (dusk, fog, a wall).

    Examples
    --------
    >>> import numpy as np
    >>> from belie.checks.image_signature import image_signature
    >>> scene = image_signature(np.tile(np.arange(128, dtype=np.uint8), (72, 1)))
    >>> black = image_signature(np.zeros((72, 128), np.uint8))
    >>> blankness = Blankness(CameraSettings())
    >>> [blankness.look(image, k) for k, image in enumerate([scene] * 4 + [black] * 2)][3:]
    [False, True, True]
    >>> blankness.run.abrupt, blankness.run.since_ns
    (True, 4)
    """

    def __init__(self, settings: CameraSettings) -> None:
        self._settings = settings
        self._spreads: deque[float] = deque(maxlen=2 * _LEAST_KNOWN)
        self._was_blank = False
        self.run: BlankRun | None = None

    @property
    def is_or_was(self) -> bool:
        """Whether this image or the one before is blank: what changed between them is not motion."""
        return self.run is not None or self._was_blank

    def look(self, image: ImageSignature, stamp_ns: int) -> bool:
        """Take in an image; True if it is blank."""
        s, spread = self._settings, image.spread_gray
        self._was_blank = self.run is not None
        usual = float(median(self._spreads)) if len(self._spreads) >= _LEAST_KNOWN else 0.0
        gone = usual > s.blank_gray and spread < s.blank_ratio * usual
        if not gone and spread >= s.blank_gray:
            self.run = None
            self._spreads.append(spread)
            return False
        if self.run is None:
            self.run = BlankRun(since_ns=stamp_ns, abrupt=gone and self._spreads[-1] > 0.5 * usual)
        self.run.count += 1
        lasting = not self.run.abrupt or self.run.count > _LASTING * s.blank_frames
        if lasting and spread >= s.blank_gray:
            self._spreads.append(spread)
        return True
