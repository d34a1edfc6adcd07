"""Trains the learned rivals on the simulator, and writes their weights beside them: reproducible, from seeds.

python -m belie.evaluation.bench.rivals.train --cache FOLDER

Drives with world seeds from 101 train, those from 201 set the thresholds; suites use seeds below 100. Needs
scikit-learn (extra ``bench``) and the renderer, which takes about ten minutes on one core, once.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from belie.evaluation.bench.cache import CacheSettings
from belie.evaluation.bench.measure import measure
from belie.evaluation.bench.memory import MemoryRecording
from belie.evaluation.bench.pictures import Pictures
from belie.evaluation.bench.rivals import boxes, objectness
from belie.evaluation.bench.rivals.network import Network
from belie.geometry import FloatArray
from belie.recordings import open_recording
from belie.simulation.scenario import load_scenario
from belie.simulation.truth import objects_path
from belie.types import MissingExtraError

_SEED = 0
_SCENARIOS = ("street-straight", "street-curve", "street-lane-change", "highway")
_TRAIN, _PROVE = (101, 102), (201, 202)
_LOOKED_AT = ("sunny", "light-fog")
_LEAST_VISIBLE = 0.3
_BOX_NOISE = 0.02  # of its size: a detector's, so that the network does not rely on perfect boxes
_TRACKS_ACCUSED = 0.01  # share of honest tracks that the box classifier accuses
_FRAMES_ACCUSED = 0.002  # share of honest frames in which the objectness check accuses


def box_drive(scenario: str, seed: int, cache: Path) -> Pictures:
    """Small pictures: only the boxes are wanted."""
    settings = load_scenario(
        scenario, weather="sunny", seed=seed, duration_s=15.0, width=160, height=120, frame_rate_hz=10
    )
    return Pictures(scenario=settings, cache=cache)


def look_drive(scenario: str, weather: str, seed: int, cache: Path) -> Pictures:
    """One picture a second, each another one."""
    settings = load_scenario(
        scenario, weather=weather, seed=seed, duration_s=15.0, width=640, height=480, frame_rate_hz=1
    )
    return Pictures(scenario=settings, cache=cache)


# -- boxes -------------------------------------------------------------------------------------------


def tracks_of(drive: Pictures) -> Iterator[tuple[str, FloatArray]]:
    """Label and boxes over time of every object, edges over the image's size, (N, 4)."""
    drive.render()
    size = np.array([drive.scenario.width, drive.scenario.height] * 2, dtype=np.float64)
    found: dict[tuple[int, str], list[FloatArray]] = defaultdict(list)
    for line in objects_path(drive.bag).read_text(encoding="utf-8").splitlines():
        for entry in json.loads(line)["objects"]:
            if entry["visible"] >= _LEAST_VISIBLE:
                found[entry["id"], entry["label"]].append(np.array(entry["box_px"]) / size)
    for (_, label), track in found.items():
        if len(track) >= boxes.LENGTH:
            yield label, np.array(track)


