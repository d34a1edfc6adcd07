"""An objectness check, in the manner of DetectorGuard: a detection must explain what looks like an object.

DetectorGuard (Xiang, Mittal: "DetectorGuard: Provably Securing Object Detectors against Localized Patch Hiding
Attacks", CCS 2021) has a classifier with small receptive fields say of every place in the image whether it looks like
an object, joins such places to clusters, and accuses the detector of hiding where no box explains a cluster. Here a
small network, trained on the simulator by `train`, judges cells of 8 px by the gradients of 3 x 3 of them.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from belie.evaluation.bench.rivals.network import Network
from belie.evaluation.bench.rivals.protocol import Cameras
from belie.geometry import FloatArray
from belie.types import Alert, AlertType, CheckResult, DetectionClaim, GrayImage, Status, Step

WIDTH_PX, CELL_PX, BINS = 320, 8, 6
WEIGHTS = Path(__file__).with_suffix(".npz")
_PERSISTS = 3  # frames that a cluster must stay unexplained
_GROW = 0.15  # of a box's size: how far around it pixels are explained
_QUIET_FRAMES = 10


@cache
def _network() -> Network:
    return Network.load(WEIGHTS)


class Objectness:
    """Judges hiding only; its statistic is the cells of the largest cluster that stays unexplained."""

    judges = frozenset({AlertType.OBSTACLE_HIDING})

    def __init__(self, cameras: Cameras, *, network: Network | None = None) -> None:
        ((_, camera),) = cameras.items()
        self._scale = WIDTH_PX / camera.model.width
        self._network = network or _network()
        self._boxes: dict[str, FloatArray] = {}
        self._unexplained: list[npt.NDArray[np.bool_]] = []
        self._since_alert = _QUIET_FRAMES
        self.checks: tuple[CheckResult, ...] = ()

    def update(self, step: Step) -> list[Alert]:
        """Look for clusters that no box of the last messages explains."""
        for claim in step.claims:
            if isinstance(claim, DetectionClaim):
                boxes = [d.box_px for d in claim.detections if d.box_px is not None]
                self._boxes[claim.source] = np.array(boxes).reshape(-1, 4) * self._scale
        if not self._boxes:
            self.checks = ()
            return []
        source = next(iter(self._boxes))
        looks = objectness(step.frame.image, self._network) > 0.5
        self._unexplained = [*self._unexplained[1 - _PERSISTS :], looks & ~self._explained(looks.shape)]
        lasting = np.logical_and.reduce(self._unexplained) & (len(self._unexplained) == _PERSISTS)
        cells = largest_cluster(lasting)
        is_lie = cells > self._network.threshold
        self.checks = (
            CheckResult(
                check="hiding", source=source, status=Status.CONTRADICTED if is_lie else Status.CONSISTENT,
                statistic=float(cells), threshold=self._network.threshold, unit="cells",
            ),
        )  # fmt: skip
        self._since_alert += 1
        if not is_lie:
            return []
        new, self._since_alert = self._since_alert >= _QUIET_FRAMES, 0
        kind = AlertType.OBSTACLE_HIDING
        return [Alert(type=kind, source=source, onset_ns=step.frame.stamp_ns)] if new else []

    def _explained(self, shape: tuple[int, ...]) -> npt.NDArray[np.bool_]:
        found = np.zeros(shape, np.bool_)
        for boxes in self._boxes.values():
            for x0, y0, x1, y1 in boxes:
                dx, dy = max(_GROW * (x1 - x0), CELL_PX), max(_GROW * (y1 - y0), CELL_PX)
                left, top = (int(max(v, 0.0) // CELL_PX) for v in (x0 - dx, y0 - dy))
                found[top : int((y1 + dy) // CELL_PX) + 1, left : int((x1 + dx) // CELL_PX) + 1] = True
        return found


def objectness(image: GrayImage, network: Network) -> FloatArray:
    """Probability of every cell to be part of an object, (rows, columns)."""
    inputs = cell_features(image)
    rows, columns, width = inputs.shape
    return network.probabilities(inputs.reshape(-1, width))[:, 1].reshape(rows, columns)


def cell_features(image: GrayImage) -> FloatArray:
    """Of every cell: gradients by direction, brightness and contrast of 3 x 3 cells, and its height in the image.

    >>> cell_features(np.zeros((480, 640), np.uint8)).shape
    (30, 40, 73)
    """
    height = round(image.shape[0] * WIDTH_PX / image.shape[1])
    small = cv2.resize(image, (WIDTH_PX, height), interpolation=cv2.INTER_AREA).astype(np.float32)
    gx, gy = cv2.Sobel(small, cv2.CV_32F, 1, 0), cv2.Sobel(small, cv2.CV_32F, 0, 1)
    strength, angle = np.hypot(gx, gy), np.mod(np.arctan2(gy, gx), np.pi)
    kind = np.minimum((angle * (BINS / np.pi)).astype(np.int64), BINS - 1)
    layers = [*(np.where(kind == k, strength, 0.0) for k in range(BINS)), small, small * small]
    rows, columns = height // CELL_PX, WIDTH_PX // CELL_PX
    cells = np.stack(
        [
            layer[: rows * CELL_PX].reshape(rows, CELL_PX, columns, CELL_PX).mean(axis=(1, 3))
            for layer in layers
        ],
        axis=-1,
    )
    cells[..., -1] = np.sqrt(np.maximum(cells[..., -1] - cells[..., -2] ** 2, 0.0))
    cells[..., :BINS] = np.log1p(cells[..., :BINS])  # fog and night scale gradients: their ratios count
    around = np.pad(cells, ((1, 1), (1, 1), (0, 0)), mode="edge")
    near = [around[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    place = np.broadcast_to(np.linspace(0.0, 1.0, rows)[:, None, None], (rows, columns, 1))
    return np.asarray(np.concatenate([*near, place], axis=-1), dtype=np.float64)


def largest_cluster(cells: npt.NDArray[np.bool_]) -> int:
    """Cells of the largest connected group.

    >>> largest_cluster(np.array([[True, True, False], [False, False, True]]))
    3
    """
    count, _, stats, _ = cv2.connectedComponentsWithStats(cells.astype(np.uint8), connectivity=8)
    return int(stats[1:, cv2.CC_STAT_AREA].max()) if count > 1 else 0
