"""Noise of an honest position and drift of an honest odometry: what the position check may call normal."""

from __future__ import annotations

from pydantic import Field

from belie.types import Settings


class PositionSettings(Settings):
    """What may lie between a position and the odometry without anybody lying.

    >>> PositionSettings().multipath_time_s
    30.0
    """

    unknown_sigma_m: float = Field(
        1.0, gt=0.0,
        description="noise of a position whose covariance is not told, before any was seen; the true one is "
        "learned [m, each axis]",
    )  # fmt: skip
    least_sigma_m: float = Field(
        0.001, gt=0.0, description="no position without a covariance is believed to be better than this [m]"
    )
    multipath_time_s: float = Field(
        30.0,
        gt=0.0,
        description="correlation time of the slow part of a position's noise (GNSS multipath) [s]",
    )
    clock_sigma_s: float = Field(
        0.1, ge=0.0, description="constant delay of the position against the odometry; estimated [s]"
    )
    clock_jitter_s: float = Field(
        0.005, ge=0.0, description="what varies of that delay from claim to claim [s]"
    )
    lever_sigma_m: float = Field(
        0.3,
        ge=0.0,
        description="error of a GNSS antenna's stated place on the body; estimated [m, each axis]",
    )
    odometry_walk_m: float = Field(
        0.02, ge=0.0, description="random walk of the odometry's position [m per sqrt(m)]"
    )
    standing_walk_m: float = Field(
        0.005, ge=0.0, description="wander between position and odometry at standstill [m per sqrt(s)]"
    )
    heading_walk_deg: float = Field(
        0.02,
        ge=0.0,
        description="random walk of the odometry's attitude, each axis [deg per sqrt(m)]; what a camera "
        "vouches for is 0.02 deg a frame",
    )
    scale_sigma: float = Field(0.02, ge=0.0, description="relative error of the odometry's scale [1]")
    scale_walk: float = Field(0.0005, ge=0.0, description="how that error wanders [relative, per sqrt(m)]")
    tilt_sigma_deg: float = Field(
        2.0,
        ge=0.0,
        description="how far the odometry's up axis may be off the vertical, frames not shared [deg]",
    )
    shared_sigma_deg: float = Field(
        0.5,
        ge=0.0,
        description="rotation between position and odometry where both share a frame [deg, each axis]",
    )
    heading_known_deg: float = Field(
        5.0, gt=0.0, le=15.0,
        description="standard deviation of the estimated heading between two frames at which the full test "
        "begins [deg]; a straight line is a good model of the circle up to here",
    )  # fmt: skip
    prior_scale: float = Field(
        3.0,
        gt=0.0,
        description="noise expected before any was seen, in units of the declared or unknown sigma [1]",
    )
    learning_claims: int = Field(
        20,
        ge=5,
        description="believed claims before slow lies are looked for, and CONSISTENT is said [count]",
    )
    memory_claims: int = Field(
        600, ge=50, description="believed claims that the noise is learned from [count]; a minute at 10 Hz"
    )
    waiting_claims: int = Field(
        50, ge=0,
        description="claims that must be believed after one before it counts as noise [count]: a slow lie is "
        "tested against the noise from before it",
    )  # fmt: skip
    most_floor_m: float = Field(
        50.0, gt=0.0,
        description="smallest detectable jump beyond which a position says too little to be called consistent [m]",
    )  # fmt: skip
