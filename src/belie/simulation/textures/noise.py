"""Noise that tiles: the ground of every texture."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt
import scipy.fft

Noise = npt.NDArray[np.float32]
Rgba = npt.NDArray[np.uint8]


@lru_cache(maxsize=64)
def fbm(size: int, seed: int, *, slope: float = 1.6, lowest: int = 2, stretch: float = 1.0) -> Noise:
    """Fractal noise by spectral synthesis, shape (size, size), 0 to 1, seamless.

    Parameters
    ----------
    size : int
        Pixels a side.
    seed : int
        Of the phases.
    slope : float
        Amplitude falls with frequency to this power: 0.5 is grainy, 2 is cloudy.
    lowest : int
        Waves a side of the lowest frequency.
    stretch : float
        Above 1 the grain is longer in x.

    Examples
    --------
    >>> noise = fbm(64, 1)
    >>> noise.shape, float(noise.min()), float(noise.max())
    ((64, 64), 0.0, 1.0)
    """
    rng = np.random.default_rng([seed, size])
    fy = (np.fft.fftfreq(size) * size).astype(np.float32)[:, None]
    fx = (np.fft.rfftfreq(size) * size).astype(np.float32)[None, :]
    frequency = np.sqrt((fx * np.float32(stretch)) ** 2 + fy**2)
    amplitude = np.where(frequency >= lowest, np.maximum(frequency, 1.0) ** np.float32(-slope), 0.0)
    phase = rng.random(frequency.shape, dtype=np.float32) * np.float32(2.0 * np.pi)
    spectrum = np.empty(frequency.shape, np.complex64)
    spectrum.real, spectrum.imag = amplitude * np.cos(phase), amplitude * np.sin(phase)
    raw = scipy.fft.irfft2(spectrum, s=(size, size))  # in single precision, which numpy's does not keep
    # Percentiles, not extremes: a single spike must not flatten the rest.
    low, high = np.percentile(raw[::3, ::3], (0.5, 99.5))
    noise: Noise = np.clip((raw - low) / (high - low), 0.0, 1.0).astype(np.float32)
    noise.setflags(write=False)
    return noise


def rgba(rgb: npt.NDArray[np.floating], alpha: npt.NDArray[np.floating] | float = 0.0) -> Rgba:
    """Colours from 0 to 1, shape (H, W, 3), and alpha to a texture, read-only."""
    height, width = rgb.shape[:2]
    image = np.empty((height, width, 4), np.uint8)
    image[..., :3] = np.clip(np.asarray(rgb, np.float32) * 255.0 + 0.5, 0.0, 255.0)
    image[..., 3] = np.clip(np.asarray(alpha, np.float32) * 255.0 + 0.5, 0.0, 255.0)
    image.setflags(write=False)
    return image


def tinted(value: npt.NDArray[np.floating], colour: tuple[float, float, float]) -> npt.NDArray[np.float32]:
    """A grey picture, shape (H, W), in a colour: shape (H, W, 3)."""
    return np.asarray(value, np.float32)[..., None] * np.array(colour, np.float32)


def text(
    image: npt.NDArray[np.float32],
    words: str,
    middle: tuple[float, float],
    height_px: float,
    colour: tuple[float, ...],
) -> None:
    """Write words into a picture, in place, centred."""
    font, thick = cv2.FONT_HERSHEY_DUPLEX, max(1, round(height_px / 9.0))
    scale = height_px / 22.0
    (width, tall), _ = cv2.getTextSize(words, font, scale, thick)
    place = (round(middle[0] - 0.5 * width), round(middle[1] + 0.5 * tall))
    mask = np.zeros(image.shape[:2], np.uint8)  # OpenCV 5 writes into bytes only
    cv2.putText(mask, words, place, font, scale, 255, thick, cv2.LINE_AA)
    share = mask[..., None].astype(np.float32) / 255.0
    image[:] = image * (1.0 - share) + np.array(colour, np.float32) * share
