"""Images to `VisualEstimate`: one file a stage of section III, one conductor for each profile."""

from belie.odometry.features import FeatureSettings, extract_features, image_pyramid
from belie.odometry.paper_odometry import PaperOdometry, PaperOdometrySettings
from belie.odometry.tracking import TrackingSettings
from belie.odometry.visual_odometry import VisualOdometry, VisualOdometrySettings

__all__ = [
    "FeatureSettings",
    "PaperOdometry",
    "PaperOdometrySettings",
    "TrackingSettings",
    "VisualOdometry",
    "VisualOdometrySettings",
    "extract_features",
    "image_pyramid",
]
