"""Has this image been shown before? Exactly, over the whole run, and nearly, over the last minute.

An honest camera may come back to a place, even at the same phase of its motion; then the image before was
like the image before the old one, too. A replay *enters* the old sequence: the image is the old one, the one
before is not. Matches must be far closer than the old sequence's own steps from frame to frame: re-encoding
leaves 0.01 to 0.11 of such a step, while the nearest honest image of real drives is 0.9 of a step away.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from belie.checks.image_signature import FloatCells, ImageSignature, pattern_distance
from belie.geometry import compiled

_PROJECTED = (
    96  # dimensions of the sketch that is searched; keeps distances to about 7 % (Johnson-Lindenstrauss)
)
_VERIFIED = 3  # nearest sketches that are compared in full
_AHEAD = 6  # frames by which a replayed sequence may advance at a time: some of it may be dropped


@dataclass(frozen=True, slots=True, kw_only=True)
class OldImage:
    """An older image that the present one repeats.

    Parameters
    ----------
    index : int
        Running number of the image when it was first shown.
    path_px : float
        How far the claims had moved the image by then.
    """

    index: int
    path_px: float


class ExactMemory:
    """The digests of the last `capacity` different images.

    Examples
    --------
    >>> memory = ExactMemory(2)
    >>> for index in range(3): memory.add(10 + index, OldImage(index=index, path_px=0.0))
    >>> memory.find(10) is None, memory.find(12).index
    (True, 2)
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._seen: dict[int, OldImage] = {}

    def find(self, digest: int) -> OldImage | None:
        """When this image was first shown, or None."""
        return self._seen.get(digest)

    def add(self, digest: int, image: OldImage) -> None:
        """Remember a new image, and forget the oldest where there are too many."""
        self._seen.setdefault(digest, image)
        if len(self._seen) > self._capacity:
            del self._seen[next(iter(self._seen))]


class NearMemory:
    """The patterns of the images of the last while, to be found again after re-encoding.

    Parameters
    ----------
    capacity : int
        Most images held.
    span_ns : int
        How long one is held.
    match_ratio : float
        A match is nearer than this share of the old sequence's own step.
    least_lag : int
        Neighbours in time are alike, and no evidence: matches lie at least so many images back.
    """

    def __init__(self, *, capacity: int, span_ns: int, match_ratio: float, least_lag: int) -> None:
        self._span_ns, self._match_ratio, self._least_lag = span_ns, match_ratio, least_lag
        self._sketcher: FloatCells | None = None
        self._patterns = np.empty((capacity, 0), dtype=np.float32)
        self._sketches = np.empty((capacity, _PROJECTED), dtype=np.float32)
        self._steps = np.empty(capacity)  # distance to the image before; infinite where that was not added
        self._stamps_ns = np.empty(capacity, dtype=np.int64)
        self._paths_px = np.empty(capacity)
        self._count = 0
        self._last_index = -2

    def add(self, signature: ImageSignature, index: int, stamp_ns: int, path_px: float) -> None:
        """Remember an honest image; `index` counts all images shown."""
        pattern = signature.pattern
        slot, before = self._slot(self._count), self._slot(self._count - 1)
        if self._sketcher is None:
            rng = np.random.default_rng(0)
            shape = (_PROJECTED, len(pattern))
            self._sketcher = np.asarray(rng.normal(size=shape) / np.sqrt(_PROJECTED), dtype=np.float32)
            self._patterns = np.empty((len(self._patterns), len(pattern)), dtype=np.float32)
        follows = index == self._last_index + 1
        self._steps[slot] = pattern_distance(pattern, self._patterns[before]) if follows else np.inf
        self._patterns[slot], self._sketches[slot] = pattern, _times(self._sketcher, pattern)
        self._stamps_ns[slot], self._paths_px[slot] = stamp_ns, path_px
        self._last_index, self._count = index, self._count + 1

    def enter(self, signature: ImageSignature, before: ImageSignature, stamp_ns: int) -> OldImage | None:
        """The old image that is shown again, unless the image before it was shown again before it, too."""
        if self._sketcher is None:
            return None
        first = max(1, self._count - len(self._sketches) + 1)
        sketch = _times(self._sketcher, signature.pattern)
        last = self._count - self._least_lag
        oldest_ns = stamp_ns - self._span_ns
        for number in _nearest(self._sketches, sketch, self._stamps_ns, oldest_ns, first, last).tolist():
            if number < 0:
                break
            ratio = self._ratio(signature, number)
            if ratio < self._match_ratio and self._entered(before, number):
                return self._old(number)
        return None

    def follow(self, signature: ImageSignature, last: OldImage) -> OldImage | None:
        """The next image of an old sequence, forwards or backwards, that was last seen at `last`."""
        oldest = max(0, self._count - len(self._sketches))
        near = [last.index + d for k in range(1, _AHEAD + 1) for d in (k, -k)]
        ratios = {n: self._ratio(signature, n) for n in near if oldest <= n < self._count}
        best = min(ratios, key=ratios.__getitem__, default=-1)
        return self._old(best) if best >= 0 and ratios[best] < self._match_ratio else None

    def _slot(self, number: int) -> int:
        return number % len(self._sketches)

    def _old(self, number: int) -> OldImage:
        return OldImage(index=number, path_px=float(self._paths_px[self._slot(number)]))

    def _ratio(self, signature: ImageSignature, number: int) -> float:
        """Distance to an old image over the old sequence's step there; infinite where that is unknown."""
        steps = [float(self._steps[self._slot(n)]) for n in (number, number + 1) if n < self._count]
        step = min(steps)
        if not np.isfinite(step) or step <= 0.0:
            return float("inf")
        return pattern_distance(signature.pattern, self._patterns[self._slot(number)]) / step

    def _entered(self, before: ImageSignature, number: int) -> bool:
        """Whether the image before was off the old sequence: about a step from where it should have been."""
        old_before = self._patterns[self._slot(number - 1)]
        return pattern_distance(before.pattern, old_before) > 0.8 * float(self._steps[self._slot(number)])


# BLAS would do, but starts threads for it: milliseconds where all cores are taken.


@compiled(reassociate=True)
def _times(matrix: Any, vector: Any) -> Any:
    rows, columns = matrix.shape
    product = np.empty(rows, dtype=np.float32)
    for i in range(rows):
        total = np.float32(0.0)
        row = matrix[i]
        for j in range(columns):
            total += row[j] * vector[j]
        product[i] = total
    return product


@compiled(reassociate=True)
def _nearest(sketches: Any, sketch: Any, stamps_ns: Any, oldest_ns: int, first: int, last: int) -> Any:
    """The numbers in first..last of the nearest sketches, nearest first; -1 where there are too few."""
    capacity, columns = sketches.shape
    numbers = np.empty(_VERIFIED, dtype=np.int64)
    distances2 = np.empty(_VERIFIED, dtype=np.float32)
    for k in range(_VERIFIED):
        numbers[k] = -1
        distances2[k] = np.inf
    for number in range(first, last + 1):
        slot = number % capacity
        if stamps_ns[slot] < oldest_ns:
            continue
        row = sketches[slot]
        total = np.float32(0.0)
        for j in range(columns):
            difference = row[j] - sketch[j]
            total += difference * difference
        place = _VERIFIED
        while place > 0 and total < distances2[place - 1]:
            place -= 1
        for k in range(_VERIFIED - 1, place, -1):
            distances2[k], numbers[k] = distances2[k - 1], numbers[k - 1]
        if place < _VERIFIED:
            distances2[place], numbers[place] = total, number
    return numbers
