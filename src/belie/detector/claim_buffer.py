"""Claims, kept by their stamps, so that each can be asked for at the time of an image.

Streams run at their own rates, arrive late, each by its own delay, and out of order: what counts is the header
stamp. A claim that is asked for between two of its messages is interpolated; just past the last message it is
extrapolated, by at most one period of the stream (never of one longer than `LONGEST_GAP_NS`); further away there is no
answer, and never a guess.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Sequence
from operator import attrgetter
from typing import Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, FloatArray, so3_exp
from belie.types import MotionClaim

_KEPT_NS = 3_000_000_000
_KEPT = 20  # messages more, so that those before a long gap are still there after it
LONGEST_GAP_NS = 150_000_000  # between two messages: a vehicle's turn bends more than noise over longer ones


class _Stamped(Protocol):
    @property
    def stamp_ns(self) -> int: ...


_Claim = TypeVar("_Claim", bound=_Stamped)
_by_stamp = attrgetter("stamp_ns")


class ClaimBuffer(Generic[_Claim]):
    """The last seconds of one stream, sorted by stamp; a repeated stamp replaces the older message."""

    def __init__(self, longest_gap_ns: int = LONGEST_GAP_NS) -> None:
        self.longest_gap_ns = longest_gap_ns
        self._claims: list[_Claim] = []

    def __len__(self) -> int:
        return len(self._claims)

    def add(self, claim: _Claim) -> None:
        """Sort a claim in; what is more than three seconds older than the newest is forgotten, but for a few."""
        i = bisect_left(self._claims, claim.stamp_ns, key=_by_stamp)
        if i < len(self._claims) and self._claims[i].stamp_ns == claim.stamp_ns:
            self._claims[i] = claim
        else:
            insort(self._claims, claim, key=_by_stamp)
        oldest = self._claims[-1].stamp_ns - _KEPT_NS
        if self._claims[0].stamp_ns < oldest:
            del self._claims[: max(bisect_left(self._claims, oldest, key=_by_stamp) - _KEPT, 0)]

    def newest(self) -> _Claim | None:
        """The message with the latest stamp, or None."""
        return self._claims[-1] if self._claims else None

    def period_ns(self) -> int | None:
        """The usual time (median) from one message to the next, or None."""
        stamps = [claim.stamp_ns for claim in self._claims]
        return int(np.median(np.diff(stamps))) if len(stamps) > 1 else None

    def around(self, stamp_ns: int) -> tuple[_Claim, _Claim] | None:
        """The two neighbouring messages to interpolate or extrapolate from, or None."""
        claims = self._claims
        i = bisect_left(claims, stamp_ns, key=_by_stamp)
        if i < len(claims) and claims[i].stamp_ns == stamp_ns:
            return claims[i], claims[i]
        if i == 0 or len(claims) < 2:
            return None
        if i == len(claims):
            before, after = claims[-2], claims[-1]
            period_ns = after.stamp_ns - before.stamp_ns
            if stamp_ns - after.stamp_ns > period_ns or period_ns > LONGEST_GAP_NS:
                return None
        else:
            before, after = claims[i - 1], claims[i]
        return (before, after) if after.stamp_ns - before.stamp_ns <= self.longest_gap_ns else None

    def between(self, start_ns: int, stop_ns: int) -> list[_Claim]:
        """The messages needed to integrate from `start_ns` to `stop_ns`: the last before, and all up to it."""
        i = max(0, bisect_right(self._claims, start_ns, key=_by_stamp) - 1)
        return self._claims[i : bisect_right(self._claims, stop_ns, key=_by_stamp)]

    def after(self, stamp_ns: int) -> _Claim | None:
        """The first message later than `stamp_ns`, or None."""
        i = bisect_right(self._claims, stamp_ns, key=_by_stamp)
        return self._claims[i] if i < len(self._claims) else None


class StampedPose(Protocol):
    """Anything with a stamp and a pose."""

    @property
    def stamp_ns(self) -> int:
        """Nanoseconds."""
        ...

    @property
    def T_odom_body(self) -> SE3:
        """Maps body to odom coordinates."""
        ...


_Pose = TypeVar("_Pose", bound=StampedPose)


def pose_at(buffer: ClaimBuffer[_Pose], stamp_ns: int) -> SE3 | None:
    """``T_odom_body`` at `stamp_ns`, or None where the stream does not reach."""
    pair = buffer.around(stamp_ns)
    if pair is None:
        return None
    before, after = pair
    if before is after:
        return before.T_odom_body
    fraction = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
    return before.T_odom_body.interpolate(after.T_odom_body, fraction)


def motion_between(
    buffer: ClaimBuffer[MotionClaim], start_ns: int, stop_ns: int
) -> tuple[FloatArray, FloatArray | None] | None:
    """Rotation (3, 3) and translation (3,) of the body from `start_ns` to `stop_ns`, by integrating rates.

    The translation is None where the stream has no velocity. None if the stream does not cover the interval.

    Examples
    --------
    >>> buffer = ClaimBuffer[MotionClaim]()
    >>> for i in range(11):
    ...     buffer.add(MotionClaim(source="/imu", kind="imu", stamp_ns=i * 10**7, received_ns=0,
    ...                            angular_rad_s=np.array([0.0, 0.0, 1.0])))
    >>> R, t = motion_between(buffer, 0, 10**8)
    >>> round(float(np.arcsin(R[1, 0])), 6), t
    (0.1, None)
    """
    samples = buffer.between(start_ns, stop_ns)
    following = buffer.after(stop_ns)
    used = samples if following is None else [*samples, following]
    periods = np.diff([sample.stamp_ns for sample in used])
    if (
        not samples
        or samples[0].stamp_ns > start_ns
        or not len(periods)
        or periods.max() > buffer.longest_gap_ns
    ):
        return None
    if following is None:
        period_ns = float(np.median(periods))
        if stop_ns - samples[-1].stamp_ns > (1.5 * period_ns if period_ns <= LONGEST_GAP_NS else 0.0):
            return None
    if any(s.angular_rad_s is None for s in samples):
        return None
    has_velocity = all(s.linear_m_s is not None for s in samples)
    begins = np.array([max(sample.stamp_ns, start_ns) for sample in samples])
    ends = np.array([*(sample.stamp_ns for sample in samples[1:]), stop_ns])
    steps_s = (np.minimum(ends, stop_ns) - begins) * 1e-9
    neighbours = used[1:] if len(used) > len(samples) else [*used[1:], samples[-1]]
    middles_ns = (begins + np.minimum(ends, stop_ns)) // 2
    turns = _at(samples, neighbours, "angular_rad_s", middles_ns) * steps_s[:, None]
    velocities = _at(samples, neighbours, "linear_m_s", middles_ns) if has_velocity else None
    R, t = np.eye(3), np.zeros(3)
    for i in np.flatnonzero(steps_s > 0.0):
        if velocities is not None:
            t = t + R @ so3_exp(0.5 * turns[i]) @ velocities[i] * steps_s[i]
        R = R @ so3_exp(turns[i])
    return R, (t if has_velocity else None)


def _at(
    firsts: Sequence[MotionClaim], seconds: Sequence[MotionClaim], name: str, stamps_ns: npt.NDArray[np.int64]
) -> FloatArray:
    """A rate, (N, 3), at stamps between or little after two messages each, taken as linear in time."""
    a = np.array([getattr(first, name) for first in firsts])
    others = [getattr(second, name) for second in seconds]
    b = np.array([x if y is None else y for x, y in zip(a, others, strict=True)])
    since = np.array([first.stamp_ns for first in firsts])
    span = np.array([second.stamp_ns for second in seconds]) - since
    fraction = np.clip((stamps_ns - since) / np.maximum(span, 1), 0.0, 1.5) * (span > 0)
    return np.asarray(a + fraction[:, None] * (b - a))
