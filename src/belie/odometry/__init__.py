"""The odometry layer; see ARCHITECTURE.md."""

from belie.odometry.features import FeatureSettings, extract_features, image_pyramid
from belie.odometry.paper_odometry import PaperOdometry, PaperOdometrySettings

__all__ = [
    "FeatureSettings",
    "PaperOdometry",
    "PaperOdometrySettings",
    "extract_features",
    "image_pyramid",
]
