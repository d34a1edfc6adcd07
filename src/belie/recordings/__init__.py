"""Recordings of any format as time-ordered steps, and the writer of ROS 2 MCAP.

Bags (ROS 2 MCAP and sqlite3, ROS 1), KITTI odometry, EuRoC ASL and TUM folders, videos. No ROS
installation is needed.
"""

from belie.recordings.geodesy import GeodeticPoint
from belie.recordings.join_counts import JoinCounts
from belie.recordings.join_settings import JoinSettings
from belie.recordings.opening import open_recording
from belie.recordings.recording import BodyAxes, Recording, StreamInfo
from belie.recordings.writer import write_mcap

__all__ = [
    "BodyAxes",
    "GeodeticPoint",
    "JoinCounts",
    "JoinSettings",
    "Recording",
    "StreamInfo",
    "open_recording",
    "write_mcap",
]
