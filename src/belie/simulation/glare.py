"""A low sun in the lens: veiling light about it, a bright core, and ghosts opposite to it."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from belie.geometry import SE3, CameraModel, FloatArray
from belie.simulation.truth_pass import SKY_M
from belie.simulation.weather import Weather

_COLOUR_BGR = np.array([0.62, 0.84, 1.0], np.float32)


class Glare:
    """Veiling glare of the sun; made and owned by `Imaging`.

    The veil follows CIE's disability glare, about ``1 / angle²``, bounded near the sun's disc.

    Parameters
    ----------
    camera : CameraModel
        Of the image.
    towards_sun : array (3,)
        Unit vector, world.
    weather : Weather
        How strong it is.
    """

    def __init__(self, camera: CameraModel, towards_sun: FloatArray, weather: Weather) -> None:
        self._camera, self._towards_sun, self._weather = camera, towards_sun, weather
        # Glare is smooth: an eighth of the resolution does.
        self._small = camera.scaled(0.125)
        u, v = np.meshgrid(np.arange(self._small.width), np.arange(self._small.height))
        pixels = np.column_stack([u.ravel(), v.ravel()]).astype(np.float64)
        rays = np.column_stack([self._small.normalize(pixels), np.ones(len(pixels))])
        self._rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)

    def add(
        self, image: npt.NDArray[np.uint8], depth_m: npt.NDArray[np.float32], T_world_cam: SE3
    ) -> npt.NDArray[np.uint8]:
        """The image, shape (H, W, 3), BGR, with glare; `depth_m` tells whether the sun is hidden."""
        ray = T_world_cam.R.T @ self._towards_sun
        if ray[2] <= 0.05:
            return image
        sun_px = self._camera.project(ray[None])[0]
        free = 0.25 + 0.75 * self._free_share(sun_px, depth_m)
        angle = np.degrees(np.arccos(np.clip(self._rays @ ray, -1.0, 1.0)))
        veil = (
            self._weather.glare
            * free
            * (95.0 / (1.0 + (angle / 9.0) ** 2) + 150.0 / (1.0 + (angle / 1.6) ** 2))
        )
        veil += self._ghosts(sun_px) * free
        picture = veil.reshape(self._small.height, self._small.width, 1).astype(np.float32) * _COLOUR_BGR
        large = cv2.resize(picture, (self._camera.width, self._camera.height), interpolation=cv2.INTER_CUBIC)
        return np.asarray(cv2.add(image, np.clip(large, 0.0, 255.0).astype(np.uint8)))

    def _free_share(self, sun_px: FloatArray, depth_m: npt.NDArray[np.float32]) -> float:
        """Share of the sun's surroundings in the picture where nothing stands before it."""
        x, y = (round(float(v)) for v in sun_px)
        r = max(2, self._camera.width // 120)
        window = depth_m[max(0, y - r) : max(0, y + r + 1), max(0, x - r) : max(0, x + r + 1)]
        return float((window > SKY_M).mean()) if window.size else 0.5

    def _ghosts(self, sun_px: FloatArray) -> FloatArray:
        """Faint discs on the line through the sun and the middle of the image."""
        small, scale = self._small, 0.125
        middle = np.array([small.cx, small.cy])
        offset = sun_px * scale - middle
        ghosts = np.zeros((small.height, small.width), np.float32)
        for along, size, bright in ((-0.5, 0.045, 10.0), (-0.95, 0.09, 7.0), (0.42, 0.025, 9.0)):
            place = middle + along * offset
            if np.abs(place).max() < 4 * small.width:
                cv2.circle(
                    ghosts,
                    tuple(np.round(place).astype(int).tolist()),
                    max(1, round(size * small.width)),
                    bright,
                    -1,
                    cv2.LINE_AA,
                )
        return np.asarray(cv2.GaussianBlur(ghosts, (0, 0), 1.0), np.float64).ravel()
