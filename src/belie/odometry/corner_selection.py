"""Hot loops of equation (2): contrast of a tile, score of a corner, even spread over the image.

OpenCV's FAST gives more corners than are wanted, and ``KeyPoint_convert`` drops their responses; so
they are scored here by the smaller eigenvalue of the structure tensor (Shi and Tomasi, "Good features
to track", 1994), which also tells a corner from an edge and from noise, and the best of every cell are
kept in turns, so that one rich hedge does not take the share of the whole road.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from belie.geometry.compiled import compiled

_RING_PX = 3  # radius of FAST's circle: contrast is measured over the same distance


@compiled()
def contrast_quantile(
    image: npt.NDArray[np.uint8], y0: int, y1: int, x0: int, x1: int, stride: int, share: float
) -> float:
    """The gray difference over 3 px that a `share` of the sampled pixel pairs of a tile exceed.

    >>> contrast_quantile(np.full((64, 64), 9, np.uint8), 0, 64, 0, 64, 4, 0.1)
    0.0
    """
    histogram = np.zeros(256, dtype=np.int64)
    count = 0
    for y in range(y0, y1 - _RING_PX, stride):
        for x in range(x0, x1 - _RING_PX, stride):
            here = np.int64(image[y, x])
            histogram[abs(here - np.int64(image[y, x + _RING_PX]))] += 1
            histogram[abs(here - np.int64(image[y + _RING_PX, x]))] += 1
            count += 2
    above = 0
    for value in range(255, 0, -1):
        above += histogram[value]
        if above > share * count:
            return float(value)
    return 0.0


@compiled()
def corner_scores(image: npt.NDArray[np.uint8], px: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Smaller eigenvalue of the mean structure tensor over 5x5 pixels, gray².

    Parameters
    ----------
    image : array (height, width), uint8
    px : array (N, 2)
        Corners at least 3 px inside the image (as FAST gives them).

    Examples
    --------
    >>> step = np.zeros((16, 16), np.uint8)
    >>> step[8:, 8:] = 100
    >>> corner, edge = corner_scores(step, np.array([[8, 8], [12, 8]], np.float32))
    >>> bool(corner > 100 and edge < 1e-3)
    True
    """
    scores = np.empty(len(px), dtype=np.float32)
    for i in range(len(px)):
        x, y = int(px[i, 0]), int(px[i, 1])
        xx = yy = xy = np.int32(0)
        for v in range(y - 2, y + 3):
            for u in range(x - 2, x + 3):
                gx = np.int32(image[v, u + 1]) - np.int32(image[v, u - 1])
                gy = np.int32(image[v + 1, u]) - np.int32(image[v - 1, u])
                xx += gx * gx
                yy += gy * gy
                xy += gx * gy
        half_trace = 0.5 * (xx + yy)
        root = np.sqrt(0.25 * float(xx - yy) ** 2 + float(xy) ** 2)
        scores[i] = (half_trace - root) / 100.0  # 25 pixels, gradients doubled
    return scores


@compiled()
def _mark(mask: npt.NDArray[np.uint8], x: float, y: float, radius: float) -> None:
    # The mask has half the resolution (a quarter of the memory to clear): its cell (c, r) stands for the
    # pixels 2c and 2c + 1; the half diagonal is added, so that no pixel within the radius is missed.
    reach = radius + 0.71
    for r in range(max(0, int((y - reach) * 0.5)), min(mask.shape[0], int((y + reach) * 0.5) + 1)):
        for c in range(max(0, int((x - reach) * 0.5)), min(mask.shape[1], int((x + reach) * 0.5) + 1)):
            if (2.0 * r + 0.5 - y) ** 2 + (2.0 * c + 0.5 - x) ** 2 <= reach * reach:
                mask[r, c] = 1


@compiled()
def spread_evenly(
    px: npt.NDArray[np.float32],
    scores: npt.NDArray[np.float32],
    best_first: npt.NDArray[np.int64],
    min_score: float,
    width: int,
    height: int,
    wanted: int,
    spacing: float,
    occupied: npt.NDArray[np.float32],
    occupied_spacing: float,
) -> npt.NDArray[np.int64]:
    """Indices of at most `wanted` corners, spread over the image, the best of each cell first.

    Parameters
    ----------
    px : array (N, 2)
        Corners of one level, level pixels.
    scores : array (N,)
        Those below `min_score` are refused.
    best_first : array (N,)
        Their order by falling score.
    wanted : int
        How many to keep; cells are sized to hold four each.
    spacing : float
        No two kept corners are nearer than this, level pixels.
    occupied, occupied_spacing : array (M, 2), float
        No corner is kept nearer than this to one of those points, level pixels.

    Examples
    --------
    >>> px = np.array([[10, 10], [12, 10], [90, 10]], np.float32)
    >>> scores, none = np.array([5, 9, 1], np.float32), np.empty((0, 2), np.float32)
    >>> spread_evenly(px, scores, np.argsort(-scores), 0.5, 100, 20, 2, 6.0, none, 0.0).tolist()
    [1, 2]
    """
    if wanted < 1 or len(px) == 0:
        return np.empty(0, dtype=np.int64)
    mask = np.zeros((height // 2 + 1, width // 2 + 1), dtype=np.uint8)
    for i in range(len(occupied)):
        _mark(mask, occupied[i, 0], occupied[i, 1], occupied_spacing)
    cell = max(8.0, np.sqrt(4.0 * width * height / wanted))
    columns = int(width / cell) + 1
    taken = np.zeros((int(height / cell) + 1) * columns, dtype=np.int32)
    rank = np.full(len(px), -1, dtype=np.int32)
    last_rank = -1
    for i in best_first:
        if scores[i] < min_score:
            break
        x, y = px[i, 0], px[i, 1]
        if mask[int(y * 0.5), int(x * 0.5)]:
            continue
        _mark(mask, x, y, spacing)
        bucket = int(y / cell) * columns + int(x / cell)
        rank[i] = taken[bucket]
        taken[bucket] += 1
        last_rank = max(last_rank, rank[i])
    kept = np.empty(min(wanted, len(px)), dtype=np.int64)
    count = 0
    for turn in range(last_rank + 1):
        for i in best_first:
            if rank[i] == turn:
                kept[count] = i
                count += 1
                if count == len(kept):
                    return kept
    return kept[:count]
