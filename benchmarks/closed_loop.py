"""Drive on attacked claims, without belie and with it, over several seeds: who collides, and when.

python benchmarks/closed_loop.py                  the paper's attack to the letter, ten seeds
python benchmarks/closed_loop.py --attack         honest drives: nobody may collide, and nothing may stop them
python benchmarks/closed_loop.py --seeds 1 2 3 --attack paper-odometry:start=60,restore=false
"""

from __future__ import annotations

import argparse

from belie.evaluation.closed_loop import compare
from belie.simulation.scenario import load_scenario
from belie.simulation.stage import build_world


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenario", default="closed-loop")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(1, 11)))
    parser.add_argument("--attack", nargs="*", default=["paper-odometry:start=60"])
    parser.add_argument("--weather", default=None)
    parser.add_argument("--duration", type=float, default=10.0, help="seconds")
    parser.add_argument("--size", type=int, nargs=2, default=(320, 240), help="pixels")
    wanted = parser.parse_args()
    width, height = wanted.size
    lost = saved = alerted = 0
    for seed in wanted.seeds:
        scenario = load_scenario(
            wanted.scenario,
            seed=seed,
            weather=wanted.weather,
            duration_s=wanted.duration,
            width=width,
            height=height,
        )
        without, with_belie = compare(scenario, wanted.attack, world=build_world(scenario))
        lost, saved = lost + (not without.safe), saved + with_belie.safe
        alerted += with_belie.alert is not None
        print(f"seed {seed}: {without.in_words()}; {with_belie.in_words()}", flush=True)
    count = len(wanted.seeds)
    print(
        f"collisions without belie {lost} of {count}; safe with belie {saved} of {count}, alerts in {alerted}"
    )


if __name__ == "__main__":
    main()
