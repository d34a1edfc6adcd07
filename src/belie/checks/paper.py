"""The paper's global checks (section III-B), to the letter: fixed thresholds on two errors.

``e^G > T1`` is odometry spoofing; ``e^G < T2 and P > T3`` is position spoofing. The readings behind the
units and the sign are docs/decisions/0001 and 0002.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field

from belie.geometry import FloatArray
from belie.types import CheckResult, PositionClaim, Settings, Status, VisualEstimate


class PaperThresholds(Settings):
    """T1 to T4 of the paper.

    >>> PaperThresholds().odometry_error_px2
    40.0
    """

    odometry_error_px2: float = Field(
        40.0,
        gt=0.0,
        description="T1: mean squared reprojection error above which odometry lies [px^2]; 40 is 6.3 px.",
    )
    vouched_error_px2: float = Field(
        20.0,
        gt=0.0,
        description="T2: error below which the odometry is taken for sound when judging a position [px^2]; 20"
        " is 4.5 px.",
    )
    position_step_m2: float = Field(
        20.0,
        gt=0.0,
        description="T3: mean squared step of a coordinate between two claims above which a position lies"
        " [m^2]; 20 is 4.5 m a coordinate, 7.7 m a step.",
    )
    local_error_px2: float = Field(
        20.0,
        gt=0.0,
        description="T4: error below which an object's pixels are taken for still there [px^2]; 20 is 4.5 px.",
    )


def position_step_m2(previous_m: FloatArray, current_m: FloatArray) -> float:
    """``P``: mean over the three coordinates of the squared difference of two positions, m².

    >>> position_step_m2(np.zeros(3), np.array([3.0, 0.0, 0.0]))
    3.0
    """
    return float(np.mean((np.asarray(current_m) - np.asarray(previous_m)) ** 2))


def odometry_check(estimate: VisualEstimate, source: str, settings: PaperThresholds) -> CheckResult:
    """Odometry spoofing: ``e^G > T1``.

    Parameters
    ----------
    estimate : VisualEstimate
        From the `paper` odometry, which predicts with the claims of `source`.
    source : str
        Topic of the odometry that is judged.
    settings : PaperThresholds

    Returns
    -------
    CheckResult
        UNDECIDED, with the estimate's own reason, where there is no error to test.

    Examples
    --------
    >>> from belie.geometry import SE3
    >>> estimate = VisualEstimate(stamp_ns=1, previous_stamp_ns=0, T_prev_cur=SE3.identity(),
    ...     covariance=np.eye(6), corners=900, matches=400, inliers=90, parallax_px=9.0, error_px2=132.0)
    >>> odometry_check(estimate, "/odom", PaperThresholds()).status.value
    'contradicted'
    """
    threshold = settings.odometry_error_px2
    error = estimate.error_px2
    if estimate.reason is not None or error is None:
        return CheckResult(
            check="odometry",
            source=source,
            status=Status.UNDECIDED,
            threshold=threshold,
            unit="px2",
            reason=estimate.reason or "the images gave no error",
        )
    lies = not error <= threshold
    verb = "above" if lies else "within"
    return CheckResult(
        check="odometry",
        source=source,
        status=Status.CONTRADICTED if lies else Status.CONSISTENT,
        statistic=error,
        threshold=threshold,
        unit="px2",
        reason=f"after the best fit {estimate.matches} map points made from the claims miss their corners by"
        f" {error**0.5:.1f} px (rms), {verb} the limit of {threshold**0.5:.1f} px",
    )


def position_check(
    estimate: VisualEstimate,
    previous: PositionClaim | None,
    current: PositionClaim,
    settings: PaperThresholds,
) -> CheckResult:
    """Position spoofing: ``e^G < T2 and P > T3``.

    Parameters
    ----------
    estimate : VisualEstimate
        Of the frame that `current` belongs to.
    previous, current : PositionClaim or None, PositionClaim
        Two consecutive claims of one source; None before there are two.
    settings : PaperThresholds

    Returns
    -------
    CheckResult
        UNDECIDED where there is no previous claim, where a large step meets odometry that the images do not
        vouch for, or where they say nothing. A small step is CONSISTENT whatever the images say: the paper
        tests nothing else.

    Raises
    ------
    ValueError
        If the two claims come from different sources, or not in order.

    Examples
    --------
    >>> from belie.geometry import SE3
    >>> estimate = VisualEstimate(stamp_ns=1, previous_stamp_ns=0, T_prev_cur=SE3.identity(),
    ...     covariance=np.eye(6), corners=900, matches=400, inliers=390, parallax_px=9.0, error_px2=9.0)
    >>> fixes = [PositionClaim(source="/gnss", frame_id="enu", kind="gnss", stamp_ns=i, received_ns=i,
    ...                        position_m=[100.0 * i, 0.0, 0.0]) for i in (0, 1)]
    >>> position_check(estimate, *fixes, PaperThresholds()).reason
    'the position steps by 100.0 m in one go, and the odometry fits the images'
    """

    def answer(status: Status, reason: str, step: float | None) -> CheckResult:
        return CheckResult(
            check="position",
            source=current.source,
            status=status,
            statistic=step,
            threshold=settings.position_step_m2,
            unit="m2",
            reason=reason,
        )

    if previous is None:
        return answer(Status.UNDECIDED, "first position: there is no step to test", None)
    if previous.source != current.source or previous.stamp_ns > current.stamp_ns:
        raise ValueError(
            "positions must be consecutive claims of one source, got"
            f" {previous.source} at {previous.stamp_ns} and {current.source} at {current.stamp_ns}"
        )
    step = position_step_m2(previous.position_m, current.position_m)
    length_m = float(np.linalg.norm(current.position_m - previous.position_m))
    if step <= settings.position_step_m2:
        return answer(Status.CONSISTENT, f"the position steps by {length_m:.1f} m", step)
    if estimate.reason is not None or estimate.error_px2 is None:
        why = estimate.reason or "the images gave no error"
        return answer(Status.UNDECIDED, f"the position steps by {length_m:.1f} m, but: {why}", step)
    if not estimate.error_px2 < settings.vouched_error_px2:
        error_px = estimate.error_px2**0.5
        reason = (
            f"the position steps by {length_m:.1f} m, but the odometry is off by {error_px:.1f} px itself"
        )
        return answer(Status.UNDECIDED, reason, step)
    reason = f"the position steps by {length_m:.1f} m in one go, and the odometry fits the images"
    return answer(Status.CONTRADICTED, reason, step)
