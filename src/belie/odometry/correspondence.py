"""The same corner in two images: what the triangulation of equation (3) needs and the paper leaves open.

Corners are compared with corners, by the correlation of the patches around them, mutually best, within
a bound on the motion. Why not LK tracks: they cost more (10 to 20 ms for 800 points on the machine this
was written on, against 2 to 3 ms), and they leave the corner, while Ψ of equation (6) compares with
corners; a point that was found as a corner twice is likely to be found so again. Why not ORB
descriptors: they pay for an invariance to rotation that consecutive frames do not need. The claimed
pose plays no part: a search along claimed epipolar lines would find only what agrees with the claim.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pydantic import Field

from belie.geometry.compiled import compiled
from belie.types import Features, GrayImage, Settings

Patches = npt.NDArray[np.float32]
_SIDE = 8
_SAME_PX = 6.0
_NOISE = 0.01  # what sensor noise takes from the correlation of equal patches: ties are no evidence


class CorrespondenceSettings(Settings):
    """When two corners are the same scene point.

    >>> CorrespondenceSettings().min_correlation
    0.8
    """

    search_share: float = Field(
        0.08,
        gt=0.0,
        le=1.0,
        description="Most a corner may move from where it was last seen [share of the image width].",
    )
    min_correlation: float = Field(
        0.8, ge=0.0, lt=1.0, description="Least normalised cross-correlation of the two patches [1]."
    )
    max_ratio: float = Field(
        0.7,
        gt=0.0,
        le=1.0,
        description="Most (1 - correlation) of the best candidate over that of the second [ratio]: repeated"
        " texture is refused.",
    )


@compiled()
def _describe_level(
    image: npt.NDArray[np.uint8], px: npt.NDArray[np.float32], scale: float, out: Patches
) -> None:
    height, width = image.shape
    for i in range(len(px)):
        x0 = int(np.round((px[i, 0] + 0.5) / scale - 0.5)) - _SIDE
        y0 = int(np.round((px[i, 1] + 0.5) / scale - 0.5)) - _SIDE
        total = np.float32(0.0)
        for r in range(_SIDE):
            top = min(max(y0 + 2 * r, 0), height - 1)
            below = min(max(y0 + 2 * r + 1, 0), height - 1)
            for c in range(_SIDE):
                left = min(max(x0 + 2 * c, 0), width - 1)
                right = min(max(x0 + 2 * c + 1, 0), width - 1)
                value = (
                    np.float32(image[top, left])
                    + np.float32(image[top, right])
                    + np.float32(image[below, left])
                    + np.float32(image[below, right])
                )
                out[i, r * _SIDE + c] = value
                total += value
        mean = total / np.float32(_SIDE * _SIDE)
        energy = np.float32(0.0)
        for k in range(_SIDE * _SIDE):
            out[i, k] -= mean
            energy += out[i, k] * out[i, k]
        scaling = np.float32(1.0) / np.sqrt(max(energy, np.float32(1.0)))
        for k in range(_SIDE * _SIDE):
            out[i, k] *= scaling


def describe(pyramid: Sequence[GrayImage], features: Features, scale_factor: float) -> Patches:
    """The patch around every corner: 8x8 means of 2x2 pixels of its level, zero mean, unit length.

    Parameters
    ----------
    pyramid : sequence of array (height, width), uint8
        From `image_pyramid`.
    features : Features
    scale_factor : float
        Of the pyramid.

    Returns
    -------
    array (N, 64), float32
        The dot product of two rows is their normalised cross-correlation.

    Examples
    --------
    >>> image = np.random.default_rng(0).integers(0, 255, (40, 40)).astype(np.uint8)
    >>> patches = describe([image], Features(px=[[20, 20]], level=[0], score=[1]), 1.5)
    >>> patches.shape, round(float(patches[0] @ patches[0]), 3)
    ((1, 64), 1.0)
    """
    patches = np.empty((len(features), _SIDE * _SIDE), dtype=np.float32)
    bounds = np.searchsorted(features.level, np.arange(len(pyramid) + 1))  # finest level comes first
    for level, image in enumerate(pyramid):
        rows = slice(bounds[level], bounds[level + 1])
        _describe_level(image, features.px[rows], scale_factor**level, patches[rows])
    return patches


@compiled(reassociate=True)
def _correlation(a: Patches, i: int, b: Patches, j: int) -> np.float32:
    total = np.float32(0.0)
    for k in range(_SIDE * _SIDE):
        total += a[i, k] * b[j, k]
    return total


@compiled(inline=True)
def _first_at_least(keys: npt.NDArray[np.float64], value: float) -> int:
    # np.searchsorted, without the seconds that it takes to compile.
    low, high = 0, len(keys)
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


@compiled()
def _mutually_best(
    px_a: npt.NDArray[np.float32],
    level_a: npt.NDArray[np.int8],
    patches_a: Patches,
    order: npt.NDArray[np.int64],
    keys: npt.NDArray[np.float64],
    stride: float,
    px_b: npt.NDArray[np.float32],
    level_b: npt.NDArray[np.int8],
    patches_b: Patches,
    radius: float,
    min_correlation: float,
    max_ratio: float,
) -> npt.NDArray[np.int64]:
    """Partner of every a; the arrays of b come sorted by `keys`, `order` leads back to their numbers."""
    partner = np.full(len(px_a), -1, dtype=np.int64)
    best_of_b = np.full(len(px_b), -1, dtype=np.int64)
    score_of_b = np.full(len(px_b), -1.0)
    for i in range(len(px_a)):
        x, y = px_a[i, 0], px_a[i, 1]
        best, second, chosen = -1.0, -1.0, -1
        band = np.floor(float(y) / radius)
        for row in (band - 1.0, band, band + 1.0):
            last_key = row * stride + x + radius
            for j in range(_first_at_least(keys, row * stride + x - radius), len(keys)):
                if keys[j] > last_key:
                    break
                if abs(px_b[j, 1] - y) > radius or abs(level_b[j] - level_a[i]) > 1:
                    continue
                score = float(_correlation(patches_a, i, patches_b, j))
                if score > score_of_b[j]:
                    score_of_b[j] = score
                    best_of_b[j] = i
                if score <= second:
                    continue
                # A corner found on two levels is one candidate, not a rival of itself.
                apart = abs(px_b[j, 0] - px_b[chosen, 0]) + abs(px_b[j, 1] - px_b[chosen, 1])
                rival = chosen < 0 or apart > _SAME_PX
                if score > best:
                    if rival:
                        second = best
                    best, chosen = score, j
                elif rival:
                    second = score
        if best >= min_correlation and 1.0 - best + _NOISE <= max_ratio * (1.0 - second + _NOISE):
            partner[i] = chosen
    for i in range(len(px_a)):
        if partner[i] >= 0:
            partner[i] = order[partner[i]] if best_of_b[partner[i]] == i else -1
    return partner


def correspond(
    px_a: npt.NDArray[np.float32],
    level_a: npt.NDArray[np.int8],
    patches_a: Patches,
    features_b: Features,
    patches_b: Patches,
    radius_px: float,
    settings: CorrespondenceSettings,
) -> npt.NDArray[np.int64]:
    """For every corner of a, its position among the corners of b; -1 where there is none.

    Parameters
    ----------
    px_a, level_a, patches_a : array (N, 2), (N,), (N, 64)
        Corners where they were last seen.
    features_b, patches_b : Features, array (M, 64)
        Corners of the new image.
    radius_px : float
        Half side of the square that is searched.
    settings : CorrespondenceSettings

    Examples
    --------
    >>> image = np.random.default_rng(0).integers(0, 255, (60, 60)).astype(np.uint8)
    >>> a = Features(px=[[20, 20], [40, 40]], level=[0, 0], score=[1, 1])
    >>> b = Features(px=[[45, 41], [25, 21]], level=[0, 0], score=[1, 1])
    >>> moved = np.roll(image, (1, 5), axis=(0, 1))
    >>> correspond(a.px, a.level, describe([image], a, 1.5), b, describe([moved], b, 1.5), 30.0,
    ...            CorrespondenceSettings()).tolist()
    [1, 0]
    """
    if len(px_a) == 0 or len(features_b) == 0:
        return np.full(len(px_a), -1, dtype=np.int64)
    # Bands as high as the radius, by column within a band: three runs hold every candidate.
    px_b = features_b.px.astype(np.float64)
    stride = float(px_b[:, 0].max()) + 4.0 * radius_px + 1.0
    keys = np.floor(px_b[:, 1] / radius_px) * stride + px_b[:, 0]
    order = np.argsort(keys, kind="stable")
    return np.asarray(
        _mutually_best(
            px_a,
            level_a,
            patches_a,
            order,
            keys[order],
            stride,
            features_b.px[order],
            features_b.level[order],
            patches_b[order],
            radius_px,
            settings.min_correlation,
            settings.max_ratio,
        )
    )
