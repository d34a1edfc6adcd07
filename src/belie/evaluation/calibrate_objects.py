"""How a robot's object detector errs when nobody attacks it: how often it misses or misnames, and for how long.

A detector whose misses last (the next image shares their cause) is given patience from the first frame on; without, the
checks must first see its gaps, and take the first long one for a lie.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from belie.checks.objects import ObjectSettings
from belie.detector import Config, Detector
from belie.evaluation.calibrate_part import SettingPath, TeachingPart, changed
from belie.evaluation.intervals import wilson_interval

_NOBODY_ACCUSED = 1e-200  # false alarms an hour: what is accused would teach nothing
_LEAST_MESSAGES = 200  # about objects: fewer show no habit
_ERRORS = (("misses", "miss_rate"), ("misnames", "confusion_rate"))
_HABITS = (*(name for _, name in _ERRORS), "persistence_s")


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
    heard: dict[str, list[Mapping[str, float]]] = {
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
    words, unlearned, messages = [], [], 0.0
    for source, each in heard.items():
        together = pooled(each, measuring.objects)
        if together["messages"] < _LEAST_MESSAGES:
            unlearned.append(
                f"{source}: its misses and misnamings were not learned: {together['messages']:.0f} messages about "
                f"objects that it should see, {_LEAST_MESSAGES} are needed; the settings stay as they were"
            )
            continue
        messages += together["messages"]
        worse = _worse(each, together)
        words.append(f"{source}: {_in_words(together)}" + f", in {len(each)} recordings" * (len(each) > 1))
        words += [f"{source}: one of them alone {_in_words(one)}: the larger is set" for one in worse]
        for name in _HABITS:
            found[name] = max(found.get(name, 0.0), *(one[name] for one in (together, *worse)))
    words += unlearned
    changes: dict[SettingPath, object] = {("objects", name): float(f"{v:.3g}") for name, v in found.items()}
    notes = {f"objects.{name}": f"calibrated: {messages:.0f} messages about objects" for name in found}
    return LearntHabits(config=changed(config, changes), notes=notes, words=tuple(words))


def pooled(each: Sequence[Mapping[str, float]], prior: ObjectSettings) -> dict[str, float]:
    """The habits of one detector that several recordings show together.

    Each of `each` (of `Detector.object_habits`) is what was counted and what was expected before; so that the
    expectation counts once, it is taken out of all but one. The time for which errors last is weighed by how many
    errors show it.

    >>> one = {"miss_rate": 0.05, "confusion_rate": 0.01, "persistence_s": 0.05, "messages": 60.0}
    >>> both = pooled([one, one], ObjectSettings(miss_rate=0.03, prior_messages=40))
    >>> both["messages"], round(both["miss_rate"], 4)  # 3.8 misses in 60 messages, twice; and 1.2 in 40, as expected
    (120.0, 0.055)
    """
    n, again = prior.prior_messages, len(each) - 1
    total = sum(habits["messages"] for habits in each)
    found = {"messages": total}
    for name, expected in (("miss_rate", prior.miss_rate), ("confusion_rate", prior.confusion_rate)):
        wrong = sum(habits[name] * (habits["messages"] + n) for habits in each) - again * n * expected
        found[name] = max(wrong, 0.0) / (total + n)
    gaps = [max(h["miss_rate"] * (h["messages"] + n) - n * prior.miss_rate, 0.0) for h in each]
    lasted = sum(h["persistence_s"] * (k + prior.prior_gaps) for h, k in zip(each, gaps, strict=True))
    lasted -= again * prior.prior_gaps * prior.persistence_s
    shortest = min((h["persistence_s"] for h in each), default=prior.persistence_s)
    found["persistence_s"] = max(lasted / (sum(gaps) + prior.prior_gaps), shortest)
    return found


def _worse(each: Sequence[Mapping[str, float]], together: Mapping[str, float]) -> list[Mapping[str, float]]:
    """The recordings that alone show more errors than all together, by more than chance."""
    return [
        habits
        for habits in each
        if habits["messages"] >= _LEAST_MESSAGES
        and any(_interval(habits, name)[0] > together[name] for _, name in _ERRORS)
    ]


def _interval(habits: Mapping[str, float], name: str) -> tuple[float, float]:
    count = round(habits["messages"])
    interval = wilson_interval(min(round(habits[name] * count), count), count)
    assert interval is not None
    return interval


def _in_words(habits: Mapping[str, float]) -> str:
    said = []
    for what, name in _ERRORS:
        share, low, high = (f"{100 * x:.2f}" for x in (habits[name], *_interval(habits, name)))
        said.append(f"{what} {share} % ({low} to {high} %)")
    return f"{' and '.join(said)} of {habits['messages']:.0f} messages about objects that it should see"
