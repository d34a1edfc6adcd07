"""What an object without lasting corners looks like: its picture, and before a standing camera its figure."""

from __future__ import annotations

from dataclasses import dataclass, field

from belie.detector.figure import Figure
from belie.detector.likeness import Likeness
from belie.geometry import FloatArray
from belie.odometry.local_features import ImageStack


@dataclass(slots=True)
class Looks:
    """Both witnesses of one object; `difference`: the image less the background, None where none is known."""

    picture: Likeness = field(default_factory=Likeness)
    figure: Figure = field(default_factory=Figure)

    def learn(
        self,
        current: ImageStack,
        difference: ImageStack | None,
        box_px: FloatArray,
        told_ns: int,
        image_ns: int,
    ) -> None:
        """It was told of under its name: take its looks anew; stamps as `Figure.learn_late`."""
        self.picture.learn(current, box_px)
        if difference is None:
            self.figure.forget()
        else:
            self.figure.learn_late(difference, box_px, told_ns, image_ns)

    def keep(self) -> None:
        """It is not told of: keep its pictures, and no whole image for them."""
        self.picture.keep()
        self.figure.keep()

    def forget(self) -> None:
        """It was told of under its name, and has lasting corners: its looks are not asked for."""
        self.picture.forget()
        self.figure.forget()

    def look_at(self, current: ImageStack, difference: ImageStack | None, box_px: FloatArray) -> None:
        """Compare a box that bears another name."""
        self.picture.look(current, box_px)
        if difference is not None:
            self.figure.look(difference, box_px)

    @property
    def are_the_same(self) -> bool:
        """Whether one of them is certain that another name is told of the same object."""
        return self.picture.vouches or self.figure.vouches

    @property
    def differ(self) -> bool:
        """Whether another name is told of something else."""
        return self.picture.denies and not self.figure.vouches
