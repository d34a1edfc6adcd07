"""How a detector errs when nobody attacks it: how often it misses or misnames an object, and for how long.

Both are two-state Markov chains: an error begins with probability p a message and goes on with probability q. They
are learned from errors that ended by themselves, as far as those were more likely honest than not; what was accused is
never learned from. Counts of the stream are the prior of each object's own, so that an object that flickers (small,
foggy) is given its own patience.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import TypeVar

from belie.geometry import FloatArray

_Px = TypeVar("_Px", float, FloatArray)

_LEAST = 0.02  # no detector is trusted to be better, however long it has been
_MOST = 0.97
_STEEPNESS = 4.0
_ACQUITS = 7.0  # nats under the threshold, where an accusation ends: two messages without error
# Share of messages in which a lie fails. As rare as the misses of the best detector: so an object that is told of
# every other time is never accused. The sum still grows with a patch that fails in one message of ten.
_LAPSE = _LEAST
_HONEST = 0.5  # odds: sizes are not learned of what was as likely a lie
_LONGEST = 1000  # messages of a run that is asked for
_KEPT = 4000  # messages after one in error, by size


@dataclass(slots=True)
class Counts:
    """Messages without error, errors begun, messages in which an error went on, errors whose end nobody saw."""

    right: float = 0.0
    begun: float = 0.0
    lasted: float = 0.0
    cut: float = 0.0

    @property
    def wrong(self) -> float:
        """Messages in error."""
        return self.begun + self.lasted

    @property
    def chances(self) -> float:
        """Messages after one in error: it went on, or ended. Who left in error had one less (a censored run)."""
        return self.wrong - self.cut

    def add(self, other: Counts, weight: float = 1.0) -> None:
        """Take over what was seen besides.

        >>> counts = Counts(right=8.0)
        >>> counts.add(Counts(begun=1.0, lasted=3.0, cut=1.0))
        >>> counts.wrong, counts.chances
        (4.0, 3.0)
        """
        self.right += weight * other.right
        self.begun += weight * other.begun
        self.lasted += weight * other.lasted
        self.cut += weight * other.cut


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
    object_messages, object_gaps : float
        What the stream weighs for an object of it.
    half_seen_px : float
        Side at which every second error lasts.

    Examples
    --------
    >>> habit = Habit(rate=0.05, persistence_s=0.02, prior_messages=40, prior_gaps=10)
    >>> own = Counts()
    >>> [round(habit.wrong(own, error, 0.1), 1) for error in (False, True)]  # a first miss, and one more
    [3.0, 2.9]
    >>> [round(habit.right(own, error, 0.1), 1) for error in (False, True)]
    [-3.9, -3.9]
    >>> for _ in range(30):
    ...     habit.learn(own, Counts(begun=1, lasted=7, right=1))  # it flickers
    >>> habit.wrong(own, True, 0.1) < 0.5
    True
    """

    rate: float
    persistence_s: float
    prior_messages: float
    prior_gaps: float
    half_seen_px: float = 20.0
    object_messages: float = 20.0
    object_gaps: float = 5.0
    stream: Counts = field(default_factory=Counts)
    steps: deque[tuple[float, bool]] = field(default_factory=lambda: deque(maxlen=_KEPT))  # side px, went on

    def learn(self, own: Counts, seen: Counts) -> None:
        """Take over what was seen of an object."""
        self.stream.add(seen)
        own.add(seen)

    def learn_right(self, own: Counts) -> None:
        """One message without error, that no doubt preceded."""
        self.stream.right += 1.0
        own.right += 1.0

    def wrong(
        self, own: Counts, after_error: bool, interval_s: float, side_px: float = 1e3, covered: float = 0.0
    ) -> float:
        """Log-likelihood ratio, nats, of an attack by a message in error, after one in error or a right one.

        `side_px` of the object: what is hard to see because it is small stays hard to see. `covered`: probability that
        it is missed because others cover it.
        """
        return math.log((1.0 - _LAPSE) / self._errs(own, after_error, interval_s, side_px, covered))

    def right(self, own: Counts, after_error: bool, interval_s: float, side_px: float = 1e3) -> float:
        """Log-likelihood ratio, nats, of an attack by a message without error; never speaks for one."""
        return min(math.log(_LAPSE / (1.0 - self._errs(own, after_error, interval_s, side_px, 0.0))), 0.0)

    def _errs(
        self, own: Counts, after_error: bool, interval_s: float, side_px: float, covered: float
    ) -> float:
        hard, itself = 0.0, self._begins(own)
        if after_error:
            hard = lasts_of_small(side_px, self.half_seen_px)
            itself = self._lasts(own, interval_s)
        return min(1.0 - (1.0 - itself) * (1.0 - hard) * (1.0 - covered), _MOST)

    def shortest_run(self, interval_s: float, threshold: float) -> int:
        """Messages in error in a row that accuse a large object of which nothing is known yet; at most 1000.

        >>> Habit(rate=0.05, persistence_s=0.02, prior_messages=40, prior_gaps=10).shortest_run(0.1, 14.0)
        5
        """
        own = Counts()
        statistic, each = self.wrong(own, False, interval_s), self.wrong(own, True, interval_s)
        messages = 1
        while statistic < threshold and messages < _LONGEST:
            statistic, messages = max(statistic + each, 0.0), messages + 1
        return messages

    def share(self) -> float:
        """Share of the messages about objects that err, by the stream and what was expected of it."""
        s, n = self.stream, self.prior_messages
        return (s.wrong + n * self.rate) / (s.wrong + s.right + n)

    def memory_s(self, interval_s: float) -> float:
        """For how long consecutive images share the cause of an error, by the stream; its `persistence_s`."""
        s, n, share = self.stream, self.prior_gaps, self.share()
        expected = self.rate + (1.0 - self.rate) * math.exp(-interval_s / self.persistence_s)
        lasts = (s.lasted + n * expected) / (s.chances + n)
        correlation = (lasts - share) / (1.0 - share)
        # Below, consecutive images share nothing; above, the time is longer than the recordings show.
        return -interval_s / math.log(min(max(correlation, 1e-3), _MOST))

    def _begins(self, own: Counts) -> float:
        s, n = self.stream, self.prior_messages
        stream = (s.begun + n * self.rate) / (s.begun + s.right + n)
        m = self.object_messages
        begins = (own.begun + m * stream) / (own.begun + own.right + m)
        # What was expected of it needs no proof: a detector may be stated to be better than the least.
        return min(max(begins, min(_LEAST, self.rate)), _MOST)

    def _lasts(self, own: Counts, interval_s: float) -> float:
        expected = self.rate + (1.0 - self.rate) * math.exp(-interval_s / self.persistence_s)
        s, n = self.stream, self.prior_gaps
        stream = (s.lasted + n * expected) / (s.chances + n)
        m = self.object_gaps
        return _bounded((own.lasted + m * stream) / (own.chances + m))


