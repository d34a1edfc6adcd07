"""Settings from attack-free driving, proven on driving that they were not made from.

Two thirds of every recording teach; the last third is checked with the outcome. The `default` profile's thresholds
follow from the stated false-alarm rate, so what is measured is the noise that they are in units of (`calibrate_noise`),
the errors of the object detector (`calibrate_objects`), and whether the tail of each statistic keeps that rate
(`calibrate_tail`). Clock offsets and correlations are told (`calibrate_streams`): the checks allow for the one by their
noise, and whiten the other as they run. The `paper` profile has bare thresholds, which are set for the stated rate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from belie.detector import Config
from belie.evaluation.calibrate_noise import learn_noise
from belie.evaluation.calibrate_objects import learn_habits
from belie.evaluation.calibrate_part import TeachingPart, changed
from belie.evaluation.calibrate_streams import stream_notes
from belie.evaluation.calibrate_tail import tails, tightened
from belie.evaluation.calibrate_thresholds import learn_thresholds
from belie.evaluation.intervals import poisson_upper
from belie.evaluation.run import Checked, Run, run_detector
from belie.evaluation.trace import CheckTrace
from belie.types import RecordingError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Calibration:
    """What `calibrate` found.

    Parameters
    ----------
    config, start : Config
        The settings, calibrated, and those that it started from.
    notes : mapping of str to str
        How each setting was found, by dotted name.
    learnt_s, held_out_s : float
        Seconds of driving that taught, and that proved.
    largest_ratio : mapping of str to float
        For each check and stream, the largest statistic over threshold on the held-out part; 1 is an alarm.
    seen : tuple of str
        What else was seen, line by line: clocks, correlations, the detector's errors, tails.
    """

    config: Config
    start: Config
    notes: Mapping[str, str]
    learnt_s: float
    held_out_s: float
    largest_ratio: Mapping[str, float]
    seen: tuple[str, ...] = ()

    @property
    def provable_per_hour(self) -> float:
        """The lowest false-alarm rate that this much driving without one can prove, at 95 %, per hour."""
        return poisson_upper(0) / (self.learnt_s + self.held_out_s) * 3600.0

    def words(self) -> list[str]:
        """What was asked for and what was measured, line by line."""
        asked = self.start.sequential.false_alarms_per_hour
        seconds = self.learnt_s + self.held_out_s
        proof = (
            f"alone it proves at best one false alarm per {_period(3600.0 / self.provable_per_hour)} (95 %)"
        )
        if self.provable_per_hour > asked:
            hours = poisson_upper(0) / asked
            proof += "; what was asked for rests on the noise model: "
            proof += f"to prove it takes {_period(3600.0 * hours)} of driving"
        return [
            f"Calibrated on {seconds:.0f} s of driving: {self.learnt_s:.0f} s taught, "
            f"{self.held_out_s:.0f} s proved.",
            f"Asked for: at most one false alarm per {_period(3600.0 / asked)}, all checks together "
            f"(false_alarms_per_hour = {asked:g}).",
            f"Measured: no alert in {seconds:.0f} s; {proof}.",
            *(f"Measured: {line}" for line in self.seen),
            *(
                f"Held out: {name} came to {ratio:.2f} of its threshold at most (1 is an alarm)."
                for name, ratio in self.largest_ratio.items()
            ),
        ]

    def set_words(self) -> list[str]:
        """Each setting that was found, what it was before, and why, line by line."""
        lines = []
        for name, note in self.notes.items():
            now, before = (_value(config, name) for config in (self.config, self.start))
            lines.append(f"Set: {name} = {now:g} (before: {before:g}): {note.removeprefix('calibrated: ')}")
        return lines


def _value(config: Config, name: str) -> float:
    """A number among the settings, by dotted name."""
    return float(attrgetter(name)(config))


def calibrate(
    recordings: Sequence[Checked],
    config: Config,
    *,
    on_frame: Callable[[], None] | None = None,
) -> Calibration:
    """Measure the noise of attack-free recordings and set it as the noise of the checks.

    Parameters
    ----------
    recordings : sequence of Recording
        Attack-free.
    config : Config
        Where to start from; its profile and false-alarm rate stay.
    on_frame : callable, optional
        Is called for every frame of every pass.

    Raises
    ------
    RecordingError
        If a recording raises alerts (looks attacked), is too short, or the outcome fails on the last third.
    ValueError
        Without recordings.

    Examples
    --------
    >>> calibrate([], Config())
    Traceback (most recent call last):
    ...
    ValueError: at least one recording is needed
    """
    if not recordings:
        raise ValueError("at least one recording is needed")
    advance, start = on_frame or (lambda: None), config
    parts = [TeachingPart.of(recording) for recording in recordings]
    # What is accused teaches nothing yet: a detector that misses more than is usual is no attacker, but an attack
    # must not excuse itself.
    judge = changed(config, {("profile",): "default"})
    careful = learn_habits(parts, judge, advance, from_accused=False).config
    for recording in recordings:
        _require_no_alerts(run_detector(recording, careful, on_verdict=lambda _: advance(), pictures=False))
    habits = learn_habits(parts, judge, advance)
    if config.profile == "default":
        config = habits.config
    learn = learn_thresholds if config.profile == "paper" else learn_noise
    calibrated, notes = learn(parts, config, advance)
    seen: list[str] = []
    if config.profile == "default":
        calibrated, more, seen = _beyond_noise(parts, calibrated, advance)
        notes, seen = {**habits.notes, **notes, **more}, [*habits.words, *seen]
    ratios: dict[str, float] = {}
    for part in parts:
        run = run_detector(part.recording, calibrated, on_verdict=lambda _: advance(), pictures=False)
        for name, ratio in _held_out_ratios(run, part.until_ns).items():
            ratios[name] = max(ratio, ratios.get(name, 0.0))
        _require_proof(run, part.until_ns)
    return Calibration(
        config=calibrated,
        start=start,
        notes=notes,
        learnt_s=sum(part.learnt_s for part in parts),
        held_out_s=sum(part.held_out_s for part in parts),
        largest_ratio=ratios,
        seen=tuple(seen),
    )


def _beyond_noise(
    parts: Sequence[TeachingPart], config: Config, advance: Callable[[], None]
) -> tuple[Config, dict[str, str], list[str]]:
    """A stricter stated rate where the tails ask for it; and clocks, correlations and tails in words."""
    words = [note.in_words() for note in stream_notes(parts, config, advance)]
    found = tails(
        [run_detector(part, config, on_verdict=lambda _: advance(), pictures=False) for part in parts]
    )
    words += [tail.in_words() for tail in found]
    stricter, why = tightened(found, config)
    return changed(config, stricter), why, words


def _require_no_alerts(run: Run) -> None:
    if run.alerts:
        first = run.alerts[0].raised
        at_s = run.trace.since_start_s([first.stamp_ns])[0]
        raise RecordingError(
            f"{run.source} looks attacked: {first.alert.type.value} on {first.alert.source} at {at_s:.1f} s "
            f"({len(run.alerts)} in all); calibrate on driving without attacks, or see 'belie check --report'"
        )


def _held_out_ratios(run: Run, until_ns: int) -> dict[str, float]:
    held_out = run.trace.stamps_ns >= until_ns

    def largest(check: CheckTrace) -> float:
        ratio = check.ratio[held_out]
        return float(np.nanmax(ratio)) if np.isfinite(ratio).any() else math.nan

    found = {f"{check.check} {check.source}": largest(check) for check in run.trace.checks}
    return {name: ratio for name, ratio in found.items() if math.isfinite(ratio)}


def _require_proof(run: Run, until_ns: int) -> None:
    failed = [traced for traced in run.alerts if traced.raised.stamp_ns >= until_ns]
    if failed and run.profile != "paper":
        ratio = max(_held_out_ratios(run, until_ns).values(), default=math.nan)
        raise RecordingError(
            f"{run.source}: with the learned noise the held-out last third raises an alert "
            f"({ratio:.1f} times its threshold): it differs from what taught; add recordings of all kinds"
        )


def _period(seconds: float) -> str:
    """A time in the unit that suits it.

    >>> _period(400.0), _period(36000.0)
    ('7 min', '10 h')
    """
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.0f} h"
