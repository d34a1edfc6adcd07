"""Whether a box that bears another name still shows the same object: its picture, where its corners do not last.

That the object under a box is the same, it can say; that an object without a box is still there, not well enough: over
places where walking people had been, it vouched for the shadow on a crossing once in some minutes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from belie.geometry import FloatArray
from belie.odometry.local_appearance import best_match, picture_of
from belie.odometry.local_features import ImageStack
from belie.types import GrayImage

VOUCHES = 5.0  # nats: a detector's track goes over to another object some 5 times an hour; 0.03 may be accused for it
_GONE = -3.0  # nats; odds of one in twenty
_MOST = 3.0  # nats a message
_FIRST, _EVERY = 6, 4  # messages in which its own correlations are learned
_PRIOR = 4.0  # messages that these expectations weigh:
_SAME, _OTHER = 0.7, 0.3  # correlation with itself and with what is beside it
_SIGMA = 0.17  # of both, as measured on walking people 0.3 s apart and on parked cars


@dataclass(slots=True)
class Likeness:
    """An object's picture when it was last detected, and how well it fits where it should be.

    `evidence`: log-likelihood ratio, nats, that the box shows the object, summed over the messages that misname it.
    """

    seen: tuple[ImageStack, FloatArray] | None = (
        None  # image and box: its picture is cut out when somebody asks
    )
    evidence: float = 0.0
    score: float = 0.0
    _same: float = _SAME * _PRIOR
    _other: float = _OTHER * _PRIOR
    _count: float = _PRIOR
    _count_other: float = _PRIOR
    _messages: int = 0
    _picture: GrayImage | None = None

    @property
    def vouches(self) -> bool:
        """Whether it is certainly the same object."""
        return self.evidence >= VOUCHES

    @property
    def denies(self) -> bool:
        """Whether it is another one."""
        return self.evidence <= _GONE

    @property
    def beside(self) -> float:
        """What the picture scores beside the object."""
        return self._other / self._count_other

    @property
    def picture(self) -> GrayImage | None:
        """Of the object when it was last detected; None where nothing is seen in it."""
        if self.seen is not None:
            self._picture, self.seen = picture_of(*self.seen), None
        return self._picture

    def learn(self, stack: ImageStack, box_px: FloatArray) -> None:
        """Take its picture anew; now and then learn how well the last one fits, and what is beside the object."""
        self.evidence = 0.0
        self._messages += 1
        asks = self._messages <= _FIRST or self._messages % _EVERY == 0
        if asks and self.picture is not None:
            self._same += best_match(stack, self.picture, box_px)[0]
            self._count += 1.0
            width = box_px[2] - box_px[0]
            for side in (-1.5, 1.5):
                beside = box_px + side * width * np.array([1.0, 0.0, 1.0, 0.0])
                if beside[0] >= 0.0 and beside[2] <= stack.size[0]:
                    self._other += best_match(stack, self.picture, beside)[0]
                    self._count_other += 1.0
        self.seen = stack, box_px

    def look(self, stack: ImageStack, box_px: FloatArray) -> FloatArray | None:
        """A message misnames it or does not tell of it: add what its picture says.

        Returns where it is, seen from the box, px, shape (2,); None where the picture does not speak for it.
        """
        if self.picture is None:
            return None
        self.score, shift_px = best_match(stack, self.picture, box_px)
        same, other = self._same / self._count, self.beside
        told = ((self.score - other) ** 2 - (self.score - same) ** 2) / (2.0 * _SIGMA**2)
        told = min(max(told, -_MOST), _MOST) if same > other else 0.0
        self.evidence += told
        return shift_px if told > 0.0 else None
