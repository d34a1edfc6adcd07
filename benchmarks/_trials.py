"""Attacks tried at many onsets without running the honest frames again for each of them."""

from __future__ import annotations

import copy
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from _recordings import MemoryRecording
from belie.attacks import AttackLabel, attack
from belie.detector import Config, Detector
from belie.detector.eyes import Eyes
from belie.evaluation.intervals import wilson_interval
from belie.evaluation.score import RaisedAlert, score
from belie.geometry import FloatArray
from belie.odometry import VisualOdometry
from belie.types import Frame, PositionClaim, Status, Step, Verdict, VisualEstimate

# Frames run past those allowed: the first false position may be stamped a few frames after the onset.
_MORE_FRAMES = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What became of one attack.

    Parameters
    ----------
    spec : str
        The attack.
    allowed : int
        Attacked frames within which an alert is a hit, the first one included.
    delay : int or None
        Attacked frames before the one that raised the right alert: 0 is at once; None is a miss.
    wrong : tuple of str
        Other alerts up to then, or in the whole window where it was missed.
    undecided : tuple of str
        Reasons for which the attacked stream was not judged in the window, one a frame.
    frames : int
        Attacked frames that were run.
    """

    spec: str
    allowed: int
    delay: int | None
    wrong: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()
    frames: int = 0

    @property
    def hit(self) -> bool:
        """Whether the right alert came in time, and no wrong one before it."""
        return self.delay is not None and self.delay < self.allowed and not self.wrong

    @property
    def abstained(self) -> bool:
        """Whether it was missed because the stream was hardly ever judged, and the reason said."""
        return self.delay is None and not self.wrong and len(self.undecided) >= 0.5 * self.frames > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class FalseAlert:
    """An alert without an attack, with what was said of it."""

    frame: int
    alert: str
    reason: str


@dataclass
class LookOnce:
    """The default profile's eyes, which no claim comes near: what they saw once is what they would see again."""

    eyes: Eyes
    estimates: dict[int, VisualEstimate] = field(default_factory=dict)
    remembers: bool = False

    def __deepcopy__(self, memo: dict[int, Any]) -> LookOnce:
        """With eyes of its own; what was seen is shared."""
        return LookOnce(copy.deepcopy(self.eyes, memo), self.estimates, self.remembers)

    def update(self, frame: Frame) -> VisualEstimate:
        """The estimate of this very frame."""
        if not self.remembers:
            self.estimates[id(frame)] = self.eyes.update(frame)
        return self.estimates[id(frame)]

    def scene(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """No corners with depths: only the object checks ask, and these recordings hold no detections."""
        return np.empty((0, 2)), np.empty(0), np.empty(0)

    def half(self) -> None:
        """No image is kept."""
        return


@dataclass
class HonestRun:
    """A detector run once over an honest recording, its state kept before every frame in `keep`."""

    recording: MemoryRecording
    config: Config
    keep: Sequence[int] = ()
    verdicts: list[Verdict] = field(default_factory=list)
    _states: dict[int, tuple[Detector, LookOnce | None]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        ((_, camera),) = self.recording.cameras.items()
        eyes = None
        if self.config.profile == "default":
            eyes = LookOnce(VisualOdometry(camera.model, self.config.visual_odometry, self.config.tracking))
        detector = Detector(self.recording.cameras, self.config, eyes=eyes)
        wanted = {0, *self.keep}
        for index, step in enumerate(self.recording.steps()):
            if index in wanted:
                self._states[index] = copy.deepcopy((detector, eyes))
            self.verdicts.append(detector.update(step.frame, step.claims))

    @property
    def false_alerts(self) -> list[FalseAlert]:
        """Every alert of the honest run."""
        return [
            FalseAlert(frame=one.frame, alert=_name(one), reason=_reason(self.verdicts[one.frame], one))
            for one in score(self.verdicts, []).false_alerts
        ]

    def undecided(self, check: str, first: int) -> tuple[float, Counter[str]]:
        """Share of the frames from `first` on in which a check had no answer, and why."""
        results = [r for verdict in self.verdicts[first:] for r in verdict.checks if r.check == check]
        reasons = Counter(without_numbers(r.reason) for r in results if r.status is Status.UNDECIDED)
        return (reasons.total() / len(results) if results else float("nan")), reasons

    def attacked(self, spec: str, onset: int, allowed: int, least_m: float = 0.0) -> Trial | None:
        """Run on from the last state that the attack has not touched; None for a lie below `least_m`."""
        recording = attack(self.recording.until(onset + allowed + _MORE_FRAMES), spec)
        (label,) = recording.labels
        steps = list(recording.steps())
        first = _first_difference(self.recording.joined, steps)
        if least_m > 0.0 and _lie_m(self.recording.joined[first], steps[first]) < least_m:
            return None
        start = max(index for index in self._states if index <= first)
        detector, eyes = copy.deepcopy(self._states[start])
        if eyes is not None:
            eyes.remembers = label.stream != "camera"
        verdicts: list[Verdict] = []
        for step in steps[start:]:
            verdicts.append(detector.update(step.frame, step.claims))
            if any(a.type == label.alert and a.source in label.sources for a in verdicts[-1].alerts):
                break
        return _trial(spec, allowed, verdicts, label)


def onsets_of(frames: int, first: int, allowed: int, count: int) -> list[int]:
    """Up to `count` onsets, spread evenly from `first` so that the frames allowed follow each."""
    last = frames - allowed - _MORE_FRAMES
    if last < first:
        return []
    return sorted({round(x) for x in np.linspace(first, last, min(count, last - first + 1))})


def kept_frames(recording: MemoryRecording, onsets: Sequence[int]) -> list[int]:
    """Before which frames to keep the detector: so early that no claim of the onset has been handed out."""
    period_ns = float(np.median(np.diff(recording.frame_stamps_ns())))
    lead = 1 + int(np.ceil(100e6 / period_ns))  # the slowest stream has 10 Hz
    return sorted({max(0, onset - lead) for onset in onsets})


def rate_text(trials: Sequence[Trial]) -> str:
    """Hits of trials with Wilson's interval."""
    hits = sum(trial.hit for trial in trials)
    interval = wilson_interval(hits, len(trials))
    if interval is None:
        return "–"
    return f"{hits}/{len(trials)} ({100 * interval[0]:.0f}–{100 * interval[1]:.0f} %)"


def without_numbers(reason: str) -> str:
    """A reason without its figures, so that equal ones can be counted."""
    return re.sub(r"\d+(\.\d+)?(e[+-]?\d+)?", "#", reason)


def _first_difference(honest: Sequence[Step], attacked: Sequence[Step]) -> int:
    for index, (a, b) in enumerate(zip(honest, attacked, strict=False)):
        if a.frame is not b.frame or any(x is not y for x, y in zip(a.claims, b.claims, strict=True)):
            return index
    raise ValueError("the attack changed nothing")


def _lie_m(honest: Step, attacked: Step) -> float:
    """How far the first false position of a step is off."""
    for x, y in zip(honest.claims, attacked.claims, strict=True):
        if x is not y and isinstance(x, PositionClaim) and isinstance(y, PositionClaim):
            return float(np.linalg.norm(y.position_m - x.position_m))
    return np.inf


def _trial(spec: str, allowed: int, verdicts: list[Verdict], label: AttackLabel) -> Trial:
    result = score(verdicts, [label])
    (scored,) = result.labels
    # Where images are faster than positions, frames go by before the first false one.
    begin_ns = label.onset_ns if label.stream == "position" else label.start_ns
    delay = scored.delay_frames
    if delay is not None:
        delay -= sum(label.start_ns <= verdict.stamp_ns < begin_ns for verdict in verdicts)
    window = [verdict for verdict in verdicts if verdict.stamp_ns >= begin_ns]
    undecided = [
        without_numbers(r.reason)
        for verdict in window
        for r in verdict.checks
        if (r.check, r.source) == (label.stream, label.sources[0]) and r.status is Status.UNDECIDED
    ]
    wrong = (*result.wrong_attributions, *result.false_alerts)
    return Trial(
        spec=spec,
        allowed=allowed,
        delay=delay,
        wrong=tuple(f"frame {one.frame}: {_name(one)}" for one in wrong),
        undecided=tuple(undecided),
        frames=len(window),
    )


def _name(raised: RaisedAlert) -> str:
    return f"{raised.alert.type.value} {raised.alert.source}"


def _reason(verdict: Verdict, raised: RaisedAlert) -> str:
    said = [
        f"{r.check}: {r.reason} ({r.statistic:.3g} > {r.threshold:.3g} {r.unit})"
        if r.statistic is not None and r.threshold is not None
        else f"{r.check}: {r.reason}"
        for r in verdict.checks
        if r.status is Status.CONTRADICTED and r.source == raised.alert.source
    ]
    return "; ".join(said)
