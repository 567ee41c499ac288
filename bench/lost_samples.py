"""What lost samples, uneven stamps and repeated readings cost the identification of masses and friction.

    python bench/lost_samples.py [--seed 1]

The log is identified as it is and with one thing changed each time; printed is the torque RMS on the rows
that were fitted. The model is the same each time, so that all should agree but for the rows they have.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from exactarm.data.dataset import Dataset, read_dataset
from exactarm.data.held_samples import without_held
from exactarm.files.examples import example
from exactarm.identify.dynamics import DynamicsOptions, identify_dynamics
from exactarm.numerics.stamps import typical_step
from exactarm.robot_file import load_robot

LOST, JITTER, STRETCH_S = 0.01, 0.1, 0.45  # share of the samples, of a step; s
HELD = 20  # rows: 250 Hz of 5 kHz
SINCE_1970_S = 1.7637e9  # a float there has steps of 0.24 us


def variants(data: Dataset, random: np.random.Generator) -> dict[str, Dataset]:
    step, rows = typical_step(data.time), len(data)
    kept = random.random(rows) >= LOST
    stretch = (data.time - data.time[0]) // STRETCH_S
    last = np.arange(rows) // HELD * HELD
    held = lambda name: replace(data, joints=data.joints | {name: data.joints[name][last]})
    stamped = data.time + random.normal(0.0, JITTER * step, rows)
    return {
        "as it is": data,
        f"{LOST:.0%} of the samples lost": data.select(kept),
        f"every third stretch of {STRETCH_S} s validates": replace(data, identification=stretch % 3 != 2),
        f"stamps off by {1e6 * JITTER * step:.0f} of {1e6 * step:.0f} us": replace(data, time=stamped),
        f"torques repeated {HELD} times": without_held(held("tau_motor")),
        f"angles repeated {HELD} times": without_held(held("theta")),
        "seconds since 1970": replace(data, time=(data.time + SINCE_1970_S) - SINCE_1970_S),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    robot = load_robot("tx40")
    data = read_dataset(example("tx40/motion"), robot)
    data = replace(data, identification=np.ones(len(data), bool))
    for name, log in variants(data, np.random.default_rng(arguments.seed)).items():
        result = identify_dynamics(robot, log, DynamicsOptions())
        print(f"{name:42} {np.sqrt(np.nanmean(result.after['identification'] ** 2)):7.3f} Nm")


if __name__ == "__main__":
    main()
