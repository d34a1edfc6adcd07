"""Light of the street lamps on the ground, as a map: any number of lamps costs one look-up."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from belie.geometry import FloatArray

_CELL_M = 0.5
_REACH_M = 24.0


def lamp_map(
    lamps: FloatArray, cell_m: float = _CELL_M
) -> tuple[npt.NDArray[np.float16], tuple[float, float, float, float]]:
    """Irradiance below lamps (N, 4: x, y, z, strength), shape (rows, columns), and its area x0, y0, 1/width, 1/height.

    A point lamp at height h above a ground point at distance d: ``cos(angle) / distance²``, 1 right below the lamp.

    >>> light, area = lamp_map(np.array([[0.0, 0.0, 6.0, 1.0]]))
    >>> bool(light.max() > 0.95), light.shape
    (True, (96, 96))
    """
    if len(lamps) == 0:
        return np.zeros((1, 1), np.float16), (0.0, 0.0, 1.0, 1.0)
    low = np.floor(lamps[:, :2].min(axis=0) - _REACH_M)
    high = np.ceil(lamps[:, :2].max(axis=0) + _REACH_M)
    columns, rows = (int(v) for v in np.ceil((high - low) / cell_m))
    light = np.zeros((rows, columns))
    reach = int(_REACH_M / cell_m)
    for x, y, z, strength in lamps:
        column, row = int((x - low[0]) / cell_m), int((y - low[1]) / cell_m)
        r0, r1 = max(0, row - reach), min(rows, row + reach)
        c0, c1 = max(0, column - reach), min(columns, column + reach)
        dy = low[1] + (np.arange(r0, r1) + 0.5) * cell_m - y
        dx = low[0] + (np.arange(c0, c1) + 0.5) * cell_m - x
        d2 = dx[None, :] ** 2 + dy[:, None] ** 2
        fade = np.clip(1.0 - d2 / _REACH_M**2, 0.0, 1.0)
        light[r0:r1, c0:c1] += strength * fade * (z * z / (d2 + z * z)) ** 1.5
    return light.astype(np.float16), (
        float(low[0]),
        float(low[1]),
        1.0 / (columns * cell_m),
        1.0 / (rows * cell_m),
    )
