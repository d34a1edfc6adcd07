"""Settings of the object checks by what a detector was seen to do when nobody attacked it.

How often it errs are shares of counts. For how long its misses last, and how small an object must be for them to last
because of that, are fitted together (maximum a posteriori, from the settings as they are). How much of it all holds for
the next drive and for each object is fitted, too: where all objects of a stream err alike, two misses of one in a row
are chance, and no habit of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.special import betaln

from belie.checks.objects import Counts, Habit, ObjectSettings, lasts_of_small
from belie.detector.object_habits import ObjectHabits
from belie.evaluation.intervals import wilson_interval
from belie.geometry import FloatArray

_TRUSTED = (
    0.5  # of what was seen holds elsewhere (a power prior; Ibrahim and Chen, Statistical Science 15, 2000)
)
_MOST_MESSAGES, _MOST_GAPS = 2000.0, 200.0  # a minute of ten objects at 10 Hz outweighs them: weather changes
_HALF_SIGMA = 0.35  # of the logarithm of `half_seen_px`, before anything is seen: detectors differ by as much
_PERSISTENCES_S = np.geomspace(0.005, 20.0, 60)
_HALVES_PX = np.geomspace(4.0, 64.0, 48)
_WEIGHTS = np.geomspace(5.0, 640.0, 29)
_MOST_SHARE = 0.97  # of messages in error: beyond, nothing is told by one
_CHANCE = 1.92  # nats: a log-likelihood that falls short by less does so by chance (chi-squared, 95 %)


def messages_of(each: Sequence[ObjectHabits]) -> float:
    """About objects that one detector should see, in all recordings."""
    return sum(habits.messages for habits in each)


def fitted(each: Sequence[ObjectHabits], prior: ObjectSettings) -> dict[str, float]:
    """Settings by what one detector was seen to do in all recordings.

    Parameters
    ----------
    each : sequence of ObjectHabits
        By recording.
    prior : ObjectSettings
        What was expected.

    Examples
    --------
    >>> seen = ObjectHabits(interval_s=0.1, missed=Counts(right=950.0, begun=50.0), misnamed=Counts(right=1000.0))
    >>> {name: round(value, 3) for name, value in fitted([seen], ObjectSettings()).items()}["miss_rate"]
    0.049
    """
    missed = _habit(prior.miss_rate, prior, [habits.missed for habits in each])
    misnamed = _habit(prior.confusion_rate, prior, [habits.misnamed for habits in each])
    miss_rate, confusion_rate = missed.share(), misnamed.share()
    persistence_s, half_px = _how_long(each, miss_rate, prior)
    interval_s = float(np.median([habits.interval_s for habits in each]))
    # Of what was hardly seen, the most that is likely: else two misnamings in a row accuse who was right all day.
    names = misnamed.stream
    interval = wilson_interval(round(names.wrong), round(names.right + names.wrong))
    likely = min(interval[1] if interval else 1.0, prior.confusion_rate)
    own = [counts for habits in each for counts in habits.objects]
    return {
        "miss_rate": min(miss_rate, _MOST_SHARE),
        "confusion_rate": min(max(confusion_rate, likely), _MOST_SHARE),
        "persistence_s": max(persistence_s, misnamed.memory_s(interval_s)),
        "half_seen_px": half_px,
        "prior_messages": _trusted(messages_of(each), prior.prior_messages, _MOST_MESSAGES),
        "prior_gaps": _trusted(missed.stream.chances, prior.prior_gaps, _MOST_GAPS),
        "object_messages": _alike([(c.begun, c.begun + c.right) for c in own], prior.object_messages),
        "object_gaps": _alike([(c.lasted, c.chances) for c in own], prior.object_gaps),
    }


def _habit(rate: float, prior: ObjectSettings, seen: Sequence[Counts]) -> Habit:
    """One kind of error, as expected, and as all recordings together show it."""
    habit = Habit(rate, prior.persistence_s, prior.prior_messages, prior.prior_gaps)
    for counts in seen:
        habit.learn(Counts(), counts)
    return habit


def _trusted(seen: float, prior: float, most: float) -> float:
    return min(max(_TRUSTED * seen, prior), max(most, prior))


def _lasts(persistence_s: FloatArray | float, share: float, interval_s: float) -> FloatArray:
    """Share of errors of large objects that go on into the next message."""
    return np.asarray(share + (1.0 - share) * np.exp(-interval_s / persistence_s))


def _how_long(each: Sequence[ObjectHabits], share: float, prior: ObjectSettings) -> tuple[float, float]:
    """For how long misses last, s, and the size at which every second one does because of it, px."""
    tau_s, half_px = np.meshgrid(_PERSISTENCES_S, _HALVES_PX, indexing="ij")
    interval_s = float(np.median([habits.interval_s for habits in each]))
    q, expected = _lasts(tau_s, share, interval_s), float(_lasts(prior.persistence_s, share, interval_s))
    likely: FloatArray = prior.prior_gaps * (expected * np.log(q) + (1.0 - expected) * np.log(1.0 - q))
    likely -= 0.5 * (np.log(half_px / prior.half_seen_px) / _HALF_SIGMA) ** 2
    for habits in each:
        q = _lasts(tau_s, share, habits.interval_s)
        for side_px, went_on in habits.steps:
            ends = (1.0 - q) * (1.0 - lasts_of_small(side_px, half_px))
            likely += np.log(1.0 - ends) if went_on else np.log(ends)
    best = int(np.argmax(likely))
    return float(tau_s.ravel()[best]), float(half_px.ravel()[best])


def _alike(counts: Iterable[tuple[float, float]], prior: float) -> float:
    """How much the stream weighs for each of its objects: the least that is likely (beta-binomial).

    `counts`: by object, how often something happened, and how often it could have.

    >>> rng = np.random.default_rng(0)
    >>> _alike([(float(rng.binomial(30, 0.2)), 30.0) for _ in range(200)], 5.0) > 50.0
    True
    >>> _alike([(float(rng.binomial(30, p)), 30.0) for p in rng.beta(1.0, 4.0, 200)], 5.0) < 10.0
    True
    """
    told = np.array([(k, n) for k, n in counts if n > 0.0]).reshape(-1, 2)
    k, n = told.T
    if k.sum() <= 0.0 or k.sum() >= n.sum():
        return prior
    share = k.sum() / n.sum()
    a, b = share * _WEIGHTS, (1.0 - share) * _WEIGHTS
    likely = (betaln(k[:, None] + a, (n - k)[:, None] + b) - betaln(a, b)).sum(axis=0)
    return float(_WEIGHTS[np.flatnonzero(likely >= likely.max() - _CHANCE)[0]])
