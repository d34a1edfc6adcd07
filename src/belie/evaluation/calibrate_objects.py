"""How a robot's object detector errs when nobody attacks it: how often it misses or misnames, and for how long.

A detector whose misses last (the next image shares their cause) is given patience from the first frame on; without, the
checks must first see its gaps, and take the first long one for a lie.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from belie.detector import Config, Detector
from belie.evaluation.calibrate_part import SettingPath, TeachingPart, changed

_NOBODY_ACCUSED = 1e-300  # false alarms an hour: what is accused would teach nothing
_LEAST_MESSAGES = 200  # about objects: fewer show no habit


def learn_habits(
    parts: Sequence[TeachingPart], config: Config, advance: Callable[[], None]
) -> tuple[Config, dict[str, str]]:
    """Settings with the habits of the detectors that were heard, and a note on each that changed, by dotted name.

    Where several detectors were heard, each setting is that of the one which errs most.

    Examples
    --------
    >>> config, notes = learn_habits([], Config(), lambda: None)
    >>> config == Config(), notes
    (True, {})
    """
    measuring = changed(config, {("sequential", "false_alarms_per_hour"): _NOBODY_ACCUSED})
    found: dict[str, float] = {}
    messages = 0.0
    for part in parts:
        detector = Detector(part.cameras, measuring)
        for step in part.steps():
            detector.update(step.frame, step.claims)
            advance()
        for habits in detector.object_habits().values():
            if habits["messages"] >= _LEAST_MESSAGES:
                messages += habits["messages"]
                for name in ("miss_rate", "confusion_rate", "persistence_s"):
                    found[name] = max(habits[name], found.get(name, 0.0))
    changes: dict[SettingPath, object] = {("objects", name): float(f"{v:.3g}") for name, v in found.items()}
    notes = {f"objects.{name}": f"calibrated: {messages:.0f} messages about objects" for name in found}
    return changed(config, changes), notes
