"""Images that do not change although a robot is claimed to move: what is usual, what is a fault.

The change from frame to frame is compared with its median over the last frames that moved, and the
claims with theirs: an honest stop makes both fall together. Repeated frames have a rhythm (a 30 Hz camera
in a 60 Hz stream shows each image twice), so the count is taken from the usual run of repeats on.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import median

import numpy as np
from pydantic import Field

from belie.checks.image_signature import ImageSignature, change_gray
from belie.types import Settings

_LEAST_KNOWN = 4  # frames in motion before a median of them means anything


class StillnessSettings(Settings):
    """When an image counts as unchanged, and a claim as motion."""

    still_ratio: float = Field(
        0.2, gt=0.0, lt=1.0,
        description="an image is still if it changes by less than this share of what moving images did [1]; "
        "noise of 2 gray levels or JPEG coding at quality 40 reach 0.12, honest driving and hand motion stay "
        "above 0.3",
    )  # fmt: skip
    least_change_gray: float = Field(
        1.0, gt=0.0,
        description="moving images that change by less than this tell no standstill from noise [gray]; noise "
        "of 2 gray levels leaves 0.2",
    )  # fmt: skip
    moving_px: float = Field(
        1.0, gt=0.0,
        description="claimed displacement in the image that counts as motion [px a frame]; noise of honest "
        "odometry and gyroscopes at standstill stays below",
    )  # fmt: skip
    moved_px: float = Field(
        3.0,
        gt=0.0,
        description="claimed displacement that an image must show [px, added up over the repeats]",
    )
    going_on_ratio: float = Field(
        0.5, ge=0.0, le=1.0,
        description="a claim goes on if it states at least this share of the motion before the image stood "
        "still [1]; filters in honest odometry make it lag behind a stop",
    )  # fmt: skip
    memory_frames: int = Field(
        8, ge=_LEAST_KNOWN, description="frames in motion that the medians are over [count]"
    )
    repeats: int = Field(
        2, ge=1,
        description="repeats against the claims, beyond what is usual, that make a fault [count]; a lone "
        "duplicated frame happens in any real system",
    )  # fmt: skip
    repeats_at_start: int = Field(
        6, ge=1, description="the same before the rhythm of the stream is known, in its first images [count]"
    )


@dataclass(slots=True)
class Run:
    """A run of unchanged images.

    Its anchor is the image before the first repeat; `after_cut`: that one showed a new scene; `abrupt`: the
    image still moved as usual one frame before. `against`, `since_ns` and `claimed_px` tell of the claims
    that went on.
    """

    anchor: ImageSignature
    anchor_ns: int
    after_cut: bool
    abrupt: bool
    count: int = 0
    against: int = 0
    since_ns: int = 0
    claimed_px: dict[str, float] = field(default_factory=dict)
    movers: tuple[str, ...] = ()


class Stillness:
    """Counts unchanged images, and how long claims have been against them.

    Examples
    --------
    >>> from belie.checks.image_signature import image_signature
    >>> image = image_signature(np.tile(np.arange(128, dtype=np.uint8), (72, 1)))
    >>> stillness = Stillness(StillnessSettings())
    >>> for k in range(3):
    ...     unchanged = stillness.look(image, k)
    ...     stillness.compare({"/odom": 8.0}, k)
    >>> unchanged, stillness.run.against, stillness.limit
    (True, 2, 6)
    """

    def __init__(self, settings: StillnessSettings) -> None:
        self.settings = settings
        self.run: Run | None = None
        self.repeated = False
        self._last: ImageSignature | None = None
        self._last_ns = 0
        self._change = 0.0
        self._cut = False
        self._moving: deque[tuple[float, dict[str, float]]] = deque(maxlen=settings.memory_frames)
        self._runs: deque[int] = deque(maxlen=settings.memory_frames)
        self._honest_repeats = 0

    @property
    def last(self) -> ImageSignature | None:
        """The image before the one that is looked at next."""
        return self._last

    @property
    def limit(self) -> int:
        """Repeats against the claims that make a fault, at this stream's rhythm."""
        if len(self._runs) < _LEAST_KNOWN:
            return self.settings.repeats_at_start
        return sorted(self._runs)[len(self._runs) // 2] + self.settings.repeats

    @property
    def noise_free(self) -> bool:
        """Whether identical images at a claimed standstill have shown that this camera has no noise."""
        return self._honest_repeats > self.settings.repeats

    def look(self, image: ImageSignature, stamp_ns: int) -> bool:
        """Take in an image; True if it is unchanged, bit by bit or but for noise."""
        last, last_ns = self._last, self._last_ns
        self._last, self._last_ns = image, stamp_ns
        if last is None:
            return False
        self.repeated = image.digest == last.digest
        change_before, self._change = self._change, change_gray(image, last)
        if self.repeated or self._is_still(image):
            if self.run is None:
                abrupt = change_before > 0.5 * self._usual_change()
                self.run = Run(anchor=last, anchor_ns=last_ns, after_cut=self._cut, abrupt=abrupt)
            self.run.count += 1
            return True
        if self.run is None or self.run.movers:
            self._runs.append(0 if self.run is None else self.run.count)
        self.run = None
        return False

    def _is_still(self, image: ImageSignature) -> bool:
        usual = self._usual_change()
        if not self.settings.least_change_gray <= usual < np.inf:
            return False
        most = self.settings.still_ratio * usual
        return self._change < most and (self.run is None or change_gray(image, self.run.anchor) < most)

    def _usual_change(self) -> float:
        if len(self._moving) < _LEAST_KNOWN:
            return float("inf")
        return float(median([change for change, _ in self._moving]))

    def compare(
        self,
        claimed_flow_px: Mapping[str, float],
        stamp_ns: int,
        *,
        cut: bool = False,
        typical: bool = True,
    ) -> None:
        """Set the claims of the same interval against the image that was just looked at.

        `cut`: it shows another scene than the one before; `typical`: neither that, nor is either image blank.
        """
        s, run = self.settings, self.run
        self._cut = cut
        if run is None:
            if typical and max(claimed_flow_px.values(), default=s.moving_px) >= s.moving_px:
                self._moving.append((self._change, dict(claimed_flow_px)))
            return
        run.movers = tuple(name for name, flow in claimed_flow_px.items() if self._goes_on(name, flow))
        if not run.movers:
            if self.repeated and claimed_flow_px and max(claimed_flow_px.values()) < s.moving_px:
                self._honest_repeats += 1
            run.against, run.claimed_px = 0, {}
            return
        if run.against == 0:
            run.since_ns = stamp_ns
        run.against += 1
        for name in run.movers:
            run.claimed_px[name] = run.claimed_px.get(name, 0.0) + claimed_flow_px[name]

    def _goes_on(self, name: str, flow_px: float) -> bool:
        least = self.settings.moving_px
        if not self.repeated:
            before = [flows[name] for _, flows in self._moving if name in flows]
            if len(before) < _LEAST_KNOWN:
                return False
            least = max(least, self.settings.going_on_ratio * float(median(before)))
        return flow_px >= least

    @property
    def overdue(self) -> bool:
        """Whether the image has been unchanged against the claims for longer than any honest stream's."""
        run = self.run
        return (
            run is not None
            and run.against >= self.limit
            and max(run.claimed_px.values(), default=0.0) > self.settings.moved_px
        )
