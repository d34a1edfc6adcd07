"""How noisy the streams of a robot are: the `default` profile has its thresholds in units of that noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from belie.detector import Config, Detector
from belie.evaluation.calibrate_part import SettingPath, TeachingPart, changed
from belie.evaluation.run import run_detector
from belie.types import RecordingError, Verdict

_PASSES = 3  # the noise of the images is part of what is seen: a second and third look correct for it
_CLOSE_ENOUGH = 0.1
_MOST_CHANGE = 10.0  # further away, something is broken that noise must not cover up
_BACKING_OFF = (1.0, 0.66, 0.33, 0.0)  # how much of a reduction of noise is kept, tried in turn
_COMFORTABLE = 0.6  # of the threshold: what honest noise of some minutes reaches, with a margin
_NOISIEST = 0.9  # quantile over time: settings must hold for the noisier stretches too

# Which settings scale with which residual components of which check.
_SCALED: Mapping[str, Mapping[tuple[str, str], tuple[str, ...]]] = {
    "odometry": {
        ("odometry", "translation_noise"): ("x", "y", "z"),
        ("odometry", "translation_floor_m"): ("x", "y", "z"),
        ("odometry", "rotation_noise_deg"): ("pitch", "yaw", "roll"),
    },
    "imu": {("imu", "rotation_noise_deg"): ("pitch", "yaw", "roll")},
}


def learn_noise(
    parts: Sequence[TeachingPart], config: Config, advance: Callable[[], None]
) -> tuple[Config, dict[str, str]]:
    """Settings with the noise that was seen, and a note on each that changed, by dotted name.

    Raises
    ------
    RecordingError
        If there is no stream to learn from.

    Examples
    --------
    >>> learn_noise([], Config(), lambda: None)
    Traceback (most recent call last):
    ...
    belie.types.errors.RecordingError: the recordings hold no odometry and no IMU whose noise could be learned
    """
    calibrated = config
    for _ in range(_PASSES):
        factors = _noise_factors(parts, calibrated, advance)
        if not factors:
            raise RecordingError("the recordings hold no odometry and no IMU whose noise could be learned")
        changes: dict[SettingPath, object] = {}
        for (group, name), factor in factors.items():
            start, now = _value(config, (group, name)), _value(calibrated, (group, name))
            value = np.clip(now * factor, start / _MOST_CHANGE, start * _MOST_CHANGE)
            changes[group, name] = float(f"{value:.3g}")
        calibrated = changed(calibrated, changes)
        if all(abs(math.log(factor)) < _CLOSE_ENOUGH for factor in factors.values()):
            break
    calibrated = _backed_off(parts, config, calibrated, list(factors), advance)
    notes = {
        ".".join(
            path
        ): f"calibrated: {_value(calibrated, path) / _value(config, path):.2g} times the value before"
        for path in factors
    }
    return calibrated, notes


def _backed_off(
    parts: Sequence[TeachingPart],
    start: Config,
    learnt: Config,
    paths: Sequence[tuple[str, str]],
    advance: Callable[[], None],
) -> Config:
    """Less noise only as far as what taught it stays well below its thresholds; else nearer to the start."""
    for step in _BACKING_OFF:
        changes: dict[SettingPath, object] = {
            path: float(f"{_value(start, path) * (_value(learnt, path) / _value(start, path)) ** step:.3g}")
            for path in paths
            if _value(learnt, path) < _value(start, path)
        }
        tried = changed(learnt, changes)
        if not changes or all(_largest_ratio(part, tried, advance) < _COMFORTABLE for part in parts):
            break
    return tried


def _largest_ratio(part: TeachingPart, config: Config, advance: Callable[[], None]) -> float:
    run = run_detector(part, config, on_verdict=lambda _: advance(), pictures=False)
    return max(
        (float(np.nanmax(c.ratio)) for c in run.trace.checks if np.isfinite(c.ratio).any()), default=0.0
    )


def _value(config: Config, path: tuple[str, str]) -> float:
    return float(getattr(getattr(config, path[0]), path[1]))


def _noise_factors(
    parts: Sequence[TeachingPart], config: Config, advance: Callable[[], None]
) -> dict[tuple[str, str], float]:
    """By how much each noise setting must grow or shrink, from the ratios seen over modelled noise."""
    # To measure, the scale must be free to fall, and nothing be accused: contradicted frames teach nothing.
    measuring = changed(
        config,
        {
            ("noise", "least_scale"): 0.02,
            ("sequential", "false_alarms_per_hour"): 1e-12,
            ("sequential", "jump_sigma"): 1e6,
        },
    )
    factors: dict[tuple[str, str], float] = {}
    for part in parts:
        detector = Detector(part.cameras, measuring)
        seen: dict[str, list[dict[str, float]]] = {}

        def note(verdict: Verdict, detector: Detector = detector, seen: Any = seen) -> None:
            advance()
            for key, ratios in detector.noise_scales().items():
                seen.setdefault(key, []).append(ratios)

        run_detector(part, measuring, detector=detector, on_verdict=note, pictures=False)
        for key, ratios in seen.items():
            check = key.partition(":")[0]
            settled = ratios[min(len(ratios) // 2, config.noise.memory_frames) :]
            # What is learned from n frames is known to about 0.8 / sqrt(n): err towards more noise.
            caution = 1.0 + 0.8 / math.sqrt(max(len(settled), 1))
            for setting, components in _SCALED["imu" if check == "imu" else "odometry"].items():
                noisiest = max(
                    float(np.quantile([ratio[component] for ratio in settled], _NOISIEST))
                    for component in components
                )
                factors[setting] = max(caution * noisiest, factors.get(setting, 0.0))
    return factors
