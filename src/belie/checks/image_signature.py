"""A small signature of an image: equal or not, alike or not, changed or not, at a cost of 0.1 ms.

One pass over every n-th row gives a hash (bit-identical images) and the mean gray value of 32 x 18 cells.
A cell averages hundreds of pixels: sensor noise of two gray levels leaves 0.1 to 0.2 there, coding at JPEG
quality 40 about 0.4. On real drives, the cells of consecutive frames differ by 2 to 50 gray levels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from belie.geometry import compiled
from belie.types import GrayImage

FloatCells = npt.NDArray[np.float32]
_ROWS, _COLUMNS = 18, 32  # of cells: near square at 16:9
_SAMPLED_ROWS = 90  # of the image at least, where it has them: 5 to a cell
_REACH = 2  # of the neighbourhood whose mean is taken off, cells to each side
_CHANGED_SHARE = 0.7  # a passing car or an uncovered rim may change the other 30 % of the cells


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImageSignature:
    """What is remembered of an image.

    Parameters
    ----------
    digest : int
        64-bit hash of the sampled rows and their shape; no proof against forgery, and need not be one.
    cells : array (18, 32), float32
        Mean gray value of each cell.
    pattern : array (576,), float32
        The cells without their surround's mean, of zero mean and unit length: untouched by exposure.
    mean_gray, spread_gray : float
        Mean of the cells, and half the distance between their 15 % and 85 % quantiles.
    """

    digest: int
    cells: FloatCells
    pattern: FloatCells
    mean_gray: float
    spread_gray: float


def image_signature(image: GrayImage) -> ImageSignature:
    """Signature of a gray image (height, width) of any size.

    Examples
    --------
    >>> wall = np.tile(np.arange(128, dtype=np.uint8), (72, 1))
    >>> image_signature(wall).digest == image_signature(wall.copy()).digest
    True
    >>> image_signature(wall).digest == image_signature(wall[:, ::-1]).digest
    False
    >>> image_signature(wall).spread_gray
    46.0
    """
    sample = np.ascontiguousarray(image[:: max(1, image.shape[0] // _SAMPLED_ROWS)])
    flat = sample.reshape(-1)
    whole = len(flat) // 8 * 8
    digest = _digest(flat[:whole].view(np.uint64), flat[whole:], sample.shape[1])
    cells = _cell_means(sample, _ROWS, _COLUMNS)
    pattern, mean_gray = _pattern_and_mean(cells)
    return ImageSignature(
        digest=int(digest),
        cells=cells,
        pattern=pattern,
        mean_gray=mean_gray,
        spread_gray=_spread(cells),
    )


def change_gray(a: ImageSignature, b: ImageSignature) -> float:
    """By how much the cells of two images differ, gray levels: the 70 % quantile, a common offset removed.

    Examples
    --------
    >>> wall = np.tile(np.arange(128, dtype=np.uint8), (72, 1))
    >>> change_gray(image_signature(wall), image_signature(wall + 20))
    0.0
    """
    difference = a.cells.ravel() - b.cells.ravel()
    middle = _at(difference, difference.size // 2)
    return float(_at(np.abs(difference - middle), int(_CHANGED_SHARE * difference.size)))


def pattern_distance(a: FloatCells, b: FloatCells) -> float:
    """Distance of two patterns of unit length: 0 alike, sqrt(2) unrelated, 2 negative.

    Examples
    --------
    >>> pattern_distance(np.array([1, 0], np.float32), np.array([-1, 0], np.float32))
    2.0
    """
    difference = a - b
    return math.sqrt(float(difference @ difference))


@compiled()
def _digest(words: Any, tail: Any, width: int) -> Any:
    prime = np.uint64(0x9E3779B97F4A7C15)
    a = np.uint64(width)
    b = np.uint64(len(words))
    c = np.uint64(0x2545F4914F6CDD1D)
    d = np.uint64(0xD6E8FEB86659FD93)
    left, right = np.uint64(29), np.uint64(35)
    n = len(words) // 4 * 4
    for i in range(0, n, 4):  # four lanes: multiplications need not wait for one another
        a = (a ^ words[i]) * prime
        b = (b ^ words[i + 1]) * prime
        c = (c ^ words[i + 2]) * prime
        d = (d ^ words[i + 3]) * prime
        a = (a << left) | (a >> right)
        b = (b << left) | (b >> right)
        c = (c << left) | (c >> right)
        d = (d << left) | (d >> right)
    for i in range(n, len(words)):
        a = (a ^ words[i]) * prime
        a = (a << left) | (a >> right)
    for value in tail:
        b = (b ^ np.uint64(value)) * prime
        b = (b << left) | (b >> right)
    for lane in (b, c, d):
        a = (a ^ lane) * prime
        a = (a << left) | (a >> right)
    return a


@compiled()
def _cell_means(sample: Any, rows: int, columns: int) -> Any:
    height, width = sample.shape
    cells = np.zeros((rows, columns), dtype=np.float32)
    for i in range(rows):
        top = i * height // rows
        bottom = max((i + 1) * height // rows, top + 1)
        for j in range(columns):
            left = j * width // columns
            right = max((j + 1) * width // columns, left + 1)
            total = np.uint32(0)
            for y in range(top, bottom):
                for value in sample[y, left:right]:
                    total += np.uint32(value)
            cells[i, j] = np.float32(total) / np.float32((bottom - top) * (right - left))
    return cells


@compiled()
def _pattern_and_mean(cells: Any) -> tuple[Any, float]:
    # Sums are written out: `mean` and slices compile for a second.
    rows, columns = cells.shape
    pattern = np.empty(rows * columns, dtype=np.float32)
    whole = np.float32(0.0)
    rest = np.float32(0.0)
    for i in range(rows):
        for j in range(columns):
            whole += cells[i, j]
            around = np.float32(0.0)
            count = 0
            for y in range(max(0, i - _REACH), min(rows, i + _REACH + 1)):
                for x in range(max(0, j - _REACH), min(columns, j + _REACH + 1)):
                    around += cells[y, x]
                    count += 1
            value = cells[i, j] - np.float32(around / count)
            pattern[i * columns + j] = value
            rest += value
    rest = np.float32(rest / pattern.size)
    power = np.float32(0.0)
    for k in range(pattern.size):
        pattern[k] -= rest
        power += pattern[k] * pattern[k]
    length = np.float32(max(np.sqrt(power), 1e-3))
    for k in range(pattern.size):
        pattern[k] /= length
    return pattern, float(np.float32(whole / pattern.size))


def _spread(cells: FloatCells) -> float:
    values = cells.ravel()
    return 0.5 * float(_at(values, int(0.85 * values.size)) - _at(values, int(0.15 * values.size)))


def _at(values: FloatCells, place: int) -> np.float32:
    """The value at a place of their order."""
    return np.float32(np.partition(values, place)[place])
