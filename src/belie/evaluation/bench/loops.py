"""The closed loop of a suite: the same attacked drive without belie and with it, seed by seed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

from belie.detector import Config
from belie.evaluation.bench.cache import code_key, content_key
from belie.evaluation.bench.store import Store
from belie.evaluation.bench.suite import ClosedLoop
from belie.evaluation.bench.tables.table import Table

_CODE = (
    "geometry",
    "types",
    "odometry",
    "checks",
    "detector",
    "attacks",
    "simulation",
    "evaluation/closed_loop.py",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """One pair of drives."""

    settings: ClosedLoop
    seed: int
    config: Config

    @property
    def key(self) -> str:
        """Names everything that its outcome follows from."""
        known = self.settings.model_dump(mode="json", exclude={"seeds"})
        return content_key([known, self.seed, self.config.model_dump(mode="json"), code_key(_CODE)])

    @property
    def name(self) -> str:
        """For lists of failures."""
        return f"closed loop, {self.settings.scenario}, seed {self.seed}"


def loops_of(settings: ClosedLoop | None, config: Config | None) -> list[Loop]:
    """Every pair of drives.

    >>> len(loops_of(ClosedLoop(seeds=(1, 2)), None)), loops_of(None, None)
    (2, [])
    """
    if settings is None:
        return []
    return [Loop(settings=settings, seed=seed, config=config or Config()) for seed in settings.seeds]


def drive(loop: Loop, store: Store) -> None:
    """Drive both, and keep how they ended."""
    from belie.evaluation.closed_loop import compare
    from belie.simulation.scenario import load_scenario

    s = loop.settings
    scenario = load_scenario(
        s.scenario, seed=loop.seed, duration_s=s.duration_s, width=s.width, height=s.height
    )
    outcomes = compare(scenario, s.attacks, config=loop.config)
    known = {"key": loop.key, "seed": loop.seed, "outcomes": [outcome.to_json() for outcome in outcomes]}
    store.save_loop(loop.key, known)


def loop_table(settings: ClosedLoop | None, config: Config | None, store: Store) -> Table | None:
    """What was hit without belie, and with it; None where nothing was driven."""
    rows = []
    for loop in loops_of(settings, config):
        path = store.loop_path(loop.key)
        if path.exists():
            without, with_belie = json.loads(path.read_text(encoding="utf-8"))["outcomes"]
            rows.append(
                (str(loop.seed), *_ended(without), *_ended(with_belie), with_belie["alert"] or "no alert")
            )
    if not rows or settings is None:
        return None
    lost = sum(row[1] != "safe" for row in rows)
    saved = sum(row[3] == "safe" for row in rows)
    return Table(
        title="The closed loop",
        note=f"A vehicle steered by its claims, under {', '.join(settings.attacks)}: without belie {lost} "
        f"of {len(rows)} drives "
        f"collide or leave the road; with its alerts {saved} of {len(rows)} end safely.",
        head=("seed", "without belie", "off its lane, m", "with belie", "off its lane, m", "first alert"),
        rows=tuple(rows),
    )  # fmt: skip


def _ended(outcome: dict[str, object]) -> Sequence[str]:
    return str(outcome["collision"] or "safe"), f"{outcome['most_off_lane_m']:.1f}"
