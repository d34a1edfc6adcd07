"""Whether a place still shows the same object: its picture, where its corners do not last.

That the object under a box with another name is the same, the picture can say; that an object without a box is still
there, not well enough: over places where walking people had been, it vouched for the shadow on a crossing once in some
minutes. Before a standing camera its figure can (`detector/figure.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from belie.geometry import FloatArray
from belie.odometry.local_appearance import best_match, picture_of
from belie.odometry.local_features import ImageStack
from belie.types import GrayImage

_GONE = -3.0  # nats; odds of one in twenty
_MOST = 3.0  # nats a message
_FIRST, _EVERY = 6, 4  # messages in which its own correlations are learned
_PRIOR = 4.0  # messages that expectations weigh


@dataclass(frozen=True, slots=True)
class Expected:
    """Correlation of a picture with itself later, with what is beside it, and with what may take its place.

    `alike`: None where that looks as what is beside it; `sigma`: the deviation of all three; `vouches`: nats of
    evidence against the last that make certain.
    """

    same: float
    other: float
    alike: float | None
    sigma: float
    vouches: float
    may_fade: bool = True  # light may change what is seen of it


# As measured on walking people 0.3 s apart and on parked cars. A detector's track goes over to another object some five
# times an hour; 0.03 may be accused for it.
PICTURE = Expected(same=0.7, other=0.3, alike=None, sigma=0.17, vouches=5.0)


@dataclass(slots=True)
class Likeness:
    """An object's picture when it was last detected, and how well it fits where it should be.

    `told`: log-likelihood ratio, nats, of the last look that the place shows the object, not what is beside it;
    `evidence`: that it does not show something alike, summed since it was last told of under its name; `shift_px` (2,):
    how far off that place the picture fits best.
    """

    expected: Expected = PICTURE

    seen: tuple[ImageStack, FloatArray] | None = (
        None  # image and box: its picture is cut out when somebody asks
    )
    evidence: float = 0.0
    told: float = 0.0
    score: float = 0.0
    shift_px: FloatArray = field(default_factory=lambda: np.zeros(2))
    _same: float = 0.0
    _other: float = 0.0
    _count: float = _PRIOR
    _count_other: float = _PRIOR
    _messages: int = 0
    _picture: GrayImage | None = None

    def __post_init__(self) -> None:
        self._same, self._other = self.expected.same * _PRIOR, self.expected.other * _PRIOR

    @property
    def vouches(self) -> bool:
        """Whether it is certainly the same object."""
        return self.evidence >= self.expected.vouches

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
        self.evidence = self.told = 0.0
        self._messages += 1
        asks = self._messages <= _FIRST or self._messages % _EVERY == 0
        if asks and self.picture is not None:
            self._same += self._match(stack, self.picture, box_px)[0]
            self._count += 1.0
            width = box_px[2] - box_px[0]
            for side in (-1.5, 1.5):
                beside = box_px + side * width * np.array([1.0, 0.0, 1.0, 0.0])
                if beside[0] >= 0.0 and beside[2] <= stack.size[0]:
                    self._other += self._match(stack, self.picture, beside)[0]
                    self._count_other += 1.0
        self.seen = stack, box_px

    def keep(self) -> None:
        """It is not told of: cut out its picture now, that no whole image is kept for it."""
        _ = self.picture

    def forget(self) -> None:
        """It was told of, and its looks are not asked for: what they said before is over."""
        self.seen, self.evidence, self.told = None, 0.0, 0.0

    def look(self, stack: ImageStack, box_px: FloatArray) -> None:
        """A message misnames it, or does not tell of it: add what its picture says."""
        self.told = 0.0
        if self.picture is None:
            return
        self.score, self.shift_px = self._match(stack, self.picture, box_px)
        beside = self.beside
        self.told = self._against(beside)
        self.evidence += self._against(max(beside, self.expected.alike or beside))

    def _against(self, other: float) -> float:
        same = self._same / self._count
        told = ((self.score - other) ** 2 - (self.score - same) ** 2) / (2.0 * self.expected.sigma**2)
        return min(max(told, -_MOST), _MOST) if same > other else 0.0

    def _match(self, stack: ImageStack, picture: GrayImage, box_px: FloatArray) -> tuple[float, FloatArray]:
        return best_match(stack, picture, box_px, may_fade=self.expected.may_fade)
