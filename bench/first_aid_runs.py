"""First aid in one of several runs: blind data (bench/blind), as they are and with a mistake in one run.

    python bench/first_aid_runs.py motion|gear_run|tracked_motion --seed 81000 --count 20 [--conditions wide]

--seed: the first of the blind cases; those looked at so far begin at 81000 (motion, gear_run) and 83000
(tracked_motion), and judge nothing any more. A motion of one run is cut into two to four. Counted are the
data as they are on which first aid says something, and of every mistake, made in one run drawn at random, how
often it is told with that run, and with the words that name it.
"""

from __future__ import annotations

import argparse
import collections
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

TOP = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TOP / "bench"))

from blind import gear_scenario, motion_scenario, tracked_scenario  # noqa: E402
from blind.run import ROBOTS  # noqa: E402
from exactarm.data.dataset import Dataset, read_dataset  # noqa: E402
from exactarm.first_aid.first_aid import first_aid  # noqa: E402
from exactarm.robot_file import load_robot  # noqa: E402

DRAWS = {"motion": motion_scenario, "gear_run": gear_scenario, "tracked_motion": tracked_scenario}
Change = Callable[[Dataset, np.ndarray], Dataset]


def changed(data: Dataset, rows: np.ndarray, names: tuple[str, ...], change) -> Dataset:
    joints = dict(data.joints)
    for name in names:
        if name in joints:
            joints[name] = joints[name].copy()
            joints[name][rows] = change(joints[name][rows])
    return replace(data, joints=joints)


def gyro(data: Dataset, rows: np.ndarray, change) -> Dataset:
    reading = data.gyro.copy()
    reading[rows] = change(reading[rows])
    return replace(data, gyro=reading)


ANGLES, TORQUES = ("theta", "q"), ("tau", "tau_motor", "current")
negated = lambda axis: lambda values: values * np.where(np.arange(values.shape[1]) == axis, -1.0, 1.0)
exchanged = lambda values: values[:, [0, 2, 1, *range(3, values.shape[1])]]
MOTION: dict[str, tuple[Change, str]] = {
    "torques in mNm": (lambda d, r: changed(d, r, TORQUES, lambda v: 1e3 * v), "mNm"),
    "torques negated": (lambda d, r: changed(d, r, TORQUES, lambda v: -v), "torques of the opposite sign"),
    "axis 2 negated": (lambda d, r: changed(d, r, ANGLES + TORQUES, negated(1)), "opposite sign of axis 2"),
    "axes 2 and 3 exchanged": (lambda d, r: changed(d, r, ANGLES + TORQUES, exchanged), "axes 2 and 3"),
    "degrees": (lambda d, r: changed(d, r, ANGLES, np.degrees), "degrees labelled as radians"),
    "torques 0.1 s late": (
        lambda d, r: changed(d, r, TORQUES, lambda v: np.roll(v, _samples(d, r, 0.1), axis=0)), "later"),
}
GEAR: dict[str, tuple[Change, str]] = {
    "deg/s as rad/s": (lambda d, r: gyro(d, r, np.degrees), "deg/s"),
    "one axis negated": (lambda d, r: gyro(d, r, _longest(d, r, lambda v, k: negated(k)(v))),
                         "opposite sign"),
    "two axes exchanged": (lambda d, r: gyro(d, r, _longest(d, r, lambda v, k: v[:, _swap(k)])),
                           "exchanged"),
    "another ratio": (lambda d, r: changed(d, r, ("theta",), lambda v: 1.2 * v), "ratio"),
    "motor angles in degrees": (lambda d, r: changed(d, r, ("theta",), np.degrees), "degrees"),
}
TRACKED: dict[str, tuple[Change, str]] = {
    name: MOTION[name] for name in ("axis 2 negated", "axes 2 and 3 exchanged", "degrees")
}
MISTAKES = {"motion": MOTION, "gear_run": GEAR, "tracked_motion": TRACKED}


def _samples(data: Dataset, rows: np.ndarray, seconds: float) -> int:
    return int(round(seconds / np.median(np.diff(data.time[rows]))))


def _longest(data: Dataset, rows: np.ndarray, change):
    axis = int(np.argmax(np.std(data.gyro[rows], axis=0)))
    return lambda values: change(values, axis)


def _swap(axis: int) -> list[int]:
    order = [0, 1, 2]
    order[axis], order[(axis + 1) % 3] = order[(axis + 1) % 3], order[axis]
    return order


def case_of(kind: str, folder: Path, seed: int, conditions: str):
    case = DRAWS[kind].draw_case(folder, seed, ROBOTS, None, conditions)
    robot = load_robot(str(case.robot))
    data = read_dataset(case.data, robot, kind)
    if kind != "gear_run" and len(np.unique(data.run)) == 1:
        data = replace(data, run=1 + (2 + seed % 3) * np.arange(len(data)) // len(data))
    return robot, data


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kind", choices=tuple(DRAWS))
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--conditions", default="wide")
    parser.add_argument("--right-only", action="store_true", help="no mistakes, only the data as they are")
    arguments = parser.parse_args()
    told: collections.Counter[str] = collections.Counter()
    tried: collections.Counter[str] = collections.Counter()
    for seed in range(arguments.seed, arguments.seed + arguments.count):
        random = np.random.default_rng([seed, 1])
        with tempfile.TemporaryDirectory() as scratch:
            robot, data = case_of(arguments.kind, Path(scratch), seed, arguments.conditions)
        said = first_aid(robot, data)
        print(f"{seed} {len(np.unique(data.run))} runs: {said}", flush=True)
        tried["right"] += 1
        told["right"] += bool(said)
        if said or arguments.right_only:
            continue
        run = int(random.choice(np.unique(data.run)))
        rows = np.flatnonzero(data.run == run)
        where = "row" if arguments.kind == "tracked_motion" else f"run {run} "
        for name, (change, words) in MISTAKES[arguments.kind].items():
            if "gyro" in change.__code__.co_names and data.gyro is None:
                continue
            said = first_aid(robot, change(data, rows))
            tried[name] += 1
            told[name] += any(words in each and where in each for each in said)
            told[f"{name}: anything"] += bool(said)
            if not any(words in each and where in each for each in said):
                print(f"  {name} in run {run}: {said}", flush=True)
    print(f"data as they are: {told['right']} of {tried['right']} suspected")
    for name in tried:
        if name != "right":
            print(f"{name}: told {told[name]} of {tried[name]}, with other words or run "
                  f"{told[f'{name}: anything'] - told[name]}")


if __name__ == "__main__":
    main()
