"""What no honest camera shows, and for how long it must be seen: the settings of the camera check."""

from __future__ import annotations

from pydantic import Field

from belie.checks.stillness import StillnessSettings
from belie.types import Settings


class CameraSettings(Settings):
    """When a camera is called frozen, replayed, black or covered."""

    stillness: StillnessSettings = StillnessSettings()
    stop_m_s2: float = Field(
        15.0, gt=0.0,
        description="deceleration that no robot reaches [m/s²]; grip gives 8 to 10, a race car's tyres 15",
    )  # fmt: skip
    blank_gray: float = Field(
        3.0, ge=0.0,
        description="an image whose cells vary by less is blank [gray]; noise of 2 gray levels leaves 0.2",
    )  # fmt: skip
    blank_ratio: float = Field(
        0.2, gt=0.0, lt=1.0,
        description="so is one whose cells vary by less than this share of what they did [1]; halving the "
        "exposure leaves 0.5",
    )  # fmt: skip
    blank_frames: int = Field(
        3, ge=1, description="blank images at once after structured ones that make a fault [count]"
    )
    lost_ratio: float = Field(
        0.3, gt=0.0, lt=1.0,
        description="the scene is another if fewer than this share of the usual corners are found again [1]",
    )  # fmt: skip
    exact_images: int = Field(
        100_000,
        ge=100,
        description="images that an exact repeat is recognised of [count]; an hour at 28 Hz, 17 MB",
    )
    near_s: float = Field(60.0, gt=0.0, description="age up to which a re-encoded repeat is recognised [s]")
    near_images: int = Field(
        1800, ge=100, description="images that a re-encoded repeat is recognised of [count]; 2.5 kB each"
    )
    near_ratio: float = Field(
        0.25, gt=0.0, lt=0.5,
        description="a repeat is nearer to the old image than this share of the old sequence's step from "
        "frame to frame [1]; re-encoding leaves 0.11, the nearest honest image of real drives is at 0.9",
    )  # fmt: skip
    near_lag: int = Field(5, ge=2, description="images back before a near repeat counts [count]")
    replayed_frames: int = Field(
        2,
        ge=2,
        description="consecutive repeats of older images that make a fault [count]; one may be a stray",
    )
    release_s: float = Field(
        1.0,
        ge=0.0,
        description="time of normal images after which a fault is over [s]; a new one is a new alert",
    )
