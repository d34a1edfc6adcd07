"""How the false alarms of a detector are shared among its objects.

Whatever the shares, the rate of all is kept (weighted Bonferroni; Genovese, Roeder and Wasserman, Biometrika 93,
2006), so they may be chosen for speed. Messages are whole: an object of which four tell too little and five tell more
than enough leaves a part of its share unused. That part buys others their last message.
"""

from __future__ import annotations

import numpy as np

from belie.geometry import FloatArray

_LEAST_STEP = 0.5  # nats a message: below, whole messages do not matter
_SHORT = 0.2  # nats: of messages that tell a little less than expected, as an object comes nearer or goes
_LEAST = 1.0  # nats: of a threshold, however many false alarms are tolerated; as in `run_threshold`


def shared_thresholds(
    first: FloatArray, each: FloatArray, worth: FloatArray, fewest: FloatArray, rate: float
) -> FloatArray:
    """Thresholds of `ErrorTest`s, nats, that together are crossed by chance at a rate.

    The shares are in proportion to `worth` at first, and rounded up to whole messages. What that leaves over buys those
    the last message that are one above the fewest, the cheapest first; nobody else, for where a message tells less, how
    long errors last is known least.

    Parameters
    ----------
    first : array (N,)
        What a first message in error tells of each object, nats.
    each : array (N,)
        What every further one adds, nats.
    worth : array (N,)
        Of a message less, relative to other objects.
    fewest : array (N,)
        Messages that are asked for at least, whatever the rate allows.
    rate : float
        False alarms a message.

    Returns
    -------
    array (N,)

    Examples
    --------
    Shares by worth would ask 16.2 nats of the van beside two lorries, of which five messages tell 15.3. What the
    lorries' five leave over pays for its fifth; the small one, of which a message tells half, keeps what it was asked.

    >>> first, each = np.full(4, 3.9), np.array([3.2, 3.2, 2.85, 1.5])
    >>> thresholds = shared_thresholds(first, each, np.array([350.0, 150.0, 60.0, 40.0]), np.full(4, 5), 1.4e-6)
    >>> np.ceil((thresholds - first) / each) + 1
    array([ 5.,  5.,  5., 10.])
    >>> float(np.exp(-thresholds).sum()) < 1.4e-6
    True
    """
    if not len(first):
        return np.empty(0)
    least = np.maximum(-np.log(rate * worth / worth.sum()), first)
    steps, last = np.maximum(each, _LEAST_STEP), np.asarray(fewest, dtype=np.float64) - 1.0
    further = np.maximum(np.ceil((least - first) / steps), last)  # messages after the first
    thresholds = np.maximum(least, first + further * steps - _SHORT)
    left = rate - float(np.exp(-thresholds).sum())
    near = np.flatnonzero(further == last + 1.0)
    for k in near[np.argsort(-(first + last * steps)[near], kind="stable")].tolist():
        bought = float(first[k] + last[k] * steps[k]) - _SHORT
        price = float(np.exp(-bought) - np.exp(-thresholds[k]))
        if price <= left:
            thresholds[k], left = bought, left - price
    return np.asarray(np.maximum(thresholds, _LEAST))
