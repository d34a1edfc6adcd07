"""What lies between the light and the image file: lens, exposure, rolling shutter, noise, rain, glare."""

from __future__ import annotations

from pydantic import Field

from belie.types import Settings


class ImagingSettings(Settings):
    """The camera as a device.

    >>> ImagingSettings().rolling_shutter
    False
    """

    rolling_shutter: bool = Field(False, description="whether rows are exposed one after another")
    readout_ms: float = Field(
        18.0,
        description="from the first row to the last: common for CMOS sensors of 1 to 2 Mpx [ms]",
        ge=0.0,
        le=60.0,
    )
    motion_blur: bool = Field(True, description="whether what moves smears over the exposure time")
    noise_scale: float = Field(
        1.0, description="times the noise that the weather's light brings", ge=0.0, le=10.0
    )
