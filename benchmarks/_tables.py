"""What `detection.py` found, as Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Literal

from _families import FAMILIES, Family
from _recordings import Variant
from _trials import FalseAlert, Trial, rate_text

Profile = Literal["default", "paper"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One honest run and every attack on it."""

    recording: str
    variant: Variant
    profile: Profile
    families: tuple[str, ...]
    onsets: int
    sweep_onsets: int
    seed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What one job found: trials by family, and by family and magnitude."""

    job: Job
    frames: int
    false_alerts: list[FalseAlert]
    trials: dict[str, list[Trial]]
    swept: dict[tuple[str, float], list[Trial]]


def falls_short(family: Family, trials: Sequence[Trial]) -> bool:
    """Whether fewer were caught than asked."""
    return family.target is not None and sum(t.hit for t in trials) < family.target * len(trials)


def honest_lines(found: Sequence[Found]) -> Iterator[str]:
    """The table of alerts on honest claims, and each of them."""
    yield "| profile | recording | claims | frames | alerts |"
    yield "|---|---|---|---:|---:|"
    for f in found:
        j = f.job
        claims = f"{j.variant}, seed {j.seed}"
        yield f"| {j.profile} | {j.recording} | {claims} | {f.frames} | {len(f.false_alerts)} |"
    yield ""
    for f in found:
        for one in f.false_alerts:
            j = f.job
            yield f"- {j.profile}, {j.recording}, {j.variant}, frame {one.frame}: {one.alert}: {one.reason}"


def detection_lines(found: Sequence[Found], families: Sequence[Family]) -> Iterator[str]:
    """One row a family, one column a recording and kind of claims, and all of them pooled."""
    heads = [f"{f.job.recording} {f.job.variant}" for f in found]
    yield f"| family | within | asked | all, Wilson 95 % | median | wrong | met | {' | '.join(heads)} |"
    yield f"|---|---:|---:|---:|---:|---:|---|{'---:|' * len(heads)}"
    for family in families:
        each = [f.trials.get(family.name, []) for f in found]
        pooled = [trial for trials in each for trial in trials]
        delays = [trial.delay + 1 for trial in pooled if trial.delay is not None]
        cells = [f"{sum(t.hit for t in trials)}/{len(trials)}" if trials else "–" for trials in each]
        row = (
            family.label,
            str(pooled[0].allowed if pooled else family.within),
            "–" if family.target is None else f"{100 * family.target:.0f} %",
            rate_text(pooled),
            f"{median(delays):g}" if delays else "–",
            str(sum(bool(trial.wrong) for trial in pooled)),
            "–"
            if family.target is None or not pooled
            else "**no**"
            if falls_short(family, pooled)
            else "yes",
            *cells,
        )
        yield f"| {' | '.join(row)} |"


def sweep_lines(found: Sequence[Found], families: Sequence[Family]) -> Iterator[str]:
    """The smallest magnitude of each family with at least 95 %, if every larger one reaches it too."""
    yield "| family | smallest with >= 95 % | hits by magnitude |"
    yield "|---|---:|---|"
    for family in (family for family in families if family.sweep):
        smallest, cells, reached = "none tried", [], True
        for magnitude in family.sweep:
            pooled = [t for f in found for t in _at(f, family, magnitude)]
            if not pooled:
                continue
            share = sum(trial.hit for trial in pooled) / len(pooled)
            cells.append(f"{magnitude:g}: {100 * share:.0f} % of {len(pooled)}")
            reached = reached and share >= 0.95
            if reached:
                smallest = f"{magnitude:g} {family.unit}"
        yield f"| {family.name} | {smallest} | {'; '.join(cells)} |"


def _at(found: Found, family: Family, magnitude: float) -> list[Trial]:
    """The trials at a magnitude; where a sweep was broken off, those of the last one stand for it."""
    tried = [m for m in family.sweep if (family.name, m) in found.swept and m >= magnitude]
    return found.swept[family.name, tried[-1]] if tried else []


def miss_lines(found: Sequence[Found], families: Sequence[Family]) -> Iterator[str]:
    """Every attack that was missed, late, or taken for another."""
    for family in families:
        for f in found:
            for trial in f.trials.get(family.name, []):
                if not trial.hit:
                    delay = "missed" if trial.delay is None else f"at attacked frame {trial.delay + 1}"
                    said = [delay, *trial.wrong, *sorted(set(trial.undecided))]
                    yield f"- {f.job.recording} {f.job.variant}, {trial.spec}: {'; '.join(said)}"


def families_named(names: Sequence[str] | None) -> list[Family]:
    """The families of those names; all of them for None."""
    return [family for family in FAMILIES if names is None or family.name in names]
