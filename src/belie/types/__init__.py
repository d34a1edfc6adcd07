"""The frozen values that travel between belie's layers, and the error tree."""

from belie.types.arrays import frozen, frozen_as, read_only
from belie.types.claims import Claim, Detection, DetectionClaim, MotionClaim, PoseClaim, PositionClaim
from belie.types.config import Settings
from belie.types.errors import (
    AmbiguousTopicError,
    AttackError,
    BelieError,
    CalibrationError,
    ConfigError,
    MissingExtraError,
    RecordingError,
    TopicError,
    TransportError,
)
from belie.types.estimate import VisualEstimate
from belie.types.features import Features, Keyframe, MapPoints
from belie.types.frame import Frame, GrayImage, MountedCamera
from belie.types.step import Step
from belie.types.verdict import AccusedObject, Alert, AlertType, CheckResult, Status, Verdict

__all__ = [
    "AccusedObject",
    "Alert",
    "AlertType",
    "AmbiguousTopicError",
    "AttackError",
    "BelieError",
    "CalibrationError",
    "CheckResult",
    "Claim",
    "ConfigError",
    "Detection",
    "DetectionClaim",
    "Features",
    "Frame",
    "GrayImage",
    "Keyframe",
    "MapPoints",
    "MissingExtraError",
    "MotionClaim",
    "MountedCamera",
    "PoseClaim",
    "PositionClaim",
    "RecordingError",
    "Settings",
    "Status",
    "Step",
    "TopicError",
    "TransportError",
    "Verdict",
    "VisualEstimate",
    "frozen",
    "frozen_as",
    "read_only",
]
