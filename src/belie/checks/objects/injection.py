"""Obstacle injection: a box with nothing behind it but the road or the wall.

Whoever stands on the ground stands at the depth of its foot. So each corner in a box has two explanations: it is
part of an object that stands where the box ends below, or it is part of the ground or the wall that would be seen if
nobody stood there. Both say what its inverse depth must be. The log-likelihood ratio is summed over corners and over
messages. Moving objects fit neither, and are no phantoms; what neither moves nor has a depth of its own (a picture
on a wall at whose foot it stands) cannot be told from a flat object, and is not accused.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from belie.geometry import FloatArray

_BEHIND, _BEFORE = 0.7, 1.15  # of the foot's 1/Z: an object reaches behind its foot (a car of 4 m, 10 m away)
_FOOT = 0.03  # of the depth: error of a foot, by the box's jitter
_MODEL = 0.08  # of the depth: a road's camber, a wall's relief
_MOST_A_CORNER = 1.5  # nats
_MOST_A_MESSAGE = 6.0  # nats: corners of one box share their errors
_LEAST_CORNERS = 5
# Of the corners in its middle, a quarter of those of a true box are the background's (a gap, a window, an edge) or
# lost, and a tenth of those of a phantom ride with it by chance.
_PASSES, _RIDES = 1.3, 2.0  # nats: log(0.9 / 0.25), log(0.75 / 0.1)
# Of a hundred true objects one stands where no road would take it (on a bridge, a bank, a balcony), of phantoms every
# other.
_ALOFT = 3.9  # nats: log(0.5 / 0.01)
_ACQUITS = 0.5  # of the threshold: an accusation ends below
_SHIFTS = 5  # of a plane that is not known exactly, which are tried
_DECIDED = 0.75  # share of the corners that must have been explained at all


def background_evidence(
    inverse_depth: FloatArray,
    deviation: FloatArray,
    background: FloatArray,
    foot: float,
    foot_error: float = 0.0,
    tilt: float = 0.0,
) -> float | None:
    """Log-likelihood ratio, nats, that a box shows the background and no object that stands at its foot.

    Parameters
    ----------
    inverse_depth, deviation : arrays (N,)
        Of the corners in the box, from the camera's own motion; NaN where the corner does not keep still.
    background : array (N,)
        Inverse depth of the ground or the wall at the corners.
    foot : float
        Inverse depth at which an object would stand that ends where the box ends.
    foot_error : float
        Of it: a road that rises or a nodding camera moves the foot of whatever is far away.
    tilt : float
        Of it: by so much the ground may lie elsewhere than it was fitted. The object is given what fits it best; not
        the background, or whatever moves would be explained by a plane that lies where there is none.

    Returns
    -------
    float or None
        None where too few corners could tell the two apart.

    Examples
    --------
    >>> ground = np.linspace(0.01, 0.1, 12)
    >>> background_evidence(ground, np.full(12, 1e-3), ground, 0.1) > 3.0
    True
    >>> background_evidence(np.full(12, 0.1), np.full(12, 1e-3), ground, 0.1) < -3.0
    True
    """
    width = np.abs(deviation) + _MODEL * np.abs(background)
    outside = np.maximum(_BEHIND * foot - background, background - _BEFORE * foot)
    telling = outside - foot_error > 1.5 * width
    if int(telling.sum()) < _LEAST_CORNERS:
        return None
    rho, width = inverse_depth[telling], width[telling]
    object_width = np.abs(deviation[telling]) + _FOOT * abs(foot) + foot_error
    as_background = np.abs(rho - background[telling]) / width
    feet = foot + np.linspace(-tilt, tilt, _SHIFTS)[:, None]
    as_object = _best(np.maximum(np.maximum(_BEHIND * feet - rho, rho - _BEFORE * feet), 0.0) / object_width)
    explained = np.isfinite(rho) & ((as_background < 2.0) | (as_object < 2.0))
    if explained.sum() < max(_LEAST_CORNERS, _DECIDED * len(rho)):
        return 0.0  # it moves, or is no plane: no phantom of this kind
    evidence = np.clip(0.5 * (as_object**2 - as_background**2), -_MOST_A_CORNER, _MOST_A_CORNER)[explained]
    return float(np.clip(evidence.sum(), -_MOST_A_MESSAGE, _MOST_A_MESSAGE))


def _best(off: FloatArray) -> FloatArray:
    """Of several explanations (S, N), in deviations, the one that fits most corners; NaN fits none."""
    fits = np.where(np.isfinite(off), np.minimum(off, 2.0), 2.0) ** 2
    return np.asarray(off[int(np.argmin(fits.sum(axis=1)))])


def passing_evidence(rides: npt.NDArray[np.bool_], still: npt.NDArray[np.bool_]) -> float | None:
    """Log-likelihood ratio, nats, that the background passes through a box: a picture on the camera's own path.

    Whatever is in a box goes where the box goes. Corners from its middle that do not, and move as the still scene does,
    are seen through it.

    Parameters
    ----------
    rides, still : arrays (N,), bool
        Of corners in the middle of the box: whether they keep their place in it, and whether they keep still in space.

    Returns
    -------
    float or None
        None where nothing passes.

    Examples
    --------
    >>> passes, rides = np.zeros(3, bool), np.ones(3, bool)
    >>> round(passing_evidence(passes, np.ones(3, bool)), 1), passing_evidence(rides, np.ones(3, bool))
    (3.9, None)
    """
    passing, stray = int((~rides & still).sum()), int((~rides & ~still).sum())
    if passing == 0 or stray > passing:
        return None
    evidence = _PASSES * passing - _RIDES * int(rides.sum())
    return float(np.clip(evidence, -_MOST_A_MESSAGE, _MOST_A_MESSAGE))


@dataclass(slots=True)
class PhantomTest:
    """What speaks for a phantom, summed over messages (Page's test).

    Two kinds of evidence, which are blind at different times: over a short way nothing passes through a box on a far
    road, though its corners already lie on the ground. So where the depths say nothing, corners that seem to ride
    take back only what corners that passed had given. That a box hangs in the air counts once, however long it does;
    where its corners lie has that in it, as they are held against its foot.

    Examples
    --------
    >>> test = PhantomTest()
    >>> [test.add(*told, 14.0, i) for i, told in enumerate([(None, 6.0), (-3.0, None), (-3.0, 6.0), (1.3, 6.0)])]
    [False, False, False, True]
    """

    statistic: float = 0.0  # nats
    since_ns: int = 0
    accused: bool = False
    why: str = "not yet seen from two places"  # nothing can be told, if not empty
    aloft: bool = False  # no road would take an object to where its box is
    _told: float = 0.0  # of the statistic, what messages gave
    _passed: float = 0.0  # of that, what the scene gave that passed through the box
    _threshold: float = 0.0  # the latest

    def add(
        self,
        passing: float | None,
        lying: float | None,
        threshold: float,
        stamp_ns: int,
        *,
        sure: bool = True,
    ) -> bool:
        """Evidence of both kinds from one message, nats (None: blind); True while it is accused.

        `sure`: nobody is accused before.
        """
        if self._told == 0.0:
            self.since_ns = stamp_ns
        told = max((each for each in (passing, lying) if each is not None), default=0.0)
        if lying is None:
            told = max(told, -self._passed)
        if lying is None or (passing is not None and passing >= lying):
            self._passed = max(self._passed + told, 0.0)
        self._told = min(max(self._told + told, 0.0), 2.0 * threshold)
        self._threshold = threshold
        self._sum_up()
        self.accused = sure and self.statistic >= threshold * (_ACQUITS if self.accused else 1.0)
        return self.accused

    def take_back(self, riding: int) -> None:
        """Nothing passed, and so many corners went where the box went: what passed before was by chance.

        A box that jumps to a neighbour and back would else be remembered for as long as it is told of.
        """
        less = min(_RIDES * riding, _MOST_A_MESSAGE, self._passed)
        self._passed -= less
        self._told -= less
        self._sum_up()
        # Where nothing else is told from then on, nobody would ask again.
        self.accused = self.accused and self.statistic >= _ACQUITS * self._threshold

    def _sum_up(self) -> None:
        self._passed = min(self._passed, self._told)
        lying = self._told - self._passed
        in_air = max(_ALOFT - lying, 0.0) if self.aloft and self._passed > 0.0 else 0.0
        self.statistic = self._told + in_air
