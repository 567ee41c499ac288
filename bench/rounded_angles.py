"""Clean poses whose angles are rounded: how many are given a cause, or called unexplained.

    python bench/rounded_angles.py --sets 50 --seed 100

Each set: 60 poses of a UR10, visited twice, a tracker of 5 um, 65,536 counts a turn of the joints.
Seeds 100 to 149 were first drawn for this count, when the program was not changed any more.
"""

from __future__ import annotations

import argparse

import exactarm as ea
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.verdict import NOTHING


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sets", type=int, default=50)
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--counts", type=int, default=65536)
    arguments = parser.parse_args()
    robot, named, wrong = ea.load_robot("ur10"), 0, 0
    for seed in range(arguments.seed, arguments.seed + arguments.sets):
        made = ea.simulate("ur10", count=60, visits=2, noise=5e-6, counts=arguments.counts, seed=seed)
        result = diagnose(robot, made.data)
        named, wrong = named + bool(result.findings), wrong + (result.verdict != NOTHING)
    print(f"{arguments.sets} sets: {named} were given a cause, {wrong} have another verdict than `{NOTHING}`")


if __name__ == "__main__":
    main()
