"""Arms whose gears all have errors of many orders: how near the diagnosis comes to the noise, what it names.

    python bench/gear_curves.py --count 8 --seed 60000 [--out cases.json]

A case: an arm of six or seven axes, 300 to 900 poses, noise of 50 µm, on every axis a curve whose orders have
random amplitudes under a law of its own (10 to 100 µrad up to an order of 5 to 20, then falling with
a power of 0.5 to 1.5, up to 30 to 120 orders), and none to two other causes as in `bench/reliability.py`.
Held-out position RMS over that of the noise, and over that of a fit that is told the other causes and the
laws (with the bend at order 10, where all of them bend in the library): what these rows can give. Seeds 59000
and 60000 to 60005 have been looked at.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np

from blind.random_arms import write_random_arm
from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.problems import problem_for
from exactarm.effects.base import Effect
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.numerics.rotation import exp
from exactarm.robot.generic_masses import with_generic_masses
from exactarm.robot.robot import Placement, Robot
from exactarm.robot_file import load_robot
from exactarm.simulate.virtual_robot import deviated
from reliability import SIGMA_M, angles, drawn_causes, is_right, measured

ROWS, ORDERS, BEND, FALL = (300, 901), (30, 121), (5, 21), (0.5, 1.5)
AMPLITUDE_RAD = (1e-5, 1e-4)
BEND_OF_LIBRARY, ALL_ANGLES = 10.0, (-np.pi, np.pi)


def curve(axis: int, random: np.random.Generator) -> tuple[Effect, Effect]:
    """Of random amplitudes under a random law, at every angle of the output; and its law, without a size."""
    orders = np.arange(1, random.integers(*ORDERS) + 1)
    size = np.exp(random.uniform(*np.log(AMPLITUDE_RAD)))
    bend, fall = random.integers(*BEND), random.uniform(*FALL)
    sizes = orders * size * np.minimum(1.0, (orders / bend) ** -fall)  # of the ratio: k times the angle's
    values = (1.0, *np.column_stack(random.standard_normal((2, len(orders))) * sizes).ravel())
    law = GearHarmonics.curve(axis, len(orders), size * (BEND_OF_LIBRARY / bend) ** -fall, ALL_ANGLES, fall)
    return GearHarmonics(axis, tuple(float(v) for v in values)), law


def commands(robot: Robot, random: np.random.Generator) -> Dataset:
    """Poses within the limits, 70 % of them to identify with."""
    rows = int(random.integers(*ROWS))
    joints = angles(robot, rows, random) | {"approach": random.choice((-1.0, 1.0), (rows, robot.axes))}
    return Dataset.of_arrays("poses", joints, position=np.zeros((rows, 3)),
                             identification=random.random(rows) < 0.7)


def told(known: Robot, data: Dataset, effects: tuple[Effect, ...]) -> float:
    """Held-out RMS of a fit with these effects."""
    problem = problem_for(known, data.select(data.identification), data.select(~data.identification), 1, 0)
    fitted = problem.fit(problem.declared().joined(Layout.of(effects)))
    return float(np.sqrt(np.mean(problem.errors(fitted, problem.held_out) ** 2)))


def case(seed: int, folder: Path) -> dict:
    """One drawn case, diagnosed."""
    random = np.random.default_rng(seed)
    write_random_arm(folder / "arm.toml", random, f"arm-{seed}")
    known = load_robot(folder / "arm.toml")
    true = replace(
        deviated(known, 0.5, random, frames=False),
        links=with_generic_masses(known).links,  # no arm is without masses
        base=Placement(exp(random.normal(0.0, 1.0, (1, 3)))[0], random.normal(0.0, 2.0, 3)),
        tool=Placement(position=random.uniform(-0.2, 0.2, 3) + np.array([0.0, 0.0, 0.15])),
    )
    data = commands(known, random)
    count = int(random.integers(3))
    others = drawn_causes(count, known, measured(true, (), data, np.zeros((len(data), 3))), random)
    curves, laws = zip(*(curve(axis, random) for axis in range(1, known.axes + 1)))
    exact = measured(true, (*curves, *others), data, np.zeros((len(data), 3)))
    data = replace(exact, position=exact.position + SIGMA_M * random.standard_normal((len(data), 3)))
    worked = time.process_time()
    result = diagnose(known, data, seed=0)
    worked = time.process_time() - worked
    hidden = (*curves, *others)
    stated = [(f.effect.label, float(f.probability), is_right(f.effect, hidden, "")) for f in result.findings]
    held_out = ~data.identification
    best = float(np.sqrt(np.mean(np.sum((data.position - exact.position)[held_out] ** 2, axis=1))))
    return {
        "seed": seed,
        "rows": len(data),
        "others": [one.label for one in others],
        "found": sum(any(is_right(f.effect, (one,), "") for f in result.findings) for one in others),
        "stated": stated,
        "verdict": result.verdict,
        "over_noise": result.after["validation"].rms / best,
        "over_told": result.after["validation"].rms / told(known, data, (*others, *laws)),
        "seconds": worked,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=8)
    parser.add_argument("--seed", type=int, default=60000)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    cases: list[dict] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(arguments.seed, arguments.seed + arguments.count):
            cases.append(case(seed, Path(folder)))
            print(json.dumps(cases[-1]), flush=True)
            if arguments.out:
                arguments.out.write_text(json.dumps(cases, indent=1) + "\n")
    wrong = sum(not right for one in cases for _, _, right in one["stated"])
    noise, told_it = ([one[key] for one in cases] for key in ("over_noise", "over_told"))
    print(f"held-out RMS over the noise: median {median(noise):.2f}, worst {max(noise):.2f}; over that of a "
          f"fit that is told: median {median(told_it):.2f}, worst {max(told_it):.2f}; other causes found "
          f"{sum(one['found'] for one in cases)} of {sum(len(one['others']) for one in cases)}, "
          f"foreign ones named {wrong}")


if __name__ == "__main__":
    main()
