"""Attacks on object detections in simulated drives of every scene and weather: Markdown tables.

python benchmarks/objects_simulated.py --sensor-seeds 1 2 3

The drives are those of `belie bench clean`, their pictures rendered once, into its cache; the camera's own motion is
estimated once a drive. Each sensor seed is a detector of its own, with the habits of `docs/simulated-sensors.md`; its
objects are hidden or renamed one at a time for two seconds, at drawn onsets. An object is attacked where the truth
shows it plainly (24 px or more, at most 30 % hidden, in view) and the detector held it in the second before: in fog
that a detector cannot see through it flickers, and that is no attack. A hit is an alert of the right type that names
the object while the attack lasts. ``--miss-run 4.1`` gives the detector gaps of that many messages for objects in plain
view, too; ``--calibrated 101`` learns its habits first, from a clean run of another seed, as ``belie calibrate`` does.
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial

from _simulated import cases_of, drive_parser
from _simulated_attacks import LONG, Found, Trial, run
from belie.evaluation.bench.cases import DriveCase
from belie.evaluation.intervals import wilson_interval

_LENGTHS = (5, 6, 8, 10, 15, 20)


def lines(found: Sequence[Found], within: int, show: bool) -> Iterator[str]:
    """The tables."""
    yield "| scene | weather | clean runs | false alerts | hidden | in 5 | renamed | in 5 | undecided | missed |"
    yield "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|"
    groups: dict[tuple[str, str], list[Found]] = defaultdict(list)
    for one in found:
        groups[one.case.place, one.case.weather].append(one)
    for (scenario, weather), own in groups.items():
        yield f"| {scenario} | {weather} | {_cells(own, within)} |"
    clear = [one for one in found if one.case.weather != "heavy-fog"]
    heavy = [one for one in found if one.case.weather == "heavy-fog"]
    for name, own in (("all but heavy fog", clear), ("heavy fog", heavy)):
        if own:
            yield f"| **all scenes** | **{name}** | {_cells(own, within)} |"
    hours = sum(one.frames / one.case.scenario.frame_rate_hz for one in found) / 3600.0
    yield f"\n{len(found)} clean runs, {hours:.2f} h, {sum(len(one.false) for one in found)} false alerts"
    for one in found:
        for text in one.false:
            yield f"- {_name(one.case)}: {text}"
    for kind in ("hide", "relabel"):
        trials = [t for one in clear for t in one.trials if t.kind == kind]
        low, high = wilson_interval(sum(t.delay is not None for t in trials), len(trials)) or (0.0, 1.0)
        delays = Counter(t.delay for t in trials if t.delay is not None)
        share = f"{100 * low:.1f} to {100 * high:.1f} %"
        yield f"\n{kind}, not in heavy fog: {share}; frames to the alert: {dict(sorted(delays.items()))}"
        yield f"\n| {kind} for | {' | '.join(f'{n} frames' for n in _LENGTHS)} |\n|---|{'---:|' * len(_LENGTHS)}"
        for low_px, high_px in ((24, 32), (32, 40), (40, 48), (48, 96), (96, 10_000)):
            part = [t for t in trials if low_px <= t.side_px < high_px]
            found_in = [sum(t.delay is not None and t.delay < n for t in part) for n in _LENGTHS]
            yield f"| {low_px} to {high_px} px | {' | '.join(f'{n}/{len(part)}' for n in found_in)} |"
    if show:
        yield "\nNot found:\n"
        for one in found:
            for t in one.trials:
                if t.delay is None:
                    why = "; ".join(f"{n} x {reason}" for reason, n in t.doubts.most_common(3))
                    wrong = "; ".join(t.wrong)
                    yield f"- {_name(one.case)}: {t.spec}, {t.side_px:.0f} px: {why} {wrong}"


def _cells(own: Sequence[Found], within: int) -> str:
    cells = [str(len(own)), str(sum(len(one.false) for one in own))]
    trials = [t for one in own for t in one.trials]
    for kind in ("hide", "relabel"):
        some = [t for t in trials if t.kind == kind]
        cells += [f"{sum(t.delay is not None for t in some)}/{len(some)}"]
        cells += [f"{sum(t.delay is not None and t.delay < within for t in some)}"]
    missed = [t for t in trials if t.delay is None]
    undecided = sum(_is_undecided(t) for t in missed)
    return " | ".join([*cells, str(undecided), str(len(missed) - undecided)])


def _is_undecided(trial: Trial) -> bool:
    return trial.undecided >= 0.5 * trial.frames


def _name(case: DriveCase) -> str:
    return f"{case.place}, {case.weather}, sensor seed {case.sensor_seed}"


def main() -> None:
    parser = drive_parser(__doc__, suite="clean", scenario="street-straight")
    parser.set_defaults(sensor_seeds=(1, 2, 3, 4))
    parser.add_argument("--attacks", type=int, default=6, help="attacks on each seed")
    parser.add_argument("--long", type=int, default=LONG, help="frames that an attack lasts")
    parser.add_argument("--miss-run", type=float, help="mean gap in plain view [messages]")
    parser.add_argument(
        "--calibrated", type=int, nargs="+", default=[], help="sensor seeds to learn habits from first"
    )
    parser.add_argument("--misses", action="store_true", help="list what was not found")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    wanted = parser.parse_args()
    cases = cases_of(parser, wanted)
    once = partial(
        run,
        attacks=wanted.attacks,
        long=wanted.long,
        profile=wanted.profile,
        miss_run=wanted.miss_run,
        teachers=wanted.calibrated,
    )
    found = []
    with ProcessPoolExecutor(wanted.jobs) as pool:
        for one in pool.map(once, cases, chunksize=len(wanted.sensor_seeds) or 1):
            found.append(one)
            missed = [f"{t.spec} ({t.side_px:.0f} px)" for t in one.trials if t.delay is None]
            told = "; ".join([*one.false, *missed])
            print(f"{_name(one.case)}, {len(one.trials)} attacks: {told or 'as should be'}", file=sys.stderr)
    print("\n".join(lines(found, 5, wanted.misses)))


if __name__ == "__main__":
    main()
