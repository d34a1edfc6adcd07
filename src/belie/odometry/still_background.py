"""What stands still before a camera that stands still, and how an image differs from it.

A walking person has no corner that lasts from image to image, and a picture of 40 px correlates with shadows and trees
nearly as well as with itself. Against the background that a standing camera has seen before, little else is left.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np

from belie.geometry import FloatArray, so3_log
from belie.odometry.local_features import ImageStack
from belie.types import GrayImage, VisualEstimate, read_only

NO_DIFFERENCE = 128  # gray, of an image of differences: 128 + half the difference

_KEYS = 5  # images, of which the median is the background
_APART_NS = 500_000_000  # between them: who walks clears his own width in less than a second, two of the five
STOOD_NS = 2 * _APART_NS  # for so long, at least, has been there what the median of five images shows
_STILL_PX = 0.25  # displacement from image to image: a standing camera's is told to 0.05 px
_TURNED_PX = 1.0  # since the last of those images
_CHANGED, _MOST_CHANGED = 6.0, 0.3  # times the noise; share of the pixels: exposure, a lorry, the sun
_LEAST_CHANGED = 0.1  # share of a box's pixels, of what came into it: the thinnest walker fills more
_SAMPLE_STRIDE = 8
_MEDIAN_NOISE = 1.13  # of an image less the median of five, times an image's


class Difference(ImageStack):
    """An image less a background, as 128 + half of it, each level made when asked for; none left in `boxes` (N, 4).

    Of large objects nobody asks for the first level, which would cost more than all others.
    """

    def __init__(self, image: ImageStack, background: ImageStack, boxes: FloatArray | None = None) -> None:
        super().__init__(image.level(0))
        self.image, self.background = image, background
        self._boxes = np.empty((0, 4)) if boxes is None else boxes
        self._told: dict[int, GrayImage] = {}

    @cached_property
    def noise(self) -> float:
        """Standard deviation of its noise, gray."""
        return 0.5 * _MEDIAN_NOISE * self.image.noise

    def level(self, k: int) -> GrayImage:
        """The difference, halved `k` times."""
        if k not in self._told:
            image, background = self.image.level(k), self.background.level(k)
            told = np.asarray(cv2.addWeighted(image, 0.5, background, -0.5, NO_DIFFERENCE), dtype=np.uint8)
            for x0, y0, x1, y1 in np.round(self._boxes * 0.5**k).astype(int).tolist():
                told[max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)] = NO_DIFFERENCE
            self._told[k] = read_only(told)
        return self._told[k]


@dataclass(slots=True)
class StillBackground:
    """The median of five images, half a second or more apart, for as long as the camera stands.

    What has moved by its own width within a second is not in it; what stands for longer is, and has lasting corners.

    Examples
    --------
    >>> from belie.geometry import SE3
    >>> still = VisualEstimate(stamp_ns=1, previous_stamp_ns=0, T_prev_cur=SE3.identity(), covariance=np.eye(6),
    ...     corners=99, matches=99, inliers=99, parallax_px=0.02)
    >>> background, wall = StillBackground(focal_px=400.0), np.full((48, 64), 90, np.uint8)
    >>> for k in range(6):
    ...     background.see(ImageStack(wall), still, k * 500_000_000)
    >>> walker = wall.copy()
    >>> walker[10:30, 20:28] = 150
    >>> background.see(ImageStack(walker), still, 3_000_000_000)
    >>> difference = background.difference().level(0)
    >>> int(difference[20, 24]), int(difference[20, 40])
    (158, 128)
    """

    focal_px: float
    _keys: deque[GrayImage] = field(default_factory=lambda: deque(maxlen=_KEYS))
    _key_ns: int = 0
    _R_key_cur: FloatArray = field(default_factory=lambda: np.eye(3))
    _seen: ImageStack | None = None  # the latest image
    _seen_ns: int = 0
    _median: ImageStack | None = None  # of the keys, once somebody has asked
    _difference: Difference | None = None  # of the latest image, once somebody has asked
    _is_asked: bool = False

    def see(self, stack: ImageStack, estimate: VisualEstimate | None, stamp_ns: int) -> None:
        """Take the next image; `estimate`: the camera's motion since the last one, None where it is not known."""
        if self._seen is not None and not self._stands(estimate):
            self._keys.clear()
            self._R_key_cur, self._median = np.eye(3), None
        elif self._seen is not None and (not self._keys or self._seen_ns - self._key_ns >= _APART_NS):
            self._keys.append(self._seen.level(0))
            self._key_ns, self._R_key_cur, self._median = self._seen_ns, np.eye(3), None
        self._seen, self._seen_ns, self._difference, self._is_asked = stack, stamp_ns, None, False

    def _stands(self, estimate: VisualEstimate | None) -> bool:
        if estimate is None or estimate.inliers == 0 or estimate.previous_stamp_ns > self._seen_ns:
            return False  # since an image that was not fit to judge by, nobody has told of all of its motion
        R = estimate.T_prev_cur.R
        self._R_key_cur = self._R_key_cur @ R
        step, since = (self.focal_px * float(np.linalg.norm(so3_log(r))) for r in (R, self._R_key_cur))
        return max(step, estimate.parallax_px) < _STILL_PX and since < _TURNED_PX

    def difference(self) -> Difference | None:
        """The latest image less the background, as 128 + half of it; None where there is no background (yet)."""
        if not self._is_asked:
            self._difference, self._is_asked = self._subtracted(), True
        return self._difference

    def shows(self, box_px: FloatArray) -> bool:
        """Whether nothing in a box (4,) has changed for a while; False where no background is known."""
        difference = self.difference()
        if difference is None:
            return False
        x0, y0, x1, y1 = np.maximum(np.round(box_px), 0.0).astype(int).tolist()
        told = difference.level(0)[y0:y1, x0:x1].astype(np.int16)
        changed = np.abs(told - NO_DIFFERENCE) > _CHANGED * difference.noise
        return told.size > 0 and float(changed.mean()) < _LEAST_CHANGED

    def _subtracted(self) -> Difference | None:
        if len(self._keys) < _KEYS or self._seen is None:
            return None
        if self._median is None:
            self._median = ImageStack(read_only(_median_of_five(*self._keys)))
        image, median = (
            stack.level(0)[::_SAMPLE_STRIDE, ::_SAMPLE_STRIDE] for stack in (self._seen, self._median)
        )
        changed = cv2.absdiff(image, median) > _CHANGED * self._seen.noise
        return None if float(changed.mean()) > _MOST_CHANGED else Difference(self._seen, self._median)


def without_boxes(difference: Difference, boxes: FloatArray) -> Difference:
    """An image of differences with none left in boxes (N, 4): what others were told to be explains them."""
    return Difference(difference.image, difference.background, boxes)


def _median_of_five(a: GrayImage, b: GrayImage, c: GrayImage, d: GrayImage, e: GrayImage) -> GrayImage:
    """Without sorting: the middle one of `e` and the two inner ones of two ordered pairs."""
    low = cv2.max(cv2.min(a, b), cv2.min(c, d))
    high = cv2.min(cv2.max(a, b), cv2.max(c, d))
    median = cv2.max(cv2.min(low, high), cv2.min(cv2.max(low, high), e))
    return np.asarray(median, dtype=np.uint8)
