"""When an attack acts: frame numbers, seconds, and the stamps that they mean in one recording."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from belie.types import AttackError

NS_PER_S = 1_000_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """A place or a length on the image stream: a number of frames, or seconds (from the first frame).

    Parameters
    ----------
    value : float
        Not negative; whole where `unit` is ``"frame"``.
    unit : "frame" or "s"
        What `value` counts.

    Examples
    --------
    >>> str(Timing.parse("100")), str(Timing.parse("10.5s"))
    ('100', '10.5s')
    """

    value: float
    unit: Literal["frame", "s"]

    @classmethod
    def parse(cls, text: str) -> Timing:
        """From ``100`` (frames) or ``10.5s`` (seconds).

        Raises
        ------
        ValueError
            On anything else; negative numbers and fractions of a frame included.
        """
        digits = text.removesuffix("s")
        value = float(digits)
        if not math.isfinite(value) or value < 0.0:
            raise ValueError(f"{text!r} is not a time")
        if digits == text and value != int(value):
            raise ValueError(f"{text!r} is not a whole frame; write {text}s for seconds")
        return cls(value=value, unit="frame" if digits == text else "s")

    def __str__(self) -> str:
        number = f"{self.value!r}".removesuffix(".0")
        return number if self.unit == "frame" else f"{number}s"


@dataclass(frozen=True, slots=True, eq=False)
class FrameClock:
    """The stamps of a recording's frames, and the way between stamps and (fractional) frame numbers.

    Parameters
    ----------
    stamps_ns : array (N,), int64
        Stamps in the order of the frames.

    Raises
    ------
    AttackError
        Without frames, or where the stamps run backwards.

    Examples
    --------
    >>> clock = FrameClock(np.array([0, 100, 200]) * 1_000_000)
    >>> clock.frame_at(150_000_000), clock.stamp_at(-1), clock.frames_per_second(150_000_000)
    (1.5, -100000000, 10.0)
    """

    stamps_ns: npt.NDArray[np.int64]

    def __post_init__(self) -> None:
        stamps = np.array(self.stamps_ns, dtype=np.int64)
        if stamps.ndim != 1 or stamps.size == 0:
            raise AttackError("the recording has no frames, so there is nothing to attack")
        backwards = np.flatnonzero(np.diff(stamps) < 0)
        if backwards.size:
            raise AttackError(
                f"image stamps run backwards at frame {backwards[0] + 1}: attacks are timed by frames, "
                "repair the stamps first"
            )
        stamps.setflags(write=False)
        object.__setattr__(self, "stamps_ns", stamps)

    @classmethod
    def steady(cls, start_ns: int, period_ns: int, frames: int) -> FrameClock:
        """The clock of frames that will come one a period, for a running camera.

        >>> FrameClock.steady(5, 10, 3).stamps_ns
        array([ 5, 15, 25])
        """
        return cls(start_ns + period_ns * np.arange(frames, dtype=np.int64))

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def period_ns(self) -> int:
        """The usual time between two frames (median).

        Raises
        ------
        AttackError
            Where a single frame, or stamps that stand still, show no period.
        """
        gaps = np.diff(self.stamps_ns)
        gaps = gaps[gaps > 0]
        if gaps.size == 0:
            raise AttackError(f"{len(self)} frame(s) without a time between them: a frame rate is needed")
        return int(np.median(gaps))

    def frame_at(self, stamp_ns: int) -> float:
        """Fractional frame number of a stamp; past the ends, the usual period is assumed."""
        first, last = int(self.stamps_ns[0]), int(self.stamps_ns[-1])
        if stamp_ns < first:
            return (stamp_ns - first) / self.period_ns
        if stamp_ns > last:
            return len(self) - 1 + (stamp_ns - last) / self.period_ns
        index = int(np.searchsorted(self.stamps_ns, stamp_ns, side="right")) - 1
        # Whole nanoseconds since 1970 do not fit a float64, so the difference is taken first.
        into_ns = stamp_ns - int(self.stamps_ns[index])
        return index + (into_ns / int(self.stamps_ns[index + 1] - self.stamps_ns[index]) if into_ns else 0.0)

    def nearest(self, stamp_ns: int) -> int:
        """Number of the frame that is stamped nearest to `stamp_ns`, one of those that there are.

        >>> FrameClock.steady(0, 100, 3).nearest(160)
        2
        """
        return min(max(round(self.frame_at(stamp_ns)), 0), len(self) - 1)

    def stamp_at(self, frame: float) -> int:
        """Stamp of a fractional frame number, ns: the inverse of `frame_at`."""
        first, last = int(self.stamps_ns[0]), int(self.stamps_ns[-1])
        if frame < 0:
            return first + round(frame * self.period_ns)
        if frame > len(self) - 1:
            return last + round((frame - len(self) + 1) * self.period_ns)
        index = min(int(frame), len(self) - 2)
        if index < 0:
            return first
        gap_ns = int(self.stamps_ns[index + 1] - self.stamps_ns[index])
        return int(self.stamps_ns[index]) + round((frame - index) * gap_ns)

    def frames_per_second(self, stamp_ns: int) -> float:
        """Frame rate in the gap that ends at or holds `stamp_ns`, 1/s."""
        after = int(np.searchsorted(self.stamps_ns, stamp_ns, side="left"))
        gap_ns = int(self.stamps_ns[after] - self.stamps_ns[after - 1]) if 0 < after < len(self) else 0
        return NS_PER_S / (gap_ns or self.period_ns)

    def before(self, stamp_ns: int, lag: Timing) -> int:
        """The stamp that lies `lag` before `stamp_ns`, ns."""
        if lag.unit == "s":
            return stamp_ns - round(lag.value * NS_PER_S)
        return self.stamp_at(self.frame_at(stamp_ns) - lag.value)

    def frame_number(self, moment: Timing) -> int:
        """The first frame at or after a moment; may lie past the end."""
        if moment.unit == "frame":
            return int(moment.value)
        return int(np.searchsorted(self.stamps_ns, self.stamps_ns[0] + round(moment.value * NS_PER_S)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Where an attack acts: from ``start_frame`` to ``stop_frame``, from ``start_ns`` to ``end_ns``.

    Both ends are exclusive; ``end_ns`` is None where the attack lasts to the end of the recording.

    Examples
    --------
    >>> span = Span(start_frame=1, stop_frame=2, start_ns=100, end_ns=200)
    >>> [span.holds(stamp) for stamp in (99, 100, 199, 200)]
    [False, True, True, False]
    """

    start_frame: int
    stop_frame: int
    start_ns: int
    end_ns: int | None

    def holds(self, stamp_ns: int) -> bool:
        """Whether a message stamped `stamp_ns` is attacked."""
        return self.start_ns <= stamp_ns and (self.end_ns is None or stamp_ns < self.end_ns)
