"""Ψ of equation (6), default profile: each corner is followed into the new image and verified by its patch.

Pyramidal Lucas-Kanade, inverse compositional (Baker and Matthews, "Lucas-Kanade 20 Years On", IJCV 2004),
translation only, with the patch's mean and contrast normalised, so that exposure may jump. A match is accepted
only if the normalised cross-correlation of the two patches says that they show the same thing. The nearest-corner
rule of the paper (`matching.py`) accepts any corner; this one accepts none that does not look alike.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from belie.geometry import compiled
from belie.types import GrayImage, Settings, read_only

Pyramid = tuple[GrayImage, ...]
_SIDE = 16  # of a patch, px; a constant and a power of two, so that the loops become vector code
_WIDE = _SIDE + 2  # with a margin of one pixel, for the slopes
_HALF = 0.5 * (_SIDE - 1)
_WORTH_A_THREAD = 100  # corners; handing work over costs some 0.05 ms


class TrackingSettings(Settings):
    """How corners are followed from image to image."""

    levels: int = Field(4, ge=1, le=8, description="levels of the image pyramid, each half the size [count]")
    iterations: int = Field(12, ge=1, le=100, description="most Gauss-Newton steps a level [count]")
    min_correlation: float = Field(
        0.75, ge=0.0, le=1.0,
        description="least normalised cross-correlation of two patches that show the same thing [1]; two patches of "
        "equal noise and signal power reach 0.5, unrelated patches of 16x16 px stay under 0.3",
    )  # fmt: skip
    min_eigenvalue: float = Field(
        4.0, ge=0.0,
        description="least eigenvalue of the structure tensor, a pixel's mean [gray²/px²]; sensor noise of 2 gray "
        "levels alone gives 2. Less where that leaves too few corners: eight times what the image's noise gives for "
        "the camera's motion, twice that on objects",
    )  # fmt: skip


def build_pyramid(image: GrayImage, levels: int) -> Pyramid:
    """Halve the image until `levels` are made or a side would fall under 24 px.

    >>> [level.shape for level in build_pyramid(np.zeros((100, 160), np.uint8), 4)]
    [(100, 160), (50, 80), (25, 40)]
    """
    pyramid = [read_only(image)]
    while len(pyramid) < levels and min(pyramid[-1].shape) >= 48:
        pyramid.append(read_only(np.asarray(cv2.pyrDown(pyramid[-1]), dtype=np.uint8)))
    return tuple(pyramid)


@compiled(reassociate=True)
def _sample(image: Any, x: float, y: float, out: Any) -> bool:
    """Bilinear patch around (x, y) with a margin of one pixel; False if it leaves the image."""
    height, width = image.shape
    x -= _HALF + 1.0
    y -= _HALF + 1.0
    x0 = int(np.floor(x))
    y0 = int(np.floor(y))
    if x0 < 0 or y0 < 0 or x0 + _WIDE >= width or y0 + _WIDE >= height:
        return False
    ax = np.float32(x - x0)
    ay = np.float32(y - y0)
    w00 = (np.float32(1.0) - ax) * (np.float32(1.0) - ay)
    w01 = ax * (np.float32(1.0) - ay)
    w10 = (np.float32(1.0) - ax) * ay
    w11 = ax * ay
    for j in range(_WIDE):
        row = image[y0 + j, x0 : x0 + _WIDE + 1]  # a slice: no wrap-around test for every index
        below = image[y0 + j + 1, x0 : x0 + _WIDE + 1]
        for i in range(_WIDE):
            out[j, i] = (
                w00 * np.float32(row[i])
                + w01 * np.float32(row[i + 1])
                + w10 * np.float32(below[i])
                + w11 * np.float32(below[i + 1])
            )
    return True


@compiled(reassociate=True)
def _correlate(
    image: Any, x: float, y: float, offset: Any, template: Any, gx: Any, gy: Any
) -> tuple[Any, Any, Any, Any, Any]:
    """Sums over the patch at (x, y) of: value, value², value·template, value·gx, value·gy.

    `offset` is subtracted from every value first: it keeps float32 sums exact. The second sum is negative
    where the patch leaves the image. Template and slopes (with a margin that does not count) have zero mean, so the
    patch's mean drops out.
    """
    height, width = image.shape
    zero = np.float32(0.0)
    x -= _HALF
    y -= _HALF
    x0 = int(np.floor(x))
    y0 = int(np.floor(y))
    if x0 < 0 or y0 < 0 or x0 + _SIDE >= width or y0 + _SIDE >= height:
        return zero, np.float32(-1.0), zero, zero, zero
    ax = np.float32(x - x0)
    ay = np.float32(y - y0)
    w00 = (np.float32(1.0) - ax) * (np.float32(1.0) - ay)
    w01 = ax * (np.float32(1.0) - ay)
    w10 = (np.float32(1.0) - ax) * ay
    w11 = ax * ay
    total = zero
    energy = zero
    cross = zero
    bx = zero
    by = zero
    for j in range(_SIDE):
        row = image[y0 + j, x0 : x0 + _SIDE + 1]
        below = image[y0 + j + 1, x0 : x0 + _SIDE + 1]
        template_row, gx_row, gy_row = template[j + 1, 1:], gx[j + 1, 1:], gy[j + 1, 1:]
        for i in range(_SIDE):
            value = (
                w00 * np.float32(row[i])
                + w01 * np.float32(row[i + 1])
                + w10 * np.float32(below[i])
                + w11 * np.float32(below[i + 1])
                - offset
            )
            total += value
            energy += value * value
            cross += value * template_row[i]
            bx += value * gx_row[i]
            by += value * gy_row[i]
    return total, energy, cross, bx, by


@compiled(reassociate=True)
def track_level(
    previous: Any, current: Any, start: Any, found: Any, alive: Any, correlation: Any,
    scale: float, iterations: int, min_eigenvalue: float, harris: float, last: bool,
) -> None:  # fmt: skip
    """Refine `found` (full-resolution px) on one pyramid level, in place."""
    area = np.float32(_SIDE * _SIDE)
    zero = np.float32(0.0)
    half = np.float32(0.5)
    # Patch, template and slopes lie flat, margin and all: one long loop over each becomes vector code.
    wide, template = np.empty(_WIDE * _WIDE, np.float32), np.zeros(_WIDE * _WIDE, np.float32)
    gx, gy = np.zeros(_WIDE * _WIDE, np.float32), np.zeros(_WIDE * _WIDE, np.float32)
    counts = np.zeros((_WIDE, _WIDE), np.float32)
    counts[1:-1, 1:-1] = 1.0
    inner = counts.ravel()
    shape = (_WIDE, _WIDE)
    patch, template_2d, gx_2d, gy_2d = (
        wide.reshape(shape), template.reshape(shape), gx.reshape(shape), gy.reshape(shape),
    )  # fmt: skip
    tolerance = 0.01 if last else 0.05  # px of this level; coarse levels only have to come near
    for k in range(start.shape[0]):
        if not alive[k]:
            continue
        # cv2.pyrDown keeps pixel (0, 0) on pixel (0, 0): coordinates simply halve
        px = start[k, 0] * scale
        py = start[k, 1] * scale
        if not _sample(previous, px, py, patch):
            if last:
                alive[k] = False
            continue
        offset = patch[_SIDE // 2, _SIDE // 2]  # keeps the float32 sums exact
        mean = zero
        power = zero
        sx = zero
        sy = zero
        hxx = zero
        hxy = zero
        hyy = zero
        tx = zero
        ty = zero
        for i in range(_WIDE, _WIDE * (_WIDE - 1)):
            template[i] = (wide[i] - offset) * inner[i]
        for i in range(_WIDE, _WIDE * (_WIDE - 1)):
            gx[i] = half * (wide[i + 1] - wide[i - 1]) * inner[i]
        for i in range(_WIDE, _WIDE * (_WIDE - 1)):
            gy[i] = half * (wide[i + _WIDE] - wide[i - _WIDE]) * inner[i]
        for i in range(_WIDE, _WIDE * (_WIDE - 1)):
            value, dx_image, dy_image = template[i], gx[i], gy[i]
            mean += value
            power += value * value
            sx += dx_image
            sy += dy_image
            hxx += dx_image * dx_image
            hxy += dx_image * dy_image
            hyy += dy_image * dy_image
            tx += dx_image * value
            ty += dy_image * value
        mean /= area
        sx /= area
        sy /= area
        # the mean is removed from both patches, so from their slopes too
        power -= area * mean * mean
        hxx -= area * sx * sx
        hxy -= area * sx * sy
        hyy -= area * sy * sy
        tx -= area * sx * mean
        ty -= area * sy * mean
        for i in range(_WIDE, _WIDE * (_WIDE - 1)):
            template[i] -= mean
        for i in range(_WIDE, _WIDE * (_WIDE - 1)):
            gx[i] -= sx
        for i in range(_WIDE, _WIDE * (_WIDE - 1)):
            gy[i] -= sy
        mean += offset
        determinant = hxx * hyy - hxy * hxy
        trace = hxx + hyy
        discriminant: Any = trace * trace - 4.0 * determinant
        smallest = 0.5 * (trace - np.sqrt(max(0.0, discriminant)))
        is_edge = last and determinant <= harris * trace * trace
        if smallest < min_eigenvalue * area or determinant <= 0.0 or is_edge:
            if last:
                alive[k] = False
            continue
        x = found[k, 0] * scale
        y = found[k, 1] * scale
        inside = False
        ncc: Any = zero
        for _ in range(iterations):
            total, energy, cross, bx, by = _correlate(current, x, y, mean, template_2d, gx_2d, gy_2d)
            inside = energy >= 0.0
            if not inside:
                break
            energy -= total * total / area
            # less than one gray level of contrast is the quantiser's noise: it correlates with anything
            ncc = cross / np.sqrt(energy * power) if energy > area else zero
            contrast: Any = np.sqrt(power / (energy + np.float32(1e-6)))
            gain = min(max(contrast, np.float32(0.4)), np.float32(2.5))
            ex = gain * bx - tx
            ey = gain * by - ty
            dx = (hyy * ex - hxy * ey) / determinant
            dy = (hxx * ey - hxy * ex) / determinant
            length = np.sqrt(dx * dx + dy * dy)
            if length > _HALF:  # a step longer than the patch leaves the range of the linearisation
                dx *= _HALF / length
                dy *= _HALF / length
            x -= dx
            y -= dy
            if length < tolerance:
                break
        if inside:
            found[k, 0] = x / scale
            found[k, 1] = y / scale
            correlation[k] = ncc
        elif last:
            alive[k] = False


def track(
    previous: Pyramid,
    current: Pyramid,
    points_px: npt.NDArray[np.float64],
    predicted_px: npt.NDArray[np.float64],
    settings: TrackingSettings,
    harris: float = 0.0,
    min_eigenvalue: float | None = None,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """Follow corners from one pyramid to the next.

    Parameters
    ----------
    previous, current : tuple of images
        From `build_pyramid`, of equal sizes.
    points_px, predicted_px : arrays (N, 2)
        Corners in the previous image; where to start looking in the current one.
    harris : float
        Least share of the structure tensor's squared trace that its determinant has (Harris and Stephens, 1988): a
        patch of an edge slides along it.
    min_eigenvalue : float or None
        Instead of the settings' own.

    Returns
    -------
    found_px : array (N, 2)
    verified : array (N,), bool
        True where the patches correlate by at least `min_correlation`.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> image = cv2.GaussianBlur(rng.integers(0, 255, (80, 80), np.uint8), (0, 0), 2)
    >>> moved = np.roll(image, (1, 3), (0, 1))
    >>> s = TrackingSettings(levels=2)
    >>> start = np.array([[40.0, 40.0]])
    >>> found, ok = track(build_pyramid(image, 2), build_pyramid(moved, 2), start, start, s)
    >>> found.round(1), ok
    (array([[43., 41.]]), array([ True]))
    """
    found = np.array(predicted_px, dtype=np.float64)
    start = np.asarray(points_px, dtype=np.float64)
    alive = np.asarray(np.isfinite(found).all(axis=1))
    correlation = np.zeros(len(found))
    least = settings.min_eigenvalue if min_eigenvalue is None else min_eigenvalue

    def follow(part: slice) -> None:
        for level in range(min(len(previous), len(current)) - 1, -1, -1):
            track_level(
                previous[level], current[level], start[part], found[part], alive[part], correlation[part],
                0.5**level, settings.iterations, least, harris, level == 0,
            )  # fmt: skip

    if len(found) >= _WORTH_A_THREAD and cv2.getNumThreads() > 1:
        half = len(found) // 2
        other = second_thread().submit(follow, slice(half, None))
        follow(slice(0, half))
        other.result()
    else:
        follow(slice(None))
    return found, alive & (correlation >= settings.min_correlation)


@cache
def second_thread() -> ThreadPoolExecutor:
    """The one that helps where OpenCV is allowed more than one; the kernels hold no lock."""
    return ThreadPoolExecutor(1, thread_name_prefix="belie-second")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=second_thread.cache_clear)  # a forked process has no second thread
