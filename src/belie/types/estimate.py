"""What the images say of the camera's motion between two frames."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from belie.geometry import SE3, FloatArray, so3_log
from belie.types.arrays import frozen


def _no_points() -> FloatArray:
    return np.empty((0, 2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VisualEstimate:
    """The camera's motion from the previous frame to this one, as the images alone tell it.

    Parameters
    ----------
    stamp_ns, previous_stamp_ns : int
        Stamps of the two frames.
    T_prev_cur : SE3
        Maps current to previous camera coordinates; its translation is in the map's unit, which is
        arbitrary but kept from frame to frame (a single camera cannot see metres).
    covariance : array (6, 6)
        Of the right-hand perturbation ``T_prev_cur exp(xi)``, translation first; map units and rad.
    corners, matches, inliers : int
        Corners found, pairs tried, pairs that agree. No inlier: nothing is known. Inliers and a `reason`: the
        rotation is known, the translation is not.
    parallax_px : float
        Median displacement of the inliers that rotation does not explain.
    map_id : int
        Changes when the map had to be begun anew: its unit has then changed too.
    error_px2 : float or None
        ``e^G`` of equation (6): mean squared reprojection error over level variance.
    reason : str or None
        Why the images say nothing (dark, blank, blurred, first frame …); None if they do.
    predicted_px, observed_px : array (N, 2)
        The pairs of equation (6), full-resolution pixels; for pictures.
    """

    stamp_ns: int
    previous_stamp_ns: int
    T_prev_cur: SE3
    covariance: FloatArray
    corners: int
    matches: int
    inliers: int
    parallax_px: float
    map_id: int = 0
    error_px2: float | None = None
    reason: str | None = None
    predicted_px: FloatArray = field(default_factory=_no_points)
    observed_px: FloatArray = field(default_factory=_no_points)

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", frozen(self.covariance, (6, 6), "covariance"))
        for name in ("predicted_px", "observed_px"):
            object.__setattr__(self, name, frozen(getattr(self, name), (-1, 2), name))

    @property
    def is_still(self) -> bool:
        """Whether the motion is no larger than three standard deviations of what it may be off by.

        >>> VisualEstimate(stamp_ns=1, previous_stamp_ns=0, T_prev_cur=SE3.exp([0, 0, 1, 0, 0, 0]), corners=9,
        ...     covariance=np.eye(6) * 1e-4, matches=9, inliers=9, parallax_px=5.0).is_still
        False
        """
        variance = np.diag(self.covariance)
        moved = float(self.T_prev_cur.t @ self.T_prev_cur.t) > 9.0 * float(variance[:3].sum())
        omega = so3_log(self.T_prev_cur.R)
        return not moved and float(omega @ omega) <= 9.0 * float(variance[3:].sum())
