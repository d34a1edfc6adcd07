"""How a detector errs, as it was seen: what `belie calibrate` learns of it."""

from __future__ import annotations

from dataclasses import dataclass

from belie.checks.objects import Counts


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectHabits:
    """What one detector was seen to do in one recording.

    Parameters
    ----------
    interval_s : float
        Between its messages.
    missed, misnamed : Counts
        Of all objects that it should see.
    objects : tuple of Counts
        Missed, of each object.
    steps : tuple of (float, bool)
        Messages after a miss: root of the object's area, px, and whether the miss went on.
    """

    interval_s: float
    missed: Counts
    misnamed: Counts
    objects: tuple[Counts, ...] = ()
    steps: tuple[tuple[float, bool], ...] = ()

    @property
    def messages(self) -> float:
        """About objects that it should see."""
        return self.missed.right + self.missed.wrong
