"""Noise of the sensor: fresh in every frame, stronger where the image is dark and amplified."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

_POOL_MARGIN = 128


class SensorNoise:
    """Adds noise taken from a pool of normal numbers, at a place and with a sign drawn for each frame.

    A pool, because two million fresh normal numbers a frame would cost as much as the picture itself.

    Parameters
    ----------
    shape : (int, int)
        Height and width of the images.
    sigma : float
        Standard deviation at mid-grey, levels of 255.
    seed : int
        Of the pool.

    Examples
    --------
    >>> noise = SensorNoise((64, 64), 2.0, seed=1)
    >>> grey = np.full((64, 64, 3), 128, np.uint8)
    >>> seen = noise.add(grey, np.random.default_rng(0))
    >>> 1.5 < float((seen.astype(float) - grey).std()) < 2.5
    True
    """

    def __init__(self, shape: tuple[int, int], sigma: float, seed: int) -> None:
        self._shape, self._sigma = shape, sigma
        rng = np.random.default_rng([seed, 33])
        rows, columns = shape[0] + _POOL_MARGIN, shape[1] + _POOL_MARGIN
        # Luminance and colour: demosaicing correlates the channels.
        grey = rng.standard_normal((rows, columns, 1), dtype=np.float32)
        colour = rng.standard_normal((rows, columns, 3), dtype=np.float32)
        self._pool = np.clip(0.85 * grey + 0.53 * colour, -5.0, 5.0)

    def add(self, image: npt.NDArray[np.uint8], rng: np.random.Generator) -> npt.NDArray[np.uint8]:
        """The image, shape (H, W, 3), with noise."""
        if self._sigma <= 0.0:
            return image
        y, x = rng.integers(0, _POOL_MARGIN, 2)
        grain = self._pool[y : y + self._shape[0], x : x + self._shape[1]]
        if rng.random() < 0.5:
            grain = grain[:, ::-1]
        sign = 1.0 if rng.random() < 0.5 else -1.0
        noisy = cv2.scaleAdd(np.ascontiguousarray(grain), sign * self._sigma, image.astype(np.float32))
        return np.asarray(cv2.convertScaleAbs(np.maximum(noisy, 0.0, out=noisy)))
