"""What a detector should say of each attack."""

from __future__ import annotations

from belie.attacks.kind import Stream
from belie.attacks.spec import AttackSpec
from belie.types import AlertType

_BY_STREAM: dict[Stream, AlertType] = {
    "odometry": AlertType.ODOMETRY_SPOOFING,
    "imu": AlertType.ODOMETRY_SPOOFING,
    "position": AlertType.POSITION_SPOOFING,
    "camera": AlertType.CAMERA_FAULT,
}
_BY_KIND = {
    "hide": AlertType.OBSTACLE_HIDING,
    "shift": AlertType.OBSTACLE_HIDING,
    "shrink": AlertType.OBSTACLE_HIDING,
    "delay": AlertType.OBSTACLE_HIDING,
    "relabel": AlertType.OBJECT_MISCLASSIFICATION,
    "swap": AlertType.OBJECT_MISCLASSIFICATION,  # each id now names the other's pixels
    "phantom": AlertType.OBSTACLE_INJECTION,
}


def expected_alert(spec: AttackSpec) -> AlertType:
    """The alert that an attack should raise.

    >>> expected_alert(AttackSpec.of("imu-freeze")).value
    'odometry_spoofing'
    >>> expected_alert(AttackSpec.of("detections-patch", mode="relabel")).value
    'object_misclassification'
    """
    if spec.stream != "detections":
        return _BY_STREAM[spec.stream]
    return _BY_KIND[str(spec["mode"]) if spec.kind == "patch" else spec.kind]