def _bounded(share: float) -> float:
    return min(max(share, _LEAST), _MOST)


@dataclass(slots=True)
class ErrorTest:
    """Whether an object is told of wrongly more often than the detector's habit explains.

    Page's test (Biometrika 41, 1954): each message adds its log-likelihood ratio for a lie that fails now and then,
    against the habit; the sum never falls below 0. So a patch that fails in one message of ten is found over
    several runs, though no single run tells. The sum crosses `threshold` by chance once in the stated time:
    ``threshold = log(opportunities per hour / false alarms per hour)`` (Lorden, Annals of Mathematical Statistics 42,
    1971: Markov's inequality for a likelihood ratio with mean one, over every start). Since the prior odds of a lie are
    ``exp(-threshold)``, those after an excursion are ``exp(peak - threshold)``, by which it is learned when it is over.

    Examples
    --------
    >>> habit = Habit(rate=0.05, persistence_s=0.02, prior_messages=40, prior_gaps=10)
    >>> test = ErrorTest(habit)
    >>> [test.wrong(0.1, 14.0, i) for i in range(5)]
    [False, False, False, False, True]
    >>> patched = ErrorTest(habit)
    >>> told = [patched.right(0.1) if i == 3 else patched.wrong(0.1, 14.0, i) for i in range(8)]
    >>> patched.accused, patched.errors, patched.messages
    (True, 7, 8)
    """

    habit: Habit
    own: Counts = field(default_factory=Counts)
    length: int = 0  # consecutive errors up to now
    errors: int = 0  # of the excursion
    messages: int = 0
    statistic: float = 0.0
    peak: float = 0.0
    threshold: float = math.inf  # the latest
    onset_ns: int = 0
    accused: bool = False
    _seen: Counts = field(default_factory=Counts)  # in this excursion, not learned yet
    _steps: deque[tuple[float, bool]] = field(default_factory=lambda: deque(maxlen=_KEPT))  # as `Habit.steps`

    def right(self, interval_s: float, side_px: float = 1e3) -> None:
        """A message without error."""
        if self.errors == 0:
            self.habit.learn_right(self.own)
            return
        self.statistic += self.habit.right(self.own, self.length > 0, interval_s, side_px)
        if self.length:
            self._steps.append((side_px, False))
        self.length = 0
        self._seen.right += 1.0
        self.messages += 1
        if self.accused and self.statistic < self.threshold - _ACQUITS:
            self.excuse()
        elif self.statistic <= 0.0:
            self.conclude()

    def wrong(
        self,
        interval_s: float,
        threshold: float,
        stamp_ns: int,
        side_px: float = 1e3,
        *,
        covered: float = 0.0,
        vouched: bool = True,
    ) -> bool:
        """A message in error, though the pixels tell otherwise; True once it is accused.

        `covered`: probability that it is missed because others cover it; `vouched`: the pixels are sure; nobody is
        accused before.
        """
        if self.errors == 0:
            self.onset_ns = stamp_ns
        told = self.habit.wrong(self.own, self.length > 0, interval_s, side_px, covered)
        self.statistic = max(self.statistic + told, 0.0)
        if self.length:
            self._seen.lasted += 1.0
            self._steps.append((side_px, True))
        else:
            self._seen.begun += 1.0
        self.length, self.errors, self.messages = self.length + 1, self.errors + 1, self.messages + 1
        self.peak, self.threshold = max(self.peak, self.statistic), threshold
        self.accused = self.accused or (vouched and self.statistic >= threshold)
        self.statistic = min(self.statistic, threshold)  # so that it can end soon
        return self.accused

    def steps(self, interval_s: float, side_px: float = 1e3) -> tuple[float, float]:
        """What a first message in error would tell, and every further one, nats.

        >>> test = ErrorTest(Habit(rate=0.05, persistence_s=0.02, prior_messages=40, prior_gaps=10))
        >>> [round(nats, 1) for nats in test.steps(0.1)]
        [3.0, 2.9]
        """
        first, each = (self.habit.wrong(self.own, after, interval_s, side_px) for after in (False, True))
        return first, each

    @property
    def is_open(self) -> bool:
        """Whether there is evidence enough to accuse, but nobody has vouched for the object."""
        return not self.accused and self.statistic >= self.threshold

    def unlearned(self, doubtful: int = 0) -> tuple[Counts, tuple[tuple[float, bool], ...]]:
        """What the excursion teaches as far as it has come, if it is honest: counts, and steps as `Habit.steps`.

        Errors that have not ended lasted at least so long (a censored run). `doubtful`: how many of the last ones may
        have another cause than the detector's habit. Nothing, of what is accused.
        """
        if self.accused or self.errors == 0:
            return Counts(), ()
        weight = 1.0 / (1.0 + math.exp(min(self.peak - self.threshold, 50.0)))
        sure = max(self.length - doubtful, 0)
        first = 1 if self.length and not sure else 0  # even the first one of the last run is doubtful
        lasted = self.length - sure - first
        seen = Counts()
        seen.add(self._seen, weight)
        seen.add(Counts(begun=-first, lasted=-lasted, cut=1.0 if sure else 0.0), weight)
        steps = tuple(self._steps) if weight > _HONEST else ()
        return seen, steps[: max(len(steps) - lasted, 0)]

    def conclude(self, doubtful: int = 0) -> None:
        """No more will be told of this excursion: learn it, by the probability that nobody lied; see `unlearned`.

        >>> habit = Habit(rate=0.05, persistence_s=0.02, prior_messages=40, prior_gaps=10)
        >>> test = ErrorTest(habit)
        >>> for i in range(3):
        ...     told = test.wrong(0.1, 14.0, i)
        >>> test.conclude()  # it has left
        >>> round(habit.stream.begun, 1), round(habit.stream.lasted, 1), round(habit.stream.chances, 1)
        (1.0, 2.0, 2.0)
        """
        seen, steps = self.unlearned(doubtful)
        self.habit.learn(self.own, seen)
        self.habit.steps.extend(steps)
        self.excuse()

    def excuse(self) -> None:
        """The pixels cannot tell (any more): whatever was found ends without a verdict, and nothing is learned."""
        self.length, self.errors, self.messages, self.statistic, self.peak = 0, 0, 0, 0.0, 0.0
        self.accused, self._seen = False, Counts()
        self._steps.clear()


def lasts_of_small(side_px: float, half_seen_px: _Px) -> _Px:
    """Share of misses that go on because the object is small (root of its area, px), for one `half_seen_px` or many.

    >>> import numpy as np
    >>> lasts_of_small(20.0, 20.0), lasts_of_small(40.0, np.array([20.0, 40.0])).round(2).tolist()
    (0.5, [0.06, 0.5])
    """
    steep: _Px = (side_px / half_seen_px) ** _STEEPNESS
    return 1.0 / (1.0 + steep)


def run_threshold(false_alarms_per_hour: float, messages_per_hour: float, share: float) -> float:
    """Threshold of an `ErrorTest`, nats, for an object that is given a share of the stream's false alarms.

    >>> round(run_threshold(0.1, 36000, 1 / 3), 1)
    13.9
    """
    return math.log(max(messages_per_hour / (false_alarms_per_hour * share), math.e))
