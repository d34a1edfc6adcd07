"""The paper's local checks (section III-C), to the letter: one threshold on one error.

``e^L < T4 and the object disappears`` is obstacle hiding; ``e^L < T4 and its label changes`` is object
misclassification. No gap is short enough and no label near enough to be excused.
"""

from __future__ import annotations

from belie.checks.paper import PaperThresholds
from belie.types import CheckResult, Status


def hiding_check(
    source: str, name: str, label: str, error_px2: float | None, why: str, settings: PaperThresholds
) -> CheckResult:
    """Obstacle hiding, of an object that no detection of the message belongs to.

    Parameters
    ----------
    source : str
        Topic of the detections.
    name, label : str
        Its track id (or ``#n``) and its class.
    error_px2 : float or None
        ``e^L`` over its predicted box; None where there is none.
    why : str
        Why there is none.
    settings : PaperThresholds

    Returns
    -------
    CheckResult
        UNDECIDED, with the reason, where there is no error to test; CONSISTENT where the object is gone from
        the image, too.

    Examples
    --------
    >>> hiding_check("/detections", "7", "car", 3.0, "", PaperThresholds()).status.value
    'contradicted'
    """
    return _answer("hiding", source, name, f"{label} {name} is missing", error_px2, why, settings)


def misclassification_check(
    source: str,
    name: str,
    before: str,
    now: str,
    error_px2: float | None,
    why: str,
    settings: PaperThresholds,
) -> CheckResult:
    """Object misclassification, of an object whose label changed from `before` to `now`.

    Parameters and answers are those of `hiding_check`.

    Examples
    --------
    >>> misclassification_check("/detections", "7", "car", "bird", 60.0, "", PaperThresholds()).status.value
    'consistent'
    """
    what = f"{before} {name} is called {now}"
    return _answer("misclassification", source, name, what, error_px2, why, settings)


def unchanged(check: str, source: str, reason: str, settings: PaperThresholds) -> CheckResult:
    """The answer where no object disappeared, or none was renamed: there is nothing to test.

    >>> unchanged("hiding", "/detections", "3 objects, all detected", PaperThresholds()).status.value
    'consistent'
    """
    return CheckResult(
        check=check, source=source, status=Status.CONSISTENT, threshold=settings.local_error_px2, unit="px2",
        reason=reason,
    )  # fmt: skip


def withheld(check: str, source: str, reason: str, settings: PaperThresholds) -> CheckResult:
    """The answer where no message came: UNDECIDED.

    >>> withheld("hiding", "/detections", "no message for this frame", PaperThresholds()).status.value
    'undecided'
    """
    return CheckResult(
        check=check, source=source, status=Status.UNDECIDED, threshold=settings.local_error_px2, unit="px2",
        reason=reason,
    )  # fmt: skip


def _answer(
    check: str,
    source: str,
    name: str,
    what: str,
    error_px2: float | None,
    why: str,
    settings: PaperThresholds,
) -> CheckResult:
    threshold = settings.local_error_px2
    if error_px2 is None:
        status, reason = Status.UNDECIDED, f"{what}, and its pixels cannot tell: {why}"
    elif error_px2 < threshold:
        status = Status.CONTRADICTED
        reason = f"{what}, but its map points find their corners to {error_px2**0.5:.1f} px (rms)"
    else:
        status = Status.CONSISTENT
        reason = f"{what}, and so are its pixels other ones: {error_px2**0.5:.1f} px (rms)"
    return CheckResult(
        check=check, source=source, status=status, statistic=error_px2, threshold=threshold, unit="px2",
        reason=reason, object=name,
    )  # fmt: skip
