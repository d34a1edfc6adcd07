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

from belie.checks.objects import ObjectSettings, lasts_of_small, persistence_of
from belie.detector.object_habits import ObjectHabits
from belie.geometry import FloatArray

_TRUSTED = (
    0.5  # of what was seen holds elsewhere (a power prior; Ibrahim and Chen, Statistical Science 15, 2000)
)
_MOST_MESSAGES, _MOST_GAPS = 2000.0, 200.0  # a minute of ten objects at 10 Hz outweighs them: weather changes
_HALF_SIGMA = 0.35  # of the logarithm of `half_seen_px`, before anything is seen: detectors differ by as much
_LASTS = np.geomspace(0.02, 0.95, 48)
_HALVES_PX = np.geomspace(4.0, 64.0, 48)
_WEIGHTS = np.geomspace(5.0, 640.0, 29)
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
    >>> from belie.checks.objects import Counts
    >>> seen = ObjectHabits(interval_s=0.1, missed=Counts(right=950.0, begun=50.0), misnamed=Counts(right=1000.0))
    >>> {name: round(value, 3) for name, value in fitted([seen], ObjectSettings()).items()}["miss_rate"]
    0.049
    """
    n = prior.prior_messages
    shares = [
        (sum(c.wrong for c in counts) + n * expected) / (sum(c.right + c.wrong for c in counts) + n)
        for counts, expected in (
            ([h.missed for h in each], prior.miss_rate),
            ([h.misnamed for h in each], prior.confusion_rate),
        )
    ]
    interval_s = float(np.median([habits.interval_s for habits in each]))
    lasts, half_px = _how_long(each, shares[0], interval_s, prior)
    misnamed = [habits.misnamed for habits in each]
    gaps = sum(c.wrong for c in misnamed)
    expected = _expected_to_last(prior.confusion_rate, interval_s, prior)
    names_last = sum(c.lasted for c in misnamed) + prior.prior_gaps * expected
    names_last /= gaps + prior.prior_gaps
    own = [counts for habits in each for counts in habits.objects]
    begun = [(c.begun, c.begun + c.right) for pair in own for c in pair[:1]]
    lasted = [(c.lasted, c.wrong) for pair in own for c in pair[:1]]
    missed = sum(habits.missed.wrong for habits in each)
    return {
        "miss_rate": shares[0],
        "confusion_rate": shares[1],
        "persistence_s": max(
            persistence_of(lasts, shares[0], interval_s), persistence_of(names_last, shares[1], interval_s)
        ),
        "half_seen_px": half_px,
        "prior_messages": min(max(_TRUSTED * messages_of(each), n), max(_MOST_MESSAGES, n)),
        "prior_gaps": min(max(_TRUSTED * missed, prior.prior_gaps), max(_MOST_GAPS, prior.prior_gaps)),
        "object_messages": _alike(begun, prior.object_messages),
        "object_gaps": _alike(lasted, prior.object_gaps),
    }


def _expected_to_last(share: float, interval_s: float, prior: ObjectSettings) -> float:
    return share + (1.0 - share) * float(np.exp(-interval_s / prior.persistence_s))


def _how_long(
    each: Sequence[ObjectHabits], share: float, interval_s: float, prior: ObjectSettings
) -> tuple[float, float]:
    """Share of misses of large objects that go on, and the size at which every second one does."""
    q, half_px = np.meshgrid(_LASTS, _HALVES_PX, indexing="ij")
    expected, n = _expected_to_last(share, interval_s, prior), prior.prior_gaps
    likely: FloatArray = n * expected * np.log(q) + n * (1.0 - expected) * np.log(1.0 - q)
    likely -= 0.5 * (np.log(half_px / prior.half_seen_px) / _HALF_SIGMA) ** 2
    for side_px, went_on in (step for habits in each for step in habits.steps):
        ends = (1.0 - q) * (1.0 - lasts_of_small(np.asarray(side_px), half_px))
        likely += np.log(1.0 - ends) if went_on else np.log(ends)
    best = int(np.argmax(likely))
    return float(q.ravel()[best]), float(half_px.ravel()[best])


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
