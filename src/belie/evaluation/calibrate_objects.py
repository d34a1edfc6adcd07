"""How a robot's object detector errs when nobody attacks it: how often it misses or misnames, and for how long.

A detector whose misses last (the next image shares their cause) is given patience from the first frame on; without, the
checks must first see its gaps, and take the first long one for a lie.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from belie.detector import Config, Detector
from belie.detector.object_habits import ObjectHabits
from belie.evaluation.calibrate_habits import fitted, messages_of
from belie.evaluation.calibrate_part import SettingPath, TeachingPart, changed
from belie.evaluation.intervals import wilson_interval

_NOBODY_ACCUSED = 1e-200  # false alarms an hour: what is accused would teach nothing
_LEAST_MESSAGES = 200  # about objects: fewer show no habit
_ERRORS = ("misses", "misnames")
_WEIGHTS = ("prior_messages", "prior_gaps", "object_messages", "object_gaps")


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

    What all recordings show of one detector is put together. Where several detectors were heard, each setting is that
    of the one which errs most; and where one recording alone clearly shows more, that is set: fog has its own.

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
    # Also detectors that are silent while their recordings teach.
    streams = (stream for part in parts for stream in getattr(part, "streams", ()))
    heard: dict[str, list[ObjectHabits]] = {
        stream.topic: [] for stream in streams if stream.used and stream.role == "detections"
    }
    for part in parts:
        detector = Detector(part.cameras, measuring)
        for step in part.steps():
            detector.update(step.frame, step.claims)
            advance()
        for source, habits in detector.object_habits().items():
            heard.setdefault(source, []).append(habits)
    found: dict[str, float] = {}
    words, unlearned, messages, misses = [], [], 0.0, 0.0
    for source, each in heard.items():
        count = messages_of(each)
        if count < _LEAST_MESSAGES:
            unlearned.append(
                f"{source}: its misses and misnamings were not learned: {count:.0f} messages about "
                f"objects that it should see, {_LEAST_MESSAGES} are needed; the settings stay as they were"
            )
            continue
        messages += count
        misses += sum(habits.missed.wrong for habits in each)
        worse = _worse(each)
        words.append(f"{source}: {_in_words(each)}" + f", in {len(each)} recordings" * (len(each) > 1))
        words += [f"{source}: one of them alone {_in_words([one])}: the larger is set" for one in worse]
        for settings in (
            fitted(each, measuring.objects),
            *(fitted([one], measuring.objects) for one in worse),
        ):
            for name, value in settings.items():
                # Of several the one that errs most, and that shows least how much all objects are alike.
                pick = min if name in _WEIGHTS else max
                found[name] = pick(found.get(name, value), value)
    words += unlearned
    changes: dict[SettingPath, object] = {("objects", name): float(f"{v:.3g}") for name, v in found.items()}
    seen = f"calibrated: {messages:.0f} messages about objects, {misses:.0f} of them missed"
    notes = {f"objects.{name}": seen for name in found}
    return LearntHabits(config=changed(config, changes), notes=notes, words=tuple(words))


def _worse(each: Sequence[ObjectHabits]) -> list[ObjectHabits]:
    """The recordings that alone show more errors than all together, by more than chance."""
    together = [_interval(each, error)[0] for error in _ERRORS]
    return [
        habits
        for habits in each
        if habits.messages >= _LEAST_MESSAGES
        and any(_interval([habits], error)[1] > share for error, share in zip(_ERRORS, together, strict=True))
    ]


def _interval(each: Sequence[ObjectHabits], error: str) -> tuple[float, float, float]:
    """Share of messages in error, and its interval."""
    counts = [habits.missed if error == "misses" else habits.misnamed for habits in each]
    wrong, count = round(sum(c.wrong for c in counts)), round(sum(c.right + c.wrong for c in counts))
    interval = wilson_interval(min(wrong, count), count) or (0.0, 1.0)
    return wrong / max(count, 1), *interval


def _in_words(each: Sequence[ObjectHabits]) -> str:
    said = []
    for error in _ERRORS:
        share, low, high = (f"{100 * x:.2f}" for x in _interval(each, error))
        said.append(f"{error} {share} % ({low} to {high} %)")
    return f"{' and '.join(said)} of {messages_of(each):.0f} messages about objects that it should see"
