"""How the false alarms of a detector are shared among its objects.

Whatever the shares, the rate of all is kept (weighted Bonferroni; Genovese, Roeder and Wasserman, Biometrika 93,
2006), so they may be chosen for speed. Messages are whole: a threshold between what four and five of them tell costs
five, and so does one that five just reach. What rounding leaves over buys others a message.
"""

from __future__ import annotations

import numpy as np

from belie.geometry import FloatArray

_LEAST_STEP = 0.5  # nats a message: below, whole messages do not matter
_ROUNDING = 1e-9  # nats: of sums of messages that just reach it


def shared_thresholds(reached: FloatArray, each: FloatArray, worth: FloatArray, rate: float) -> FloatArray:
    """Thresholds of `ErrorTest`s, nats, that together are crossed by chance at a rate.

    Messages until an accusation, times `worth`, are few: the continuous optimum (Lagrange: shares in proportion to
    `worth / each`) is rounded up to whole messages, and what is left over buys the cheapest ones.

    Parameters
    ----------
    reached : array (N,)
        Statistic of each object if the next message about it is in error, nats.
    each : array (N,)
        What every further message in error adds, nats.
    worth : array (N,)
        Of a message less, relative to other objects.
    rate : float
        False alarms a message.

    Returns
    -------
    array (N,)

    Examples
    --------
    Three objects of which five messages in error tell 15.3 nats: equal shares would ask 14.6 of each, shares by worth
    16.6 of the small ones, and so six messages.

    >>> first, each = np.full(3, 3.9), np.full(3, 2.85)
    >>> thresholds = shared_thresholds(first, each, np.array([350.0, 60.0, 50.0]), 1.4e-6)
    >>> np.ceil((thresholds - first) / each) + 1
    array([5., 5., 5.])
    >>> round(float(np.exp(-thresholds).sum()), 8)
    1.4e-06
    """
    if not len(reached):
        return np.empty(0)
    share = worth / np.maximum(each, _LEAST_STEP)
    least = -np.log(rate * share / share.sum())
    steps = np.maximum(each, _LEAST_STEP)
    # Who is nearly there keeps what it was asked: a message that tells less than expected must not move its goal.
    thresholds = np.where(reached < least, reached + steps * np.ceil((least - reached) / steps), least)
    left = rate - float(np.exp(-thresholds).sum())
    while True:
        cost = np.exp(steps - thresholds) - np.exp(-thresholds)
        fits = (cost <= left) & (thresholds - steps >= reached)
        if not fits.any():
            unused = np.log(rate / np.exp(-thresholds).sum())
            return np.asarray(thresholds - unused - _ROUNDING)
        cheapest = int(np.argmin(np.where(fits, cost / worth, np.inf)))
        thresholds[cheapest] -= steps[cheapest]
        left -= float(cost[cheapest])
