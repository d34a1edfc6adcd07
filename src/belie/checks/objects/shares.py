"""How the false alarms of a detector are shared among its objects.

Whatever the shares, the rate of all is kept (weighted Bonferroni; Genovese, Roeder and Wasserman, Biometrika 93,
2006), so they may be chosen for speed. Messages are whole: an object of which four tell too little and five tell more
than enough leaves a part of its share unused. That part buys other objects a message.
"""

from __future__ import annotations

import numpy as np

from belie.geometry import FloatArray

_LEAST_STEP = 0.5  # nats a message: below, whole messages do not matter
_MOST_UNUSED = 0.5  # nats: more would be a message less of somebody
_ROUNDING = 1e-9  # nats: of sums of messages that just reach it
_LEAST = 1.0  # nats: of a threshold, however many false alarms are tolerated; as in `run_threshold`


def shared_thresholds(
    first: FloatArray, each: FloatArray, rate: float, fewest: FloatArray | int = 1
) -> FloatArray:
    """Thresholds of `ErrorTest`s, nats, that together are crossed by chance at a rate.

    The shares are equal at first, which makes the product of the times to an accusation least, whatever a message tells
    of each object. Rounded up to whole messages, they leave something over; it is spent where it shortens the time by
    the largest factor for its price.

    Parameters
    ----------
    first : array (N,)
        What a first message in error tells of each object, nats.
    each : array (N,)
        What every further one adds, nats.
    rate : float
        False alarms a message.
    fewest : array (N,) or int
        Messages that are asked for at least, whatever the rate allows.

    Returns
    -------
    array (N,)

    Examples
    --------
    Equal shares would ask 14.6 nats of each: five messages of some, eight of the one of which a message tells less.
    Both reach a little more, and so do the thresholds: what it leaves over does not pay for a message less.

    >>> first, each = np.full(3, 3.9), np.array([3.2, 2.8, 1.5])
    >>> thresholds = shared_thresholds(first, each, 1.4e-6)
    >>> np.ceil((thresholds - first) / each) + 1
    array([5., 5., 8.])
    >>> round(float(np.exp(-thresholds).sum()), 8)
    1.4e-06
    """
    if not len(first):
        return np.empty(0)
    steps = np.maximum(each, _LEAST_STEP)
    least = np.broadcast_to(np.asarray(fewest, dtype=np.float64) - 1.0, len(first))
    further = np.ceil(np.maximum(np.log(len(first) / rate) - first, 0.0) / steps)  # messages after the first
    further = np.maximum(further, least)
    while True:
        thresholds = first + further * steps
        spent = np.exp(-thresholds)
        price = np.exp(steps - thresholds) - spent
        fits = (further > least) & (price <= rate - spent.sum())
        if not fits.any():
            # What is left over now shortens nothing; but a run that tells a little less than expected may pass.
            unused = min(float(np.log(rate / spent.sum())), _MOST_UNUSED)
            return np.asarray(np.maximum(thresholds - unused - _ROUNDING, _LEAST))
        gain = np.log1p(1.0 / np.maximum(further, 1.0))
        further[np.argmax(np.where(fits, gain / price, 0.0))] -= 1.0
