"""Sensors with the errors of real ones: true motion and labels in, claims out, every one seeded.

Each sensor is asked for its claims up to a moment, again and again, and keeps its own noise between: a drive that is
known beforehand and one that is steered as it goes are sampled alike.
"""

from belie.simulation.sensors.detector_settings import ObjectDetectorSettings
from belie.simulation.sensors.gnss import GnssSettings, gnss
from belie.simulation.sensors.imu import Imu, ImuSettings
from belie.simulation.sensors.localisation import LocalisationSettings, localisation
from belie.simulation.sensors.object_detector import ObjectDetector
from belie.simulation.sensors.sampling import Arrival, Motion, Sampling
from belie.simulation.sensors.wheel_odometry import WheelOdometry, WheelOdometrySettings

__all__ = [
    "Arrival",
    "GnssSettings",
    "Imu",
    "ImuSettings",
    "LocalisationSettings",
    "Motion",
    "ObjectDetector",
    "ObjectDetectorSettings",
    "Sampling",
    "WheelOdometry",
    "WheelOdometrySettings",
    "gnss",
    "localisation",
]
