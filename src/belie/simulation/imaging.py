"""What lies between the light and the image file: lens, exposure, rolling shutter, glare, rain, noise."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from belie.geometry import SE3, CameraModel, FloatArray
from belie.simulation.glare import Glare
from belie.simulation.projection import sun_direction
from belie.simulation.rain import add_streaks
from belie.simulation.sensor_noise import SensorNoise
from belie.simulation.weather import Weather
from belie.simulation.world import World
from belie.types import Settings

Image = npt.NDArray[np.uint8]
FloatImage = npt.NDArray[np.float32]

_MOST_TAPS = 5
_PX_A_TAP = 3.0


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


class Imaging:
    """Makes a camera's image of the light that a pinhole saw; made and owned by `Renderer`.

    Parameters
    ----------
    camera : CameraModel
        The camera of the image.
    pinhole : CameraModel
        The camera that the light was rendered for.
    world, weather : World, Weather
        Where the sun stands, how it rains, how noisy it is.
    seed : int
        Of rain and noise.
    settings : ImagingSettings
        The device.
    """

    def __init__(
        self,
        camera: CameraModel,
        pinhole: CameraModel,
        world: World,
        weather: Weather,
        seed: int,
        settings: ImagingSettings,
    ) -> None:
        self._camera, self._weather, self._settings, self._seed = camera, weather, settings, seed
        self.lens_map = lens_map(camera, pinhole) if camera.is_distorted else None
        self.needs_motion = settings.rolling_shutter or (settings.motion_blur and weather.exposure_ms > 0.0)
        shape = (camera.height, camera.width)
        self._grid = np.stack(np.meshgrid(*(np.arange(n, dtype=np.float32) for n in shape[::-1])), axis=2)
        self._noise = SensorNoise(shape, weather.noise * settings.noise_scale, seed)
        self._rains = weather.rain_mm_h > 0.0 and not world.is_indoors
        dazzles = weather.glare > 0.0 and not world.is_indoors
        towards_sun = sun_direction(weather, world.street_direction_rad)
        self._glare = Glare(camera, towards_sun, weather) if dazzles else None

    def expose(self, light: Image, truth: FloatImage | None, t_s: float, T_world_cam: SE3) -> Image:
        """The image, shape (H, W, 3), BGR.

        Parameters
        ----------
        light : array (h, w, 4)
            RGBA of the pinhole.
        truth : array (h, w, 4) or None
            Depth, id and motion of the pinhole's pixels; None: nothing moves.
        t_s : float
            When.
        T_world_cam : SE3
            From where.
        """
        bgr = cv2.cvtColor(light, cv2.COLOR_RGBA2BGR)
        image = self._through_lens(bgr, truth)
        moment = round(t_s * 1e6)
        if self._glare is not None and truth is not None:
            depth_m = truth[..., 0]
            if self.lens_map is not None:
                depth_m = cv2.remap(depth_m, *self.lens_map, cv2.INTER_NEAREST)
            image = self._glare.add(image, depth_m, T_world_cam)
        if self._rains:
            image = add_streaks(
                image, self._weather, self._camera, np.random.default_rng([self._seed, 31, abs(moment)])
            )
        return self._noise.add(image, np.random.default_rng([self._seed, 32, abs(moment)]))

    def _through_lens(self, bgr: Image, truth: FloatImage | None) -> Image:
        motion = self._motion(truth)
        base = self._grid if self.lens_map is None else np.dstack(self.lens_map)
        if motion is None:
            return bgr if self.lens_map is None else cv2.remap(bgr, *self.lens_map, cv2.INTER_LINEAR)
        s = self._settings
        exposure_s = 1e-3 * self._weather.exposure_ms if s.motion_blur else 0.0
        # The fastest pixels set the number of samples, up to a bound: beyond it the smear is coarse but long enough.
        fast = float(np.percentile(np.abs(motion[::8, ::8]).max(axis=2), 98.0)) * exposure_s
        taps = int(np.clip(np.ceil(fast / _PX_A_TAP), 1, _MOST_TAPS)) if fast > 0.4 else 1
        if taps == 1 and not s.rolling_shutter:
            return bgr if self.lens_map is None else cv2.remap(bgr, *self.lens_map, cv2.INTER_LINEAR)
        place = self._rolled(base, motion) if s.rolling_shutter else base
        if taps == 1:
            return np.asarray(cv2.remap(bgr, place, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
        total = np.zeros((*place.shape[:2], 3), np.float32)
        for share in (np.arange(taps) + 0.5) / taps - 0.5:
            shifted = cv2.scaleAdd(motion, -float(share) * exposure_s, place)
            sample = cv2.remap(bgr, shifted, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            cv2.accumulate(sample, total)
        return np.asarray(cv2.convertScaleAbs(total, alpha=1.0 / taps))

    def _rolled(self, base: FloatImage, motion: FloatImage) -> FloatImage:
        """Where each row finds what it sees: later, a point lies farther along its motion, so it came from behind."""
        late_s = ((self._grid[..., 1:] + 0.5) / self._camera.height - 0.5) * (
            1e-3 * self._settings.readout_ms
        )
        return np.asarray(base - motion * late_s)

    def _motion(self, truth: FloatImage | None) -> FloatImage | None:
        """Motion of each pixel of the image, px/s, shape (H, W, 2)."""
        if truth is None or not self.needs_motion:
            return None
        motion = np.ascontiguousarray(truth[..., 2:])
        if self.lens_map is not None:
            motion = cv2.remap(motion, *self.lens_map, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
        return motion


def lens_map(camera: CameraModel, pinhole: CameraModel) -> tuple[FloatImage, FloatImage]:
    """For each pixel of the image its place (x, y) in the pinhole's picture, two arrays (H, W).

    >>> camera = CameraModel(width=8, height=6, fx=9, fy=9, cx=3.5, cy=2.5)
    >>> x, y = lens_map(camera, camera)
    >>> x[0].round(3).tolist()
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    """
    grid = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=2).reshape(-1, 2)
    flat: FloatArray = camera.normalize(grid.astype(np.float64))
    place = flat * (pinhole.fx, pinhole.fy) + (pinhole.cx, pinhole.cy)
    shape = (camera.height, camera.width)
    return place[:, 0].reshape(shape).astype(np.float32), place[:, 1].reshape(shape).astype(np.float32)
