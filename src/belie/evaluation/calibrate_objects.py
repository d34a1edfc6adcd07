"""How a robot's object detector errs when nobody attacks it: how often it misses or misnames, and for how long.

A detector whose misses last (the next image shares their cause) is given patience from the first frame on; without, the
checks must first see its gaps, and take the first long one for a lie.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from belie.detector import Config, Detector
from belie.evaluation.calibrate_part import SettingPath, TeachingPart, changed
from belie.evaluation.intervals import wilson_interval

_NOBODY_ACCUSED = 1e-200  # false alarms an hour: what is accused would teach nothing
_LEAST_MESSAGES = 200  # about objects: fewer show no habit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LearntHabits:
    """What `learn_habits` found.

    Parameters
    ----------
    config : Config
        The settings, with the habits of the detectors that were heard.
    notes : mapping of str to str
        On each setting that changed, by dotted name.
    words : tuple of str
        What was seen, line by line, with intervals (Wilson, 95 %); and what was not learned, and why.
    """

    config: Config
    notes: Mapping[str, str]
    words: tuple[str, ...]


def learn_habits(
    parts: Sequence[TeachingPart],
    config: Config,
    advance: Callable[[], None],
    *,
    from_accused: bool = True,
) -> LearntHabits:
    """Settings with the habits of the detectors that were heard.

    Where several detectors were heard, each setting is that of the one which errs most.

    Parameters
    ----------
    parts : sequence of TeachingPart
        Attack-free.
    config : Config
        Where to start from.
    advance : callable
        Is called for every frame.
    from_accused : bool
        Whether errors teach that the settings as they are take for an attack.

    Examples
    --------
    >>> learnt = learn_habits([], Config(), lambda: None)
    >>> learnt.config == Config(), learnt.words
    (True, ())
    """
    nobody: dict[SettingPath, object] = {("sequential", "false_alarms_per_hour"): _NOBODY_ACCUSED}
    measuring = changed(config, nobody) if from_accused else config
    found: dict[str, float] = {}
    words, messages = [], 0.0
    # Messages about objects that one part holds, by detector: also by those that are silent while it teaches.
    streams = (stream for part in parts for stream in getattr(part, "streams", ()))
    most = {stream.topic: 0.0 for stream in streams if stream.used and stream.role == "detections"}
    for part in parts:
        detector = Detector(part.cameras, measuring)
        for step in part.steps():
            detector.update(step.frame, step.claims)
            advance()
        for source, habits in detector.object_habits().items():
            most[source] = max(habits["messages"], most.get(source, 0.0))
            if habits["messages"] >= _LEAST_MESSAGES:
                messages += habits["messages"]
                words.append(f"{source}: {_in_words(habits)}")
                for name in ("miss_rate", "confusion_rate", "persistence_s"):
                    found[name] = max(habits[name], found.get(name, 0.0))
    words += [
        f"{source}: its misses and misnamings were not learned: {count:.0f} messages about objects that it should see, "
        f"{_LEAST_MESSAGES} of one recording are needed; the settings stay as they were"
        for source, count in most.items()
        if count < _LEAST_MESSAGES
    ]
    changes: dict[SettingPath, object] = {("objects", name): float(f"{v:.3g}") for name, v in found.items()}
    notes = {f"objects.{name}": f"calibrated: {messages:.0f} messages about objects" for name in found}
    return LearntHabits(config=changed(config, changes), notes=notes, words=tuple(words))


def _in_words(habits: Mapping[str, float]) -> str:
    count = round(habits["messages"])
    said = []
    for what, name in (("misses", "miss_rate"), ("misnames", "confusion_rate")):
        interval = wilson_interval(min(round(habits[name] * count), count), count)
        assert interval is not None
        share, low, high = (f"{100 * x:.2f}" for x in (habits[name], *interval))
        said.append(f"{what} {share} % ({low} to {high} %)")
    return f"{' and '.join(said)} of {count} messages about objects that it should see"
