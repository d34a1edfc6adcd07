"""The bare thresholds of the `paper` profile, from the tail of its errors on clean driving.

They are set so high that the exponential tail exceeds them at the stated rate: peaks over threshold (Coles,
*An Introduction to Statistical Modeling of Extreme Values*, 2001, chapter 4) with shape zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from belie.detector import Config
from belie.evaluation.calibrate_part import LEAST_FRAMES, SettingPath, TeachingPart, changed
from belie.evaluation.run import Run, run_detector
from belie.geometry import FloatArray
from belie.types import RecordingError

_TAIL = 0.9


def learn_thresholds(
    parts: Sequence[TeachingPart], config: Config, advance: Callable[[], None]
) -> tuple[Config, dict[str, str]]:
    """Settings with T1 to T3 for the stated false-alarm rate, and a note on each, by dotted name.

    Raises
    ------
    RecordingError
        If there is no error to learn from.

    Examples
    --------
    >>> learn_thresholds([], Config(), lambda: None)
    Traceback (most recent call last):
    ...
    belie.types.errors.RecordingError: the paper's checks gave no value to learn a threshold from; \
is there an odometry?
    """
    runs = [run_detector(part, config, on_verdict=lambda _: advance(), pictures=False) for part in parts]
    changes: dict[SettingPath, object] = {}
    error = _tail_threshold(runs, "odometry", config)
    if error is not None:
        changes["paper", "odometry_error_px2"] = float(f"{error:.3g}")
        changes["paper", "vouched_error_px2"] = float(f"{error / 2.0:.3g}")  # the paper's T2 is half its T1
    step = _tail_threshold(runs, "position", config)
    if step is not None:
        changes["paper", "position_step_m2"] = float(f"{step:.3g}")
    if not changes:
        raise RecordingError(
            "the paper's checks gave no value to learn a threshold from; is there an odometry?"
        )
    rate = config.sequential.false_alarms_per_hour
    note = f"calibrated: the tail of clean driving exceeds it {rate:g} times an hour"
    return changed(config, changes), {".".join(path): note for path in changes}


def _tail_threshold(runs: Sequence[Run], check: str, config: Config) -> float | None:
    found = [
        (trace.statistic[np.isfinite(trace.statistic)], run)
        for run in runs
        for trace in run.trace.checks
        if trace.check == check
    ]
    values = np.concatenate([value for value, _ in found]) if found else np.empty(0)
    if len(values) < LEAST_FRAMES // 2:
        return None
    interval_s = float(np.median(np.concatenate([np.diff(run.trace.seconds) for _, run in found])))
    return exceeded_at(values, config.sequential.false_alarms_per_hour * interval_s / 3600.0)


def exceeded_at(values: FloatArray, probability: float) -> float:
    """The value that the exponential tail of a sample exceeds with this probability.

    >>> import numpy as np
    >>> sample = np.random.default_rng(0).exponential(2.0, 100_000)
    >>> round(exceeded_at(sample, 1e-6) / (2.0 * float(np.log(1e6))), 1)
    1.0
    """
    start = float(np.quantile(values, _TAIL))
    excess = float(np.mean(values[values > start] - start)) if (values > start).any() else 0.0
    return float(start + excess * max(0.0, math.log((1.0 - _TAIL) / probability)))
