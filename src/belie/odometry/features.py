"""Equation (2), ``k_t = Θ(F_t)``: FAST corners on a scale pyramid.

FAST (Rosten and Drummond, 2006) runs on every level, tile by tile; each tile has a threshold of its
own, set from its contrast and from what the previous image gave there. So a road in fog, a dark verge
beside a lamp and a hedge in the sun each yield about the number of corners asked for, and the time,
which follows the number of corners, stays bounded.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from belie.odometry.corner_selection import contrast_quantile, corner_scores, spread_evenly
from belie.types import Features, GrayImage, Settings, read_only

_BORDER_PX = 3  # FAST's ring: tiles overlap by it, so that no corner falls between two
_STRIDE_PX = 8  # of the contrast samples: 1/64 of the pixels tell a quantile well enough
_SMALLEST_TILE_PX = 32.0
_NO_POINTS = np.empty((0, 2), dtype=np.float32)


class FeatureSettings(Settings):
    """Corners of equation (2).

    >>> FeatureSettings().levels
    4
    """

    levels: int = Field(4, ge=1, le=12, description="Levels of the scale pyramid [count].")
    scale_factor: float = Field(
        1.5,
        gt=1.0,
        le=2.0,
        description="Size of a level relative to the next coarser one [ratio]. Four levels of 1.5 span the"
        " range of ORB-SLAM's eight of 1.2 at a third of the cost.",
    )
    max_corners: int = Field(1000, ge=8, le=20000, description="Corners kept, all levels together [count].")
    oversampling: float = Field(
        2.0,
        ge=1.0,
        le=10.0,
        description="Corners that FAST should find for each one kept [ratio]: the surplus is what the even"
        " spread chooses from; time follows it.",
    )
    min_threshold: float = Field(
        6.0, ge=1, le=254, description="Lowest FAST threshold [gray]; below it sensor noise makes corners."
    )
    max_threshold: float = Field(120.0, ge=1, le=254, description="Highest FAST threshold [gray].")
    min_score: float = Field(
        2.0,
        ge=0.0,
        description="Least smaller eigenvalue of the structure tensor [gray^2]; 1.5 gray of noise gives 1.",
    )
    spacing_px: float = Field(
        4.0, ge=0.0, description="Least distance between two corners of one level [px of that level]."
    )
    occupied_spacing_px: float = Field(
        12.0, ge=0.0, description="Least distance to an occupied point [px, full resolution]."
    )
    distinct_levels: bool = Field(
        False,
        description="Whether a corner near one already kept on a finer level is refused [true/false]."
        " Matching by level wants both; tracking wants one.",
    )
    tile_columns: int = Field(
        4,
        ge=1,
        le=16,
        description="Tiles across the finest level, each with a threshold of its own [count]; tiles are about"
        " square, coarser levels have fewer.",
    )


def image_pyramid(image: GrayImage, settings: FeatureSettings) -> tuple[GrayImage, ...]:
    """The image on every level, finest first; levels too small for a corner are left out.

    >>> [level.shape for level in image_pyramid(np.zeros((90, 150), np.uint8), FeatureSettings(levels=3))]
    [(90, 150), (60, 100), (40, 67)]
    """
    height, width = image.shape
    levels = [read_only(image)]
    for level in range(1, settings.levels):
        scale = settings.scale_factor**level
        size = (round(width / scale), round(height / scale))
        if min(size) < 4 * _BORDER_PX:
            break
        smaller = cv2.resize(levels[-1], size, interpolation=cv2.INTER_LINEAR)
        levels.append(read_only(np.asarray(smaller, dtype=np.uint8)))
    return tuple(levels)


def _tiles(shape: tuple[int, ...], tile_px: float) -> Iterator[tuple[int, int, int, int]]:
    rows, columns = max(1, round(shape[0] / tile_px)), max(1, round(shape[1] / tile_px))
    for r in range(rows):
        for c in range(columns):
            yield (
                r * shape[0] // rows,
                (r + 1) * shape[0] // rows,
                c * shape[1] // columns,
                (c + 1) * shape[1] // columns,
            )


def _fast(image: GrayImage, tile: tuple[int, int, int, int], threshold: float) -> npt.NDArray[np.float32]:
    y0, x0 = max(0, tile[0] - _BORDER_PX), max(0, tile[2] - _BORDER_PX)
    detector = cv2.FastFeatureDetector.create(round(threshold), True)
    found = detector.detect(image[y0 : tile[1] + _BORDER_PX, x0 : tile[3] + _BORDER_PX])
    if not found:
        return _NO_POINTS
    px = np.asarray(cv2.KeyPoint.convert(found), dtype=np.float32).reshape(-1, 2)
    px += (x0, y0)
    return px


def _fast_adaptive(
    image: GrayImage, tile: tuple[int, int, int, int], wanted: float, hint: float, settings: FeatureSettings
) -> tuple[npt.NDArray[np.float32], float]:
    """About `wanted` corners of one tile, and the threshold that the next image should begin with."""
    area = (tile[1] - tile[0]) * (tile[3] - tile[2])
    # A corner has some ten pixels around it that differ by more than the threshold.
    guess = contrast_quantile(image, *tile, _STRIDE_PX, min(0.5, 10.0 * wanted / area))
    low, high = settings.min_threshold, max(settings.min_threshold, settings.max_threshold)
    # The image's own contrast bounds the hint: after a tunnel the last threshold means nothing.
    threshold = min(max(hint, 0.5 * guess), 2.0 * guess + 1.0) if hint > 0.0 else guess
    threshold = min(max(threshold, low), high)
    px = _fast(image, tile, threshold)
    while len(px) < 0.4 * wanted and threshold > low:
        threshold = max(low, 0.6 * threshold)
        px = _fast(image, tile, threshold)
    following = threshold * min(max((len(px) / wanted) ** 0.4, 0.6), 1.6)
    return px, min(max(following, low), high)


def _shares(levels: int, settings: FeatureSettings) -> npt.NDArray[np.float64]:
    # As in ORB-SLAM: corners in proportion to a level's width, so coarse levels are not starved.
    weight = settings.scale_factor ** -np.arange(levels, dtype=np.float64)
    return np.asarray(weight / weight.sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidates:
    """Corners of an image before some are chosen, level by level: level pixels (N, 2), scores (N,), best first.

    `thresholds` as in `Features`.
    """

    levels: tuple[tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], npt.NDArray[np.int64]], ...]
    thresholds: tuple[float, ...]


def find_candidates(
    pyramid: Sequence[GrayImage], settings: FeatureSettings, previous: Features | None = None
) -> Candidates:
    """What `extract_features` chooses from. Most of its work, and it needs nothing but the image."""
    hints = _NO_POINTS.ravel() if previous is None else previous.thresholds
    tile_px = max(_SMALLEST_TILE_PX, pyramid[0].shape[1] / settings.tile_columns)
    levels = []
    thresholds: list[float] = []
    for picture, share in zip(pyramid, _shares(len(pyramid), settings), strict=True):
        found = []
        area = picture.shape[0] * picture.shape[1]
        # Even where few are wanted: the threshold is the scene's, not the call's.
        raw = settings.max_corners * settings.oversampling * share
        for tile in _tiles(picture.shape, tile_px):
            hint = float(hints[len(thresholds)]) if len(thresholds) < len(hints) else 0.0
            part = (tile[1] - tile[0]) * (tile[3] - tile[2]) / area
            px, following = _fast_adaptive(picture, tile, raw * part, hint, settings)
            found.append(px)
            thresholds.append(following)
        px = np.concatenate(found)
        scores = corner_scores(picture, px)
        levels.append((px, scores, np.argsort(-scores, kind="stable")))
    return Candidates(levels=tuple(levels), thresholds=tuple(thresholds))


def extract_features(
    image: GrayImage | Sequence[GrayImage],
    settings: FeatureSettings,
    *,
    previous: Features | None = None,
    occupied_px: npt.NDArray[np.floating] | None = None,
    max_corners: int | None = None,
    candidates: Candidates | None = None,
) -> Features:
    """Corners of an image, spread evenly, on all levels of its pyramid: ``k_t = Θ(F_t)``, equation (2).

    Parameters
    ----------
    image : array (height, width), uint8, or the sequence of such that `image_pyramid` gave
        The pyramid saves its making where the caller has it already.
    settings : FeatureSettings
    previous : Features or None
        Of the image before: its thresholds are where this search begins.
    occupied_px : array (M, 2) or None
        Full-resolution pixels near which no corner is wanted (tracks that live).
    max_corners : int or None
        In place of `settings.max_corners`.
    candidates : Candidates or None
        Of this image, where somebody has found them already.

    Returns
    -------
    Features
        At most `max_corners`, finest level first; none in an image without contrast.

    Examples
    --------
    >>> tiles = np.random.default_rng(0).integers(0, 255, (12, 16)).astype(np.uint8)
    >>> features = extract_features(np.kron(tiles, np.ones((20, 20), np.uint8)), FeatureSettings())
    >>> len(features) > 100
    True
    >>> len(extract_features(np.full((120, 160), 90, np.uint8), FeatureSettings()))
    0
    """
    pyramid = image_pyramid(image, settings) if isinstance(image, np.ndarray) else tuple(image)
    candidates = candidates or find_candidates(pyramid, settings, previous)
    wanted = settings.max_corners if max_corners is None else max_corners
    occupied = _NO_POINTS if occupied_px is None else np.asarray(occupied_px, dtype=np.float32).reshape(-1, 2)
    pieces: list[tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]] = []
    shares = _shares(len(pyramid), settings)
    for level, (picture, share, found) in enumerate(zip(pyramid, shares, candidates.levels, strict=True)):
        px, scores, best_first = found
        scale = settings.scale_factor**level
        kept = spread_evenly(
            px,
            scores,
            best_first,
            settings.min_score,
            picture.shape[1],
            picture.shape[0],
            round(wanted * share),
            settings.spacing_px,
            (occupied + 0.5) / np.float32(scale) - 0.5,
            settings.occupied_spacing_px / scale,
        )
        pieces.append(((px[kept] + 0.5) * np.float32(scale) - 0.5, scores[kept]))
        if settings.distinct_levels:
            occupied = np.concatenate([occupied, pieces[-1][0]])
    return Features(
        px=np.concatenate([px for px, _ in pieces]),
        level=np.repeat(np.arange(len(pieces)), [len(px) for px, _ in pieces]),
        score=np.concatenate([score for _, score in pieces]),
        thresholds=np.array(candidates.thresholds),
    )