def windows_of(track: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Features of every second window of a track, its boxes jittered as a detector's are."""
    spread = np.tile(track[:, 2:] - track[:, :2], 2)
    noisy = track + _BOX_NOISE * spread * rng.standard_normal(track.shape)
    return np.array(
        [boxes.features(noisy[i : i + boxes.LENGTH]) for i in range(0, len(track) - boxes.LENGTH + 1, 2)]
    )


def train_boxes(cache: Path) -> Network:
    """The classifier of box sequences."""
    rng = np.random.default_rng(_SEED)
    drives = [box_drive(s, seed, cache) for s, seed in product(_SCENARIOS, _TRAIN)]
    tracks = [one for drive in drives for one in tracks_of(drive)]
    features = [windows_of(track, rng) for _, track in tracks]
    groups = [[boxes.group_of(label)] * len(f) for (label, _), f in zip(tracks, features, strict=True)]
    labels = np.concatenate(groups)
    network = fit(np.concatenate(features), labels, hidden=(48, 24))
    worst = []
    for drive in (box_drive(s, seed, cache) for s, seed in product(_SCENARIOS, _PROVE)):
        for label, track in tracks_of(drive):
            p = network.probabilities(windows_of(track, rng))
            worst.append(float(boxes.contradiction(p, boxes.group_of(label), network).max()))
    threshold = float(np.quantile(worst, 1.0 - _TRACKS_ACCUSED))
    print(
        f"boxes: {len(tracks)} tracks train, {len(worst)} prove; classes {network.labels}; threshold "
        f"{threshold:.2f}"
    )
    return _with_threshold(network, threshold)


# -- objectness --------------------------------------------------------------------------------------


def cells_of(drive: Pictures) -> tuple[FloatArray, FloatArray]:
    """Features of all cells of a drive's pictures, and whether each is an object's."""
    drive.render()
    inputs, truth = [], []
    steps = open_recording(drive.bag, odometry="none", imu="none", position="none", detections="none").steps()
    scale = objectness.WIDTH_PX / drive.scenario.width
    lines = objects_path(drive.bag).read_text(encoding="utf-8").splitlines()
    for step, line in zip(steps, lines, strict=True):
        features = objectness.cell_features(step.frame.image)
        rows, columns, width = features.shape
        y, x = (np.mgrid[:rows, :columns] + 0.5) * objectness.CELL_PX / scale
        is_object = np.zeros((rows, columns))
        for entry in json.loads(line)["objects"]:
            x0, y0, x1, y1 = entry["box_px"]
            if entry["visible"] >= _LEAST_VISIBLE:
                is_object[(x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)] = 1.0
        inputs.append(features.reshape(-1, width))
        truth.append(is_object.ravel())
    return np.concatenate(inputs), np.concatenate(truth)


def train_objectness(cache: Path) -> Network:
    """The classifier of cells, and how large an unexplained cluster may be."""
    drives = [look_drive(s, w, seed, cache) for s, w, seed in product(_SCENARIOS, _LOOKED_AT, _TRAIN)]
    found = [cells_of(drive) for drive in drives]
    inputs, truth = np.concatenate([f for f, _ in found]), np.concatenate([t for _, t in found])
    rng = np.random.default_rng(_SEED)
    of_objects = np.flatnonzero(truth > 0.5)
    of_others = rng.choice(np.flatnonzero(truth < 0.5), size=3 * len(of_objects), replace=False)
    chosen = np.concatenate([of_objects, of_others])
    network = fit(inputs[chosen], np.where(truth[chosen] > 0.5, "object", "background"), hidden=(32,))
    largest = []
    for seed in _PROVE:
        drive = box_drive("street-straight", seed, cache)
        settings = drive.scenario.model_copy(update={"width": 640, "height": 480, "duration_s": 10.0})
        proof = Pictures(scenario=settings, cache=cache)
        proof.render()
        simulated, steps = proof.steps()
        rival = objectness.Objectness(simulated.cameras, network=_with_threshold(network, 1e9))
        recording = MemoryRecording(name="proof", cameras=simulated.cameras, joined=steps)
        table = measure(recording.steps(), [], rival).table.columns
        largest += [value for value in table["statistic"] if value is not None]
    threshold = float(np.quantile(largest, 1.0 - _FRAMES_ACCUSED))
    print(
        f"objectness: {len(chosen)} cells train, {len(largest)} frames prove; threshold {threshold:.1f} cells"
    )
    return _with_threshold(network, threshold)


# -- both --------------------------------------------------------------------------------------------


def fit(inputs: FloatArray, labels: Any, hidden: tuple[int, ...]) -> Network:
    """Train a network, all classes weighted by what there is of them.

    Raises
    ------
    MissingExtraError
        Without scikit-learn.
    """
    try:
        from sklearn.neural_network import MLPClassifier
    except ImportError:
        raise MissingExtraError("scikit-learn", "bench") from None
    mean, scale = inputs.mean(axis=0), inputs.std(axis=0) + 1e-6
    model = MLPClassifier(hidden, alpha=1e-3, early_stopping=True, max_iter=200, random_state=_SEED)
    model.fit((inputs - mean) / scale, labels)
    weights, biases = list(model.coefs_), list(model.intercepts_)
    if len(model.classes_) == 2:  # one logistic output: the other class has none
        weights[-1] = np.column_stack([np.zeros(len(weights[-1])), weights[-1]])
        biases[-1] = np.array([0.0, float(biases[-1][0])])
    return Network(
        mean=mean, scale=scale, weights=tuple(weights), biases=tuple(biases),
        labels=tuple(str(label) for label in model.classes_), threshold=0.0,
    )  # fmt: skip


def _with_threshold(network: Network, threshold: float) -> Network:
    from dataclasses import replace

    return replace(network, threshold=threshold)


def main() -> None:
    """Train both, and write their weights."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cache", default="", help="folder of rendered pictures")
    parser.add_argument("--only", choices=("boxes", "objectness"), default=None)
    wanted = parser.parse_args()
    cache = CacheSettings(folder=wanted.cache).path()
    if wanted.only != "objectness":
        train_boxes(cache).save(boxes.WEIGHTS)
    if wanted.only != "boxes":
        train_objectness(cache).save(objectness.WEIGHTS)


if __name__ == "__main__":
    main()
