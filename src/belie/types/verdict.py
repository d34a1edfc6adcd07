"""What belie answers: the contract of ``belie check --json``."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any


class Status(StrEnum):
    """The three answers. UNDECIDED always comes with a reason."""

    CONSISTENT = "consistent"
    CONTRADICTED = "contradicted"
    UNDECIDED = "undecided"


class AlertType(StrEnum):
    """What an alert accuses a stream of."""

    ODOMETRY_SPOOFING = "odometry_spoofing"
    POSITION_SPOOFING = "position_spoofing"
    OBSTACLE_HIDING = "obstacle_hiding"
    OBJECT_MISCLASSIFICATION = "object_misclassification"
    OBSTACLE_INJECTION = "obstacle_injection"
    CAMERA_FAULT = "camera_fault"


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckResult:
    """The answer of one check on one stream for one frame.

    Parameters
    ----------
    check : str
        ``odometry``, ``twist``, ``imu``, ``position`` or ``camera``.
    source : str
        The stream that was checked (topic).
    statistic, threshold : float or None
        The test statistic closest to its threshold, in `unit`; None where nothing could be tested.
    unit : str
        ``chi2``, ``px2``, ``m2``, ``llr`` (log-likelihood ratio, nats) or ``frames``.
    floor : str or None
        Minimum detectable lie: the smallest lie that would now be caught, with its unit.
    reason : str
        For a person: what was seen.
    object : str or None
        The object that is meant, for object checks.

    Examples
    --------
    >>> CheckResult(check="imu", source="/imu", status=Status.UNDECIDED, reason="too dark").status.value
    'undecided'
    """

    check: str
    source: str
    status: Status
    statistic: float | None = None
    threshold: float | None = None
    unit: str = "chi2"
    floor: str | None = None
    reason: str = ""
    object: str | None = None

    def to_json(self) -> dict[str, Any]:
        """The JSON object of the contract (design, section 4)."""
        return {name: getattr(self, name) for name in self.__slots__}


@dataclass(frozen=True, slots=True, kw_only=True)
class AccusedObject:
    """The object of an alert, in the frame in which the alert is raised.

    Parameters
    ----------
    label_before, label_after : str or None
        What the object is by what its detector told before the lie, and what it is called now: None where nothing is
        known there (an invented object), or nothing is told of it (a hidden one).
    id_after : str or None
        Track id under which it is told of now.
    box_px : tuple of four floats
        Where it is: left, top, right, bottom edge; may reach beyond the image.

    Examples
    --------
    >>> AccusedObject(label_before="car", box_px=(1.0, 2.04, 3.06, 4.0)).to_json()
    {'label_before': 'car', 'label_after': None, 'id_after': None, 'box_px': [1.0, 2.0, 3.1, 4.0]}
    """

    label_before: str | None = None
    label_after: str | None = None
    id_after: str | None = None
    box_px: tuple[float, float, float, float]

    def to_json(self) -> dict[str, Any]:
        """As fields of its alert; edges to a tenth of a pixel."""
        return {
            "label_before": self.label_before,
            "label_after": self.label_after,
            "id_after": self.id_after,
            "box_px": [round(edge, 1) for edge in self.box_px],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Alert:
    """An accusation, raised once: which stream lies, how, and since when.

    ``onset_ns`` is our estimate of when the lie began (for a CUSUM: the last time it was zero); ``because``: for a
    person, what was seen when it was raised; ``accused``: its object, if it is about one and more than a name is known.
    """

    type: AlertType
    source: str
    onset_ns: int
    object: str | None = None
    because: str = field(default="", compare=False)
    accused: AccusedObject | None = field(default=None, compare=False)

    def to_json(self) -> dict[str, Any]:
        """The JSON object of the contract (design, section 4); alerts about objects have those of `AccusedObject`, too.

        >>> list(Alert(type=AlertType.CAMERA_FAULT, source="/image", onset_ns=5).to_json())
        ['type', 'source', 'onset_ns', 'object', 'because']
        """
        told = {name: getattr(self, name) for name in self.__slots__ if name != "accused"}
        return told if self.accused is None else {**told, **self.accused.to_json()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """The answer for one frame: all checks, and the alerts raised in this very frame."""

    frame: int
    stamp_ns: int
    status: Status
    latency_ms: float
    checks: tuple[CheckResult, ...] = ()
    alerts: tuple[Alert, ...] = field(default=())

    def to_json(self) -> dict[str, Any]:
        """The JSON object of the contract (design, section 4); one line of ``check --json``."""
        return {
            "frame": self.frame,
            "stamp_ns": self.stamp_ns,
            "status": self.status.value,
            "latency_ms": round(self.latency_ms, 3),
            "checks": [check.to_json() for check in self.checks],
            "alerts": [alert.to_json() for alert in self.alerts],
        }
