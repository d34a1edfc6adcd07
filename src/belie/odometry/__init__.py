"""Images to `VisualEstimate`: one file a stage of section III, one conductor for each profile."""

from belie.odometry.features import FeatureSettings, extract_features, image_pyramid
from belie.odometry.object_motion import motion_over, moved_box_px
from belie.odometry.paper_objects import LocalConsistency, LocalError, LocalMapPoints
from belie.odometry.paper_odometry import PaperOdometry, PaperOdometrySettings
from belie.odometry.tracking import TrackingSettings
from belie.odometry.visual_odometry import VisualOdometry, VisualOdometrySettings

__all__ = [
    "FeatureSettings",
    "LocalConsistency",
    "LocalError",
    "LocalMapPoints",
    "PaperOdometry",
    "PaperOdometrySettings",
    "TrackingSettings",
    "VisualOdometry",
    "VisualOdometrySettings",
    "extract_features",
    "image_pyramid",
    "motion_over",
    "moved_box_px",
]
