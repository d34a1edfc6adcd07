"""A small feed-forward network in NumPy: trained elsewhere, kept as one file of weights, run without a framework."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from belie.geometry import FloatArray
from belie.types import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Network:
    """Standardised input, ReLU layers, and class probabilities.

    Parameters
    ----------
    mean, scale : array (D,)
        Of the input.
    weights, biases : tuple of array
        Layer by layer: (in, out) and (out,).
    labels : tuple of str
        The classes.
    threshold : float
        Above which the detector that uses it accuses; found on drives that did not train it.

    Examples
    --------
    >>> net = Network(mean=np.zeros(1), scale=np.ones(1), weights=(np.array([[1.0, -1.0]]),), biases=(np.zeros(2),),
    ...               labels=("a", "b"), threshold=1.0)
    >>> net.probabilities(np.array([[3.0]])).round(3).tolist()
    [[0.998, 0.002]]
    """

    mean: FloatArray
    scale: FloatArray
    weights: tuple[FloatArray, ...]
    biases: tuple[FloatArray, ...]
    labels: tuple[str, ...]
    threshold: float

    def probabilities(self, inputs: FloatArray) -> FloatArray:
        """Of each class, for inputs (N, D): (N, classes)."""
        x = (inputs - self.mean) / self.scale
        for i, (W, b) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = x @ W + b
            if i < len(self.weights) - 1:
                x = np.maximum(x, 0.0)
        x = np.exp(x - x.max(axis=1, keepdims=True))
        return np.asarray(x / x.sum(axis=1, keepdims=True))

    def save(self, path: Path) -> None:
        """Write one file; half precision is enough for weights."""
        layers: dict[str, Any] = {}
        for i, (W, b) in enumerate(zip(self.weights, self.biases, strict=True)):
            layers[f"W{i}"], layers[f"b{i}"] = W.astype(np.float16), b.astype(np.float16)
        np.savez_compressed(
            path,
            mean=self.mean.astype(np.float32),
            scale=self.scale.astype(np.float32),
            labels=np.array(self.labels),
            threshold=np.float64(self.threshold),
            **layers,
        )

    @classmethod
    def load(cls, path: Path) -> Network:
        """Read what `save` wrote.

        Raises
        ------
        ConfigError
            If the file is missing.
        """
        if not path.is_file():
            raise ConfigError(f"{path} is missing: python -m belie.evaluation.bench.rivals.train makes it")
        with np.load(path, allow_pickle=False) as data:
            count = sum(name.startswith("W") for name in data.files)
            return cls(
                mean=data["mean"].astype(np.float64),
                scale=data["scale"].astype(np.float64),
                weights=tuple(data[f"W{i}"].astype(np.float64) for i in range(count)),
                biases=tuple(data[f"b{i}"].astype(np.float64) for i in range(count)),
                labels=tuple(str(label) for label in data["labels"]),
                threshold=float(data["threshold"]),
            )
