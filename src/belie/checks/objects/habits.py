"""How a detector errs when nobody attacks it: how often it misses or misnames an object, and for how long.

Both are two-state Markov chains: an error begins with probability p a message and goes on with probability q. They
are learned from the errors that ended by themselves; what was accused is never learned from. Counts of the stream
are the prior of each object's own, so that an object that flickers (small, foggy) is given its own patience.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

_LEAST = 0.02  # no detector is trusted to be better, however long it has been
_MOST = 0.97
_STEEPNESS = 4.0
_OBJECT_WEIGHT = 0.5  # of the stream's prior, for the object's own


@dataclass(slots=True)
class Counts:
    """Messages without error, errors begun, messages in which an error went on."""

    right: float = 0.0
    begun: float = 0.0
    lasted: float = 0.0


@dataclass(slots=True)
class Habit:
    """One kind of error of one stream.

    Parameters
    ----------
    rate : float
        Expected share of messages in error.
    persistence_s : float
        How long consecutive images share the cause.
    prior_messages, prior_gaps : float
        What the expectation weighs.
    half_seen_px : float
        Side at which every second error lasts.

    Examples
    --------
    >>> habit = Habit(rate=0.05, persistence_s=0.02, prior_messages=40, prior_gaps=10)
    >>> own = Counts()
    >>> round(habit.surprise(own, 0, 0.1), 1), round(habit.surprise(own, 1, 0.1), 1)
    (3.0, 2.9)
    >>> for _ in range(30):
    ...     habit.ended(own, 8)  # it flickers
    >>> habit.surprise(own, 1, 0.1) < 0.5
    True
    """

    rate: float
    persistence_s: float
    prior_messages: float
    prior_gaps: float
    half_seen_px: float = 20.0
    stream: Counts = field(default_factory=Counts)

    def right(self, own: Counts) -> None:
        """A message without error about an object."""
        self.stream.right += 1.0
        own.right += 1.0

    def ended(self, own: Counts, length: int) -> None:
        """An error that lasted `length` messages has ended by itself."""
        for counts in (self.stream, own):
            counts.begun += 1.0
            counts.lasted += length - 1.0

    def surprise(self, own: Counts, position: int, interval_s: float, side_px: float = 1e3) -> float:
        """Log-likelihood ratio, nats, that the error number `position` (from 0) of a run adds for an attack.

        `side_px` of the object: what is hard to see because it is small stays hard to see.
        """
        if position == 0:
            return -math.log(self._begins(own))
        hard = 1.0 / (1.0 + (side_px / self.half_seen_px) ** _STEEPNESS)
        lasts = self._lasts(own, interval_s)
        return -math.log(_bounded(lasts + (1.0 - lasts) * hard))

    def share(self) -> float:
        """Share of the messages about objects that err, by the stream and what was expected of it."""
        s, n = self.stream, self.prior_messages
        wrong = s.begun + s.lasted
        return (wrong + n * self.rate) / (wrong + s.right + n)

    def memory_s(self, interval_s: float) -> float:
        """For how long consecutive images share the cause of an error, by the stream; its `persistence_s`."""
        s, n, share = self.stream, self.prior_gaps, self.share()
        expected = self.rate + (1.0 - self.rate) * math.exp(-interval_s / self.persistence_s)
        lasts = (s.lasted + n * expected) / (s.lasted + s.begun + n)
        correlation = (lasts - share) / (1.0 - share)
        # Below, consecutive images share nothing; above, the time is longer than the recordings show.
        return -interval_s / math.log(min(max(correlation, 1e-3), _MOST))

    def _begins(self, own: Counts) -> float:
        s, n = self.stream, self.prior_messages
        stream = (s.begun + n * self.rate) / (s.begun + s.right + n)
        m = n * _OBJECT_WEIGHT
        return _bounded((own.begun + m * stream) / (own.begun + own.right + m))

    def _lasts(self, own: Counts, interval_s: float) -> float:
        expected = self.rate + (1.0 - self.rate) * math.exp(-interval_s / self.persistence_s)
        s, n = self.stream, self.prior_gaps
        # begun gaps each had one chance to end; `lasted` chances were not taken
        stream = (s.lasted + n * expected) / (s.lasted + s.begun + n)
        m = n * _OBJECT_WEIGHT
        return _bounded((own.lasted + m * stream) / (own.lasted + own.begun + m))


def _bounded(share: float) -> float:
    return min(max(share, _LEAST), _MOST)


@dataclass(slots=True)
class RunTest:
    """Whether a run of errors of one object is longer than the detector's habit explains.

    The run's log-likelihood ratio against the habit is the statistic; it crosses `threshold` by chance once in the
    stated time: ``threshold = log(opportunities per hour / false alarms per hour)`` (Markov's inequality for a
    likelihood ratio with mean one, over every start).

    Examples
    --------
    >>> habit = Habit(rate=0.05, persistence_s=0.02, prior_messages=40, prior_gaps=10)
    >>> test = RunTest(habit)
    >>> [test.wrong(0.1, 14.0, i) for i in range(5)]
    [False, False, False, False, True]
    """

    habit: Habit
    own: Counts = field(default_factory=Counts)
    length: int = 0
    statistic: float = 0.0
    onset_ns: int = 0
    accused: bool = False

    def right(self) -> None:
        """A message without error: the run is over."""
        if self.length and not self.accused:
            self.habit.ended(self.own, self.length)
        self.habit.right(self.own)
        self.length, self.statistic, self.accused = 0, 0.0, False

    def wrong(
        self,
        interval_s: float,
        threshold: float,
        stamp_ns: int,
        side_px: float = 1e3,
        *,
        vouched: bool = True,
    ) -> bool:
        """A message in error, though the pixels tell otherwise; True once it is accused.

        `vouched`: the pixels are sure; nobody is accused before.
        """
        if self.length == 0:
            self.onset_ns = stamp_ns
        self.statistic += self.habit.surprise(self.own, self.length, interval_s, side_px)
        self.length += 1
        self.accused = self.accused or (vouched and self.statistic >= threshold)
        return self.accused

    def excuse(self) -> None:
        """The pixels cannot tell (any more): whatever was found ends without a verdict, and nothing is learned."""
        self.length, self.statistic, self.accused = 0, 0.0, False


def run_threshold(false_alarms_per_hour: float, messages_per_hour: float, objects: float) -> float:
    """Threshold of a `RunTest`, nats.

    >>> round(run_threshold(0.1, 36000, 3), 1)
    13.9
    """
    return math.log(max(messages_per_hour * max(objects, 1.0) / false_alarms_per_hour, math.e))
