"""Whether an object without lasting corners is still there, before a standing camera, though nobody tells of it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from belie.detector.likeness import Expected, Likeness
from belie.geometry import FloatArray
from belie.geometry.boxes import longer_side
from belie.odometry.local_features import ImageStack
from belie.types import GrayImage

# As measured on walking people 1.5 s apart: 0.60 with a deviation of 0.20; beside them 0.03, 0.13; but the shadow that
# a crowd draws along beside it 0.48. Somebody walks into that, unseen, once in two hours; 0.03 an hour may be accused.
_FIGURE = Expected(same=0.6, other=0.05, alike=0.45, sigma=0.18, vouches=2.8, may_fade=False)
_STRAYS = 0.15  # of the longer side: how far it may be off its path
_HURRIES = 0.5  # of the speed: by how much that may change
_TRUST = 0.5  # of the place where it fits, against the expected one
_LATEST = 16  # images that a message may be late
_TRUST_SPEED = _TRUST * _TRUST / (2.0 - _TRUST)  # goes with it (Benedict and Bordner, IRE Trans. AC-7, 1962)


@dataclass(slots=True)
class Figure(Likeness):
    """What an object differs in from the background (`odometry/still_background.py`), and the path that it keeps.

    Shadows and other people look alike and come along, but not on its path: one may slow down or hurry there.
    """

    expected: Expected = _FIGURE
    _keeps_path: bool = False
    _strayed_px: FloatArray = field(default_factory=lambda: np.zeros(2))  # since it was last told of
    _untold: deque[tuple[int, GrayImage | None]] = field(default_factory=lambda: deque(maxlen=_LATEST))
    _looked_frame: int = -1  # frame count of the image in which it was last looked for

    @property
    def is_there(self) -> bool:
        """Whether it was found at the last message, which did not tell of it."""
        return self.told > 0.0 and not self.denies

    @property
    def may_be_there(self) -> bool:
        """Whether it was found before, and the last message cannot tell."""
        return self.evidence != 0.0 and not self.is_there and not self.denies

    def learn_late(self, difference: ImageStack, box_px: FloatArray, told_ns: int, image_ns: int) -> None:
        """Take its figure anew; `told_ns`: stamp of the image that a message tells of, `image_ns`: of this one.

        In a later image it may have gone: what that shows is the object's once a message about that tells of it.
        """
        known = self.picture
        self.learn(difference, box_px)
        if told_ns < image_ns:
            self._untold.append((image_ns, self.picture))
            self._picture = known
            while self._untold and self._untold[0][0] <= told_ns:
                _, self._picture = self._untold.popleft()
        else:
            self._untold.clear()

    def meet(self, off_px: float, side_px: float) -> None:
        """It was told of, so far from where it was expected; `side_px`: the longer one of its box."""
        self.told = 0.0
        self._strayed_px = np.zeros(2)
        self._keeps_path = off_px <= _STRAYS * side_px

    def look_for(
        self, untold: ImageStack | None, box_px: FloatArray, gone_px: FloatArray | None, frame: int
    ) -> tuple[FloatArray, FloatArray] | None:
        """Find what was not told of and differs from the background as it did.

        `box_px` (4,): where it is expected; `gone_px` (2,): its way since it was told of, None where its speed is not
        known; `frame`: count of images, each of which is asked once. The answer: how far to correct its
        place, and a step of its way since the last message, (2,) each.
        """
        if frame == self._looked_frame:
            return None  # a faster detector, or late messages: no new evidence
        self._looked_frame, self.told = frame, 0.0
        if untold is None or gone_px is None or not self._keeps_path:
            return None
        before = self.evidence
        self.look(untold, box_px)
        if not self.is_there:
            return None
        strayed_px = self._strayed_px + _TRUST * self.shift_px
        if _leaves(strayed_px, gone_px, _STRAYS * longer_side(box_px)):
            self.told, self.evidence = 0.0, before  # that is somebody else
            return None
        self._strayed_px = strayed_px
        return _TRUST * self.shift_px, _TRUST_SPEED * self.shift_px


def _leaves(strayed_px: FloatArray, gone_px: FloatArray, reach_px: float) -> bool:
    """Whether a stray leads off a way that may be gone slower or faster.

    >>> way = np.array([40.0, 0.0])
    >>> [_leaves(np.array(stray), way, 5.0) for stray in ([20.0, 2.0], [0.0, 6.0], [-30.0, 0.0])]
    [False, True, True]
    """
    gone = float(np.linalg.norm(gone_px))
    x, y = (gone_px / max(gone, 1e-9)).tolist()
    along, across = x * strayed_px[0] + y * strayed_px[1], x * strayed_px[1] - y * strayed_px[0]
    return bool(abs(across) > reach_px or abs(along) > reach_px + _HURRIES * gone)
