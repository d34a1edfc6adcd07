"""Whether a detector's boxes are about the frames that they are told for: a file may count its frames otherwise.

Boxes that are told some frames late move from message to message as the pixels in them moved so much earlier. How the
pixels of an object moved is known without the box of the moment, so the delay with which both agree best can be told,
as long as objects do not move evenly: those that pass a driving camera do not.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from belie.detector import ObjectView
from belie.geometry import FloatArray

_MOST_FRAMES = 12  # that are tried, late or early
_MOST_STEPS = 16_000  # told and seen, of all objects together: what comes later tells nothing new
_LEAST_STEPS = 60
_LEAST_OBJECTS = 3
_LEAST_CORNERS = 14  # fewer leave the box to the detections, or follow what is behind it
_CORRECTION = 0.5  # of what a message says is taken over by the box that is followed (`ObjectTrack.detect`)
_BORDER_PX = 2.0  # an edge nearer to the image's is cut off there
_SURE = 4.0  # standard deviations: by chance one of 24 delays comes so far in one recording of a thousand


@dataclass(slots=True)
class _Steps:
    """How the middle of one object moved to each frame, px: as the detector tells, and by its pixels."""

    told: dict[int, FloatArray] = field(default_factory=dict)
    seen: dict[int, FloatArray] = field(default_factory=dict)
    told_last: tuple[int, FloatArray] | None = None  # frame and middle of the last box
    from_px: tuple[int, FloatArray] | None = None  # frame, and from where the next one's pixels carry the box

    def lateness(self, late: int) -> tuple[int, int]:
        """In how many steps the pixels of `late` frames before fit better than those of the same frame; of how many."""
        frames = [k for k in self.told if k in self.seen and k - late in self.seen]
        if not frames:
            return 0, 0
        told, now, then = (
            np.array(steps)
            for steps in zip(
                *((self.told[k], self.seen[k], self.seen[k - late]) for k in frames), strict=True
            )
        )
        better = np.abs(told - then).sum(axis=1) < np.abs(told - now).sum(axis=1)
        return int(better.sum()), len(frames)


class BoxTiming:
    """Collects how the boxes of one detector move, and how the pixels in them do.

    Examples
    --------
    >>> BoxTiming().late_frames()
    0
    """

    def __init__(self) -> None:
        self._objects: dict[int, _Steps] = {}
        self._frames = 0
        self._stamps_ns: deque[int] = deque(maxlen=_MOST_FRAMES)  # of the last frames
        self._count = 0

    def see(self, views: Iterable[ObjectView], size: tuple[int, int], stamp_ns: int) -> None:
        """Take in the detector's objects after a frame of (width, height)."""
        if self._count >= _MOST_STEPS:
            return
        self._stamps_ns.append(stamp_ns)
        self._frames += 1
        for view in views:
            steps = self._objects.setdefault(view.number, _Steps())
            frame = None if view.detected_px is None else self._frame_of(view.told_ns)
            self._follow(steps, view, frame)
            if view.detected_px is not None and frame is not None:
                self._hear(steps, view.detected_px, frame, size)

    def late_frames(self) -> int:
        """By how many frames the boxes are told late (negative: early); 0 where they are not, or it cannot be told.

        The sign test: were they in time, a step of the box would fit the pixels' of another frame by chance at best.
        """
        sure = {late: self._sureness(late) for late in range(-_MOST_FRAMES, _MOST_FRAMES + 1) if late}
        best = max(sure, key=lambda late: sure[late])
        return best if sure[best] >= _SURE else 0

    def _sureness(self, late: int) -> float:
        """How many standard deviations more steps than half speak for a delay."""
        found = [pair for one in self._objects.values() if (pair := one.lateness(late))[1]]
        better, steps = sum(pair[0] for pair in found), sum(pair[1] for pair in found)
        if steps < _LEAST_STEPS or len(found) < _LEAST_OBJECTS:
            return -math.inf
        return (2 * better - steps) / math.sqrt(steps)

    def _follow(self, steps: _Steps, view: ObjectView, told_frame: int | None) -> None:
        now, middle = self._frames, _middle(view.box_px)
        if (
            steps.from_px is not None
            and steps.from_px[0] == now - 1
            and len(view.observed_px) >= _LEAST_CORNERS
        ):
            steps.seen[now] = middle - steps.from_px[1]
            self._count += 1
        if view.detected_px is None:
            steps.from_px = now, middle
        elif told_frame == now:
            steps.from_px = now, middle + _CORRECTION * (_middle(view.detected_px) - middle)
        else:  # it was held against where the object was then
            steps.from_px = None

    def _hear(self, steps: _Steps, box_px: FloatArray, frame: int, size: tuple[int, int]) -> None:
        left, top, right, bottom = box_px.tolist()
        if min(left, top, size[0] - right, size[1] - bottom) < _BORDER_PX:
            steps.told_last = None
            return
        middle = _middle(box_px)
        if steps.told_last is not None and steps.told_last[0] == frame - 1:
            steps.told[frame] = middle - steps.told_last[1]
            self._count += 1
        steps.told_last = frame, middle

    def _frame_of(self, stamp_ns: int) -> int:
        """The number of the frame nearest to a stamp, of the last ones."""
        known = len(self._stamps_ns)
        nearest = min(range(known), key=lambda k: abs(self._stamps_ns[k] - stamp_ns))
        return self._frames - known + 1 + nearest


def _middle(box_px: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (box_px[:2] + box_px[2:]))
