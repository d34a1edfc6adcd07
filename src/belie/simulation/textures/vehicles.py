"""What a body of sheet metal looks like from the side, from the front and from behind; and wheels."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from belie.simulation.textures.noise import Rgba, fbm, rgba

SIDE_WIDTH, SIDE_HEIGHT = 1024, 384
_SEAM = 0.34


@lru_cache(maxsize=16)
def side(kind: str, wheels: tuple[float, ...], radius: float) -> Rgba:
    """A side view of a body: seams of the doors, handles, arches of the wheels, sill; near white, to be tinted.

    Parameters
    ----------
    kind : str
        car, van, truck or bus.
    wheels : tuple of float
        Where the wheels are, as shares of the length from the rear.
    radius : float
        Of the arches, as a share of the length.
    """
    w, h = SIDE_WIDTH, SIDE_HEIGHT
    noise = fbm(1024, 51, slope=1.6)[:h]
    image = np.zeros((h, w, 3), np.float32) + (0.90 + 0.09 * (noise[..., None] - 0.5))
    dirt = np.clip(np.linspace(-1.2, 1.0, h, dtype=np.float32)[:, None] + 0.6 * (noise - 0.5), 0.0, 1.0)
    image *= 1.0 - 0.30 * dirt[..., None]
    image[int(0.86 * h) :] *= 0.25  # sill
    seams = {
        "car": (0.30, 0.50, 0.685),
        "van": (0.06, 0.36, 0.62, 0.80),
        "truck": (0.78,),
        "bus": (0.12, 0.45, 0.80),
    }[kind]
    for x in seams:
        cv2.line(
            image, (int(x * w), int(0.08 * h)), (int(x * w), int(0.84 * h)), (_SEAM,) * 3, 3, cv2.LINE_AA
        )
        if kind in ("car", "van") and x > 0.2:
            cv2.ellipse(
                image,
                (int(x * w) - 150 + 105, int(0.30 * h)),
                (20, 6),
                0,
                0,
                360,
                (0.22,) * 3,
                -1,
                cv2.LINE_AA,
            )
    cv2.line(
        image, (0, int(0.55 * h)), (w, int(0.50 * h)), (0.66,) * 3, 3, cv2.LINE_AA
    )  # a crease in the metal
    cv2.line(image, (0, int(0.55 * h) + 4), (w, int(0.50 * h) + 4), (1.0,) * 3, 2, cv2.LINE_AA)
    if kind == "truck":
        for x in range(30, int(0.76 * w), 46):
            image[: int(0.84 * h), x : x + 5] *= 0.72
    if kind == "bus":
        image[int(0.60 * h) : int(0.70 * h)] *= 0.55
    for x in wheels:
        middle = (int(x * w), h - 8)
        cv2.circle(image, middle, int(radius * w * 1.20), (0.06,) * 3, -1, cv2.LINE_AA)
        cv2.circle(image, middle, int(radius * w * 1.24), (0.55,) * 3, 3, cv2.LINE_AA)
    return rgba(image)


@lru_cache(maxsize=8)
def end(kind: str, is_front: bool) -> Rgba:
    """The front or the rear of a body: grille or boot lid, bumper; near white, to be tinted."""
    h, w = 256, 384
    noise = fbm(512, 52, slope=1.5)[:h, :w]
    image = np.zeros((h, w, 3), np.float32) + (0.88 + 0.1 * (noise[..., None] - 0.5))
    grey = (0.10,) * 3
    if is_front:
        cv2.rectangle(image, (110, 70), (274, 118), grey, -1)
        for y in range(78, 116, 9):
            cv2.line(image, (114, y), (270, y), (0.45,) * 3, 2, cv2.LINE_AA)
        cv2.rectangle(image, (60, 178), (324, 222), grey, -1)
    else:
        cv2.rectangle(image, (86, 12), (298, 142), (0.5,) * 3, 3)
        if kind in ("van", "truck"):
            cv2.line(image, (192, 0), (192, 168), (0.3,) * 3, 4)
            for x in (176, 208):
                cv2.line(image, (x, 60), (x, 100), (0.15,) * 3, 6)
        cv2.line(image, (0, 168), (w, 168), (_SEAM,) * 3, 3)
        cv2.rectangle(image, (50, 214), (334, 240), grey, -1)
    image[-14:] *= 0.3
    return rgba(image)


@lru_cache(maxsize=2)
def glass() -> Rgba:
    """A car's window: dark, with the sky above in it and the seats behind."""
    h = 128
    down = np.linspace(0.0, 1.0, h, dtype=np.float32)[:, None]
    noise = fbm(256, 53, slope=1.7)[:h]
    value = 0.24 - 0.17 * down + 0.10 * (noise - 0.5)
    image = np.ascontiguousarray(np.stack([value * 0.9, value, value * 1.12], axis=2), np.float32)
    for x in (60, 178):
        cv2.rectangle(image, (x - 17, 62), (x + 17, 128), (0.05,) * 3, -1)
        cv2.ellipse(image, (x, 52), (10, 14), 0, 0, 360, (0.05,) * 3, -1, cv2.LINE_AA)
    image[:4] = image[-4:] = 0.05
    return rgba(image)


@lru_cache(maxsize=2)
def wheel() -> Rgba:
    """Tyre and rim; the tread is taken from the outermost ring."""
    size = 192
    y, x = np.mgrid[0:size, 0:size] - 0.5 * (size - 1)
    radius, angle = np.hypot(x, y) / (0.5 * size), np.arctan2(y, x)
    spokes = 0.5 + 0.5 * np.cos(5.0 * angle)
    rim = np.where(spokes > 0.45, 0.66, 0.10) * (1.0 - 0.3 * radius)
    rim = np.where(radius < 0.16, 0.5, rim)
    value = np.where(radius < 0.60, rim, 0.085)
    value = np.where(np.abs(radius - 0.61) < 0.03, 0.70, value)
    value = value + 0.04 * (fbm(256, 54, slope=0.6)[:size, :size] - 0.5)
    return rgba(np.repeat(value[..., None], 3, axis=2).astype(np.float32))


def lamp(colour: tuple[float, float, float], glow: float) -> npt.NDArray[np.uint8]:
    """A lamp's ribbed glass that glows at night."""
    return _lamp(colour, glow)


@lru_cache(maxsize=16)
def _lamp(colour: tuple[float, float, float], glow: float) -> Rgba:
    ribs = 0.85 + 0.15 * np.sin(np.arange(64) * 0.8)[None, :] * np.ones((48, 1))
    image = ribs[..., None].astype(np.float32) * np.array(colour, np.float32)
    image[:3] = image[-3:] = image[:, :3] = image[:, -3:] = 0.2
    return rgba(image, glow)


@lru_cache(maxsize=4)
def cloth(seed: int) -> Rgba:
    """Woven cloth with folds; near white, to be tinted."""
    value = (
        0.74
        + 0.34 * (fbm(128, seed, slope=1.5, stretch=0.6) - 0.5)
        + 0.14 * (fbm(128, seed + 1, slope=0.3, lowest=12) - 0.5)
    )
    return rgba(np.repeat(value[..., None], 3, axis=2))


@lru_cache(maxsize=2)
def sheet() -> Rgba:
    """Painted sheet metal: almost even; near white, to be tinted."""
    value = 0.93 + 0.05 * (fbm(128, 57, slope=1.5) - 0.5) + 0.02 * (fbm(128, 58, slope=0.4, lowest=12) - 0.5)
    return rgba(np.repeat(value[..., None], 3, axis=2))
