"""How good the simulated object detector is, and where each figure comes from."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from belie.simulation.sensors.sampling import Arrival
from belie.types import Settings


class ObjectDetectorSettings(Settings):
    """Errors of a camera-LiDAR object detector.

    >>> ObjectDetectorSettings().rate_hz
    10.0
    """

    rate_hz: float = Field(
        10.0,
        description="messages, each on a camera frame: the nearest whole number of frames apart; 0 leaves the "
        "detector out [Hz]",
        ge=0.0,
        le=60.0,
    )
    miss: float = Field(
        0.02,
        description="share of messages that miss a near object in full view; typical of a strong detector on "
        "KITTI's easy objects (40 px and more, unoccluded) [1]",
        ge=0.0,
        le=1.0,
    )
    night_miss: float = Field(
        0.08,
        description="the same in the dark; typical [1]",
        ge=0.0,
        le=1.0,
    )
    half_seen_px: float = Field(
        16.0,
        description="height at which half of the objects are missed; KITTI judges none below 25 px [px]",
        gt=0.0,
    )
    half_seen_width_px: float = Field(3.0, description="how gradually that sets in (logistic) [px]", gt=0.0)
    half_seen_contrast: float = Field(
        0.1,
        description="contrast left by fog at which half are missed; at the meteorological visibility it is 0.05 "
        "(Koschmieder's law) [1]",
        gt=0.0,
        le=1.0,
    )
    half_seen_visible: float = Field(
        0.25,
        description="unoccluded share at which half are missed; typical [1]",
        gt=0.0,
        le=1.0,
    )
    vehicle_miss_frames: float = Field(
        4.1,
        description="mean length of a gap: misses come in runs (Jha et al., ML-driven malware that targets AV "
        "safety, DSN 2020, models them so; the length is typical) [messages]",
        ge=1.0,
    )
    plain_miss_frames: float = Field(
        1.3,
        description="the same for objects in plain view, whose misses are chance; an assumption: the published means "
        "are over objects of all distances. Between, it grows with the share missed [messages]",
        ge=1.0,
    )
    person_miss_frames: float = Field(2.4, description="the same for people; typical [messages]", ge=1.0)
    confusion: float = Field(
        0.02,
        description="share of messages with the label of a similar class (car and van, truck and bus), in runs as "
        "long as those of misses; typical [1]",
        ge=0.0,
        le=1.0,
    )
    false_positives: float = Field(
        0.03,
        description="objects that are not there, beginning per message; typical [1]",
        ge=0.0,
        le=10.0,
    )
    false_positive_frames: float = Field(1.5, description="mean life of such an object [messages]", ge=1.0)
    box_jitter: float = Field(
        0.02,
        description="error of each edge, standard deviation relative to the box's side: mean overlaps with the truth "
        "of 0.9 and more; typical [1]",
        ge=0.0,
    )
    box_jitter_floor_px: float = Field(0.7, description="the same, at least [px]", ge=0.0)
    vehicle_position_m: float = Field(
        0.135,
        description="error of a car's position, standard deviation each axis; 0.169 m mean distance on nuScenes "
        "(TransFusion, validation set, its issue 88), divided by 1.25 [m]",
        ge=0.0,
    )
    large_position_m: float = Field(
        0.24, description="the same of trucks and buses: 0.302 m (same source) [m]", ge=0.0
    )
    person_position_m: float = Field(
        0.10, description="the same of people: 0.128 m (same source) [m]", ge=0.0
    )
    position_correlation_s: float = Field(
        0.5, description="time in which that error is forgotten: a tracker smooths [s]", gt=0.0
    )
    lidar_range_m: float = Field(
        80.0, description="no position in space beyond; returns of dark cars thin out there [m]", ge=0.0
    )
    track_memory_frames: int = Field(
        5, description="a track that is missed longer comes back under a new id [messages]", ge=0
    )
    patch: Literal["none", "hide", "relabel"] = Field(
        "hide", description="what an adversarial patch in view does to the object that bears it"
    )
    patch_label: str = Field("bird", description="the label it gets, where it is relabelled")
    patch_rate: float = Field(
        0.9,
        description="share of messages in which the patch works while it is in view; typical of printed "
        "patches close by [1]",
        ge=0.0,
        le=1.0,
    )
    arrival: Arrival = Arrival(delay_ms=50.0, jitter_ms=8.0)
