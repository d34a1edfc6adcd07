"""Which records belong together: by family, condition or place, and as far as a detector judges them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping

from belie.evaluation.bench.rivals import RivalMaker
from belie.evaluation.bench.store import RunRecord
from belie.evaluation.bench.suite import Attacks, Suite
from belie.types import AlertType

_FOG = {"light-fog": "light fog", "heavy-fog": "heavy fog"}


def condition(record: RunRecord) -> str:
    """What the paper tells apart: fog, light or heavy; the highway; all else.

    >>> condition(RunRecord(key="", rival="", recording="", place="highway", weather="night", seed=1))
    'highway'
    """
    if record.weather == "real":
        return "real"
    return _FOG.get(record.weather) or ("highway" if record.place == "highway" else "no fog")


def place_and_condition(record: RunRecord) -> str:
    """Where it was driven, and in what weather."""
    return record.place if record.weather == "real" else f"{record.place} {record.weather}"


def families(suite: Suite) -> list[str]:
    """Of its attacks, each once."""
    return list(dict.fromkeys(group.family for group in suite.attacks))


def sweeps(suite: Suite) -> list[Attacks]:
    """The attacks of which several magnitudes are tried."""
    return [group for group in suite.attacks if len(group.magnitudes) > 1 and not group.ramp]


def largest_magnitude(suite: Suite, family: str) -> float | None:
    """The first that is tried of a family; None where it has none."""
    group = next(group for group in suite.attacks if group.family == family)
    return group.magnitudes[0] if group.magnitudes else None


def family_label(suite: Suite, family: str, magnitude: float | None) -> str:
    """A family with the magnitude that is told of it."""
    unit = next(group.unit for group in suite.attacks if group.family == family)
    return family if magnitude is None else f"{family}, {magnitude:g} {unit}"


def is_judged(record: RunRecord, makers: Mapping[str, RivalMaker]) -> bool:
    """Whether its detector judges such attacks at all; a detector that is not known is taken to."""
    maker = makers.get(record.rival)
    return record.alert is not None and (maker is None or AlertType(record.alert) in maker.judges)


def judged(records: Iterable[RunRecord], rival: str, makers: Mapping[str, RivalMaker]) -> list[RunRecord]:
    """The runs of a detector under attacks that it judges."""
    return [r for r in records if r.rival == rival and is_judged(r, makers)]


def grouped(
    records: Iterable[RunRecord], name: Callable[[RunRecord], str]
) -> Iterator[tuple[str, list[RunRecord]]]:
    """Name and records of each group, in the order in which they first came."""
    groups: dict[str, list[RunRecord]] = {}
    for record in records:
        groups.setdefault(name(record), []).append(record)
    yield from groups.items()
