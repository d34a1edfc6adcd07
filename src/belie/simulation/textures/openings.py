"""Windows, doors and shop fronts, as atlases of variants."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from belie.simulation.textures.noise import Rgba, fbm, rgba, text

WINDOW_COLUMNS, WINDOW_ROWS = 4, 4
DOOR_COLUMNS = 4
SHOP_COLUMNS, SHOP_ROWS = 2, 4
_CELL = 256
_WORDS = ("BAKERY", "CAFE 21", "OPTIK", "BOOKS", "PHARMACY", "KIOSK", "TAILOR", "NOODLES")
Rgb = npt.NDArray[np.float32]


@lru_cache(maxsize=4)
def windows(seed: int) -> Rgba:
    """Sixteen windows with frames, bars, curtains and blinds; four of them are lit at night."""
    rng = np.random.default_rng([seed, 5])
    atlas = np.zeros((_CELL * WINDOW_ROWS, _CELL * WINDOW_COLUMNS, 3), np.float32)
    glow = np.zeros(atlas.shape[:2], np.float32)
    for index in range(WINDOW_ROWS * WINDOW_COLUMNS):
        y, x = (value * _CELL for value in divmod(index, WINDOW_COLUMNS))
        cell, lit = _window(rng, index)
        atlas[y : y + _CELL, x : x + _CELL] = cell
        glow[y : y + _CELL, x : x + _CELL] = lit
    return rgba(atlas, glow)


def _window(rng: np.random.Generator, index: int) -> tuple[Rgb, npt.NDArray[np.float32]]:
    c = _CELL
    down = np.linspace(0.0, 1.0, c, dtype=np.float32)[:, None]
    noise = fbm(c, int(rng.integers(1000)), slope=1.8)
    # Panes: the sky above, the houses opposite below, broken by what stands behind.
    tone = 0.30 - 0.16 * down + 0.16 * (noise - 0.5)
    cell = np.stack([tone * 0.86, tone * 0.96, tone * 1.10], axis=2).astype(np.float32)
    kind = index % 4
    if kind in (1, 2):  # curtains at both sides, or a blind from above
        fabric = np.array(
            rng.choice([[0.78, 0.76, 0.70], [0.70, 0.62, 0.52], [0.62, 0.66, 0.72]]), np.float32
        )
        folds = 0.55 + 0.12 * np.sin(np.arange(c) * rng.uniform(0.25, 0.5)).astype(np.float32)[None, :, None]
        if kind == 1:
            reach = int(c * rng.uniform(0.18, 0.34))
            cell[:, :reach] = fabric * folds[:, :reach]
            cell[:, c - reach :] = fabric * folds[:, c - reach :]
        else:
            reach = int(c * rng.uniform(0.25, 0.7))
            slats = 0.52 + 0.14 * np.sin(np.arange(reach) * 0.7).astype(np.float32)[:, None, None]
            cell[:reach] = fabric * slats
    if kind == 3:  # things on the sill inside
        for _ in range(4):
            x, half, tall = rng.uniform(30, c - 30), rng.uniform(8, 20), rng.uniform(25, 70)
            colour = tuple(float(v) for v in rng.uniform(0.1, 0.5, 3))
            cv2.ellipse(
                cell, (int(x), int(c - 24 - 0.5 * tall)), (int(half), int(0.5 * tall)), 0, 0, 360, colour, -1
            )
    lit = np.zeros((c, c), np.float32)
    if index in (2, 5, 11, 13):
        lit[:] = 0.55 + 0.45 * noise
    frame = np.array(rng.choice([[0.86, 0.85, 0.82], [0.30, 0.26, 0.22], [0.72, 0.74, 0.75]]), np.float32)
    edge, bar = int(c * 0.055), int(c * 0.026)
    mask = np.zeros((c, c), np.float32)
    mask[:edge] = mask[-edge:] = 1.0
    mask[:, :edge] = mask[:, -edge:] = 1.0
    mask[:, c // 2 - bar : c // 2 + bar] = 1.0
    if index % 3:
        high = int(c * 0.33)
        mask[high - bar : high + bar] = 1.0
    shade = np.clip(cv2.GaussianBlur(mask, (0, 0), 5.0), 0.0, 1.0)
    cell = cell * (1.0 - 0.5 * shade[..., None])  # the frame's shadow on the pane
    cell = np.where(mask[..., None] > 0, frame * (0.92 + 0.12 * noise[..., None]), cell)
    return cell.astype(np.float32), np.where(mask > 0, 0.0, lit).astype(np.float32)


@lru_cache(maxsize=4)
def doors(seed: int) -> Rgba:
    """Four house doors with panels, handle, letter box and house number."""
    rng = np.random.default_rng([seed, 6])
    height, width = 2 * _CELL, _CELL
    atlas = np.zeros((height, width * DOOR_COLUMNS, 3), np.float32)
    paints = ([0.34, 0.20, 0.12], [0.12, 0.26, 0.20], [0.15, 0.20, 0.33], [0.45, 0.12, 0.10])
    for i, paint in enumerate(paints):
        wood = fbm(2 * _CELL, int(rng.integers(1000)), slope=1.2, stretch=0.12)[:, :width]
        cell = np.array(paint, np.float32) * (0.8 + 0.5 * wood[..., None])
        cell = np.ascontiguousarray(cell, np.float32)
        for y0, y1 in ((40, 190), (215, 330), (355, 480)):
            for x0, x1 in ((28, 118), (138, 228)):
                inner = cell[y0:y1, x0:x1]
                inner *= 0.72
                cv2.rectangle(cell, (x0, y0), (x1, y1), [c * 0.45 for c in paint], 4)
                cv2.line(cell, (x0, y1), (x1, y1), [min(1.0, c * 2.1) for c in paint], 3)
        if i % 2 == 0:  # a pane in the upper part
            cell[48:182, 36:110] = cell[48:182, 146:220] = (0.20, 0.23, 0.27)
        cv2.circle(cell, (228, 290), 11, (0.75, 0.68, 0.42), -1, cv2.LINE_AA)
        cv2.rectangle(cell, (92, 338), (164, 350), (0.70, 0.66, 0.50), -1)
        cell[:12] = cell[:, :8] = cell[:, -8:] = (0.75, 0.73, 0.70)
        text(cell, str(int(rng.integers(2, 98))), (128, 24), 22, (0.95, 0.95, 0.92))
        atlas[:, i * width : (i + 1) * width] = cell
    return rgba(atlas)


@lru_cache(maxsize=4)
def shops(seed: int) -> Rgba:
    """Eight shop fronts: a sign with a name, panes with goods, a door; the sign and the panes glow at night."""
    rng = np.random.default_rng([seed, 9])
    width, height = 2 * _CELL, _CELL + 64
    atlas = np.zeros((height * SHOP_ROWS, width * SHOP_COLUMNS, 3), np.float32)
    glow = np.zeros(atlas.shape[:2], np.float32)
    for index, words in enumerate(_WORDS):
        row, column = divmod(index, SHOP_COLUMNS)
        cell, lit = _shop(rng, words, width, height)
        y, x = row * height, column * width
        atlas[y : y + height, x : x + width] = cell
        glow[y : y + height, x : x + width] = lit
    return rgba(atlas, glow)


def _shop(
    rng: np.random.Generator, words: str, width: int, height: int
) -> tuple[Rgb, npt.NDArray[np.float32]]:
    trim = np.array(rng.choice([[0.20, 0.22, 0.24], [0.36, 0.27, 0.18], [0.62, 0.60, 0.55]]), np.float32)
    noise = fbm(512, int(rng.integers(1000)), slope=1.0)[:height, :width]
    cell = np.ascontiguousarray(trim * (0.8 + 0.4 * noise[..., None]), np.float32)
    lit = np.zeros((height, width), np.float32)
    sign = tuple(float(v) for v in rng.uniform(0.05, 0.75, 3))
    ink = (0.96, 0.94, 0.86) if sum(sign) < 1.2 else (0.08, 0.08, 0.10)
    cv2.rectangle(cell, (12, 10), (width - 12, 70), sign, -1)
    text(cell, words, (0.5 * width, 41), 34, ink)
    lit[10:71, 12 : width - 11] = 0.5
    for x0, x1 in ((20, 190), (206, 300), (316, width - 20)):
        is_door = x0 == 206
        y0, y1 = 86, height - (8 if is_door else 52)
        pane = cell[y0:y1, x0:x1]
        down = np.linspace(1.0, 0.5, y1 - y0, dtype=np.float32)[:, None, None]
        pane[:] = np.array([0.16, 0.18, 0.20], np.float32) * down
        for _ in range(0 if is_door else 16):
            x, y = rng.uniform(x0 + 12, x1 - 12), rng.uniform(y0 + 40, y1 - 6)
            size = rng.uniform(5, 17)
            colour = tuple(float(v) for v in rng.uniform(0.15, 0.85, 3))
            shape = np.array(
                [[x - size, y], [x + size, y], [x + 0.7 * size, y - 2 * size], [x - 0.7 * size, y - 2 * size]]
            )
            cv2.fillConvexPoly(cell, shape.round().astype(np.int32), colour, cv2.LINE_AA)
        lit[y0:y1, x0:x1] = 0.75
        cv2.rectangle(cell, (x0, y0), (x1, y1), [float(v) * 1.5 for v in trim], 5)
        if is_door:
            cv2.circle(cell, (x1 - 16, (y0 + y1) // 2 + 20), 6, (0.8, 0.8, 0.75), -1)
    return cell, lit
