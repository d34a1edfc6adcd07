"""A classifier of box sequences, in the manner of PercepGuard: a box must move like its label.

PercepGuard (Man, Muller, Li, Celik, Gerdes: "That Person Moves Like A Car", USENIX Security 2023) classifies the track
of a box (position, size, over time) with a recurrent network and accuses the label that its class contradicts. Here the
last boxes of a track go through a small feed-forward network, trained on the simulator's tracks by `train`.
"""

from __future__ import annotations

from collections import deque
from functools import cache
from pathlib import Path

import numpy as np

from belie.checks.objects import ClassGroups
from belie.evaluation.bench.rivals.network import Network
from belie.evaluation.bench.rivals.protocol import Cameras
from belie.geometry import FloatArray
from belie.types import Alert, AlertType, CheckResult, DetectionClaim, Status, Step

LENGTH = 10  # boxes of a track that are looked at: a second at 10 Hz
WEIGHTS = Path(__file__).with_suffix(".npz")
_LEAST = 1e-3  # probability of a label that the network has never seen
_GROUPS = ClassGroups()


@cache
def _network() -> Network:
    return Network.load(WEIGHTS)


class BoxClassifier:
    """Judges labels only; what it says of a track is log(p of the likeliest class / p of the claimed one)."""

    judges = frozenset({AlertType.OBJECT_MISCLASSIFICATION})

    def __init__(self, cameras: Cameras) -> None:
        ((_, camera),) = cameras.items()
        self._size = np.array([camera.model.width, camera.model.height] * 2, dtype=np.float64)
        self._network = _network()
        self._tracks: dict[tuple[str, str], deque[FloatArray]] = {}
        self._accused: dict[tuple[str, str], str] = {}
        self.checks: tuple[CheckResult, ...] = ()

    def update(self, step: Step) -> list[Alert]:
        """Judge every tracked object of the messages that came."""
        results, alerts = [], []
        for claim in step.claims:
            if isinstance(claim, DetectionClaim):
                for detection in claim.detections:
                    if detection.box_px is None or not detection.track_id:
                        continue
                    key = claim.source, detection.track_id
                    track = self._tracks.setdefault(key, deque(maxlen=LENGTH))
                    track.append(np.asarray(detection.box_px) / self._size)
                    if len(track) < LENGTH:
                        continue
                    score = self._score(np.array(track), detection.label)
                    is_lie = score > self._network.threshold
                    results.append(
                        CheckResult(
                            check="misclassification", source=claim.source, object=detection.track_id,
                            status=Status.CONTRADICTED if is_lie else Status.CONSISTENT, statistic=score,
                            threshold=self._network.threshold, unit="llr",
                        )
                    )  # fmt: skip
                    if is_lie and self._accused.get(key) != detection.label:
                        self._accused[key] = detection.label
                        alerts.append(
                            Alert(
                                type=AlertType.OBJECT_MISCLASSIFICATION, source=claim.source, onset_ns=claim.stamp_ns,
                                object=detection.track_id,
                            )
                        )  # fmt: skip
        self.checks = tuple(results)
        return alerts

    def _score(self, track: FloatArray, label: str) -> float:
        p = self._network.probabilities(features(track)[None])
        return float(contradiction(p, group_of(label), self._network)[0])


def group_of(label: str) -> str:
    """What a box can tell of a label: a car's is a van's.

    >>> group_of("van")
    'vehicle'
    """
    return _GROUPS.of(label)


def contradiction(p: FloatArray, claimed: str, network: Network) -> FloatArray:
    """log(p of the likeliest class / p of the claimed one) for probabilities (N, classes), shape (N,)."""
    known = claimed in network.labels
    of_claimed = p[:, network.labels.index(claimed)] if known else np.zeros(len(p))
    return np.asarray(np.log(np.maximum(p.max(axis=1), _LEAST) / np.maximum(of_claimed, _LEAST)))


def features(track: FloatArray) -> FloatArray:
    """Middles, log sizes and log aspect of a track's boxes (LENGTH, 4; edges over the image's size), and their drift.

    >>> features(np.tile([0.4, 0.4, 0.6, 0.5], (LENGTH, 1))).shape
    (50,)
    """
    size = np.maximum(track[:, 2:] - track[:, :2], 1e-3)
    middle = 0.5 * (track[:, 2:] + track[:, :2])
    columns = np.column_stack([middle, np.log(size), np.log(size[:, :1] / size[:, 1:])])
    return np.concatenate([columns[-1], (columns[1:] - columns[:-1]).ravel()])
