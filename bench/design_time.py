"""Times the design of measurement poses, and the exchange beside one that recomputes every determinant.

    python bench/design_time.py [--out FILE.json] [--repeats 5]

Prints seconds (median) of the design of 50 + 13 poses for the shipped Racer, of exchange steps alone with
updated determinants and with determinants computed from scratch, and the ratio; then O1 of the design, of the
source's 50 poses and of the best of 1,000 random sets under the same model.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

import numpy as np

from exactarm.design.criterion import Criterion, LogDeterminant
from exactarm.design.design import Design, design_poses
from exactarm.design.exchange import ExchangeOptions, exchange
from exactarm.files.examples import data_path
from exactarm.robot.robot import Placement, Robot
from exactarm.robot_file import load_robot


@dataclass(frozen=True)
class RecomputedDeterminant(Criterion):
    """log det M of every candidate set from scratch: the base class' way."""

    def values(self, information: np.ndarray) -> np.ndarray:
        return LogDeterminant().values(information)

    def least_gain(self, count: int, parameters: int) -> float:
        return LogDeterminant().least_gain(count, parameters)


def seconds(work, repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return median(times)


def source_observability(robot: Robot, design: Design) -> float:
    table = np.genfromtxt(data_path("racer/thesis_poses.csv"), delimiter=",", skip_header=1)
    q = np.radians(table[:, :6]) / robot.controller_ratios + robot.controller_offsets
    return design.observability_of(q).O1


def best_random(design: Design, sets: int = 1000) -> float:
    rng = np.random.default_rng(3)
    q = design.space.draw(4000, rng)
    return max(design.observability_of(q[rng.choice(len(q), len(design.q), replace=False)]).O1
               for _ in range(sets))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path)
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    robot = replace(load_robot("racer-7-1.4"), tool=Placement(position=np.array([0.05, 0.0, 0.1])))
    result = {"design_s": seconds(lambda: design_poses(robot), arguments.repeats)}
    design = design_poses(robot)
    kept = design.identifiability.kept
    pool = design.model.blocks(design.space.draw(4000, np.random.default_rng(0)))[:, :, kept]
    start = np.arange(len(design.q))
    for candidates in (100, 400):
        chosen = {}
        for name, keep in (("updated", LogDeterminant()), ("recomputed", RecomputedDeterminant())):
            options = ExchangeOptions(candidates=candidates, keep=keep, add=keep, most_steps=100,
                                      threshold=0.0, patience=100)
            run = lambda: exchange(pool, start, np.random.default_rng(1), options)
            result[f"exchange_{candidates}_{name}_s"] = seconds(run, arguments.repeats)
            chosen[name] = sorted(run().chosen)
        assert chosen["updated"] == chosen["recomputed"], "both must choose the same poses"
        ratio = result[f"exchange_{candidates}_recomputed_s"] / result[f"exchange_{candidates}_updated_s"]
        result[f"exchange_{candidates}_ratio"] = ratio
    indices = {"O1": design.observability.O1, "O1_exchanged": design.exchanged.O1,
               "O1_start": design.start.O1}
    indices |= {"O1_source": source_observability(robot, design), "O1_best_random": best_random(design)}
    for name, value in (result | indices).items():
        print(f"{name:32s} {value:.4f}")
    if arguments.out:
        arguments.out.write_text(json.dumps(result | indices, indent=1) + "\n")


if __name__ == "__main__":
    main()
