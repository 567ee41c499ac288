"""Times the identification of gears from a million samples, in few long runs and in many short ones.

    python bench/gear_time.py [--out FILE.json] [--repeats 3] [--threads 2]

The virtual Racer turns axis 1 under a gyroscope (0.05 deg/s of noise, an encoder of 65,536 counts); both
methods of finding orders run and are compared on held-out runs, as in `exactarm gear`. Prints samples, runs,
seconds of the clock and of the processor (medians), and the error on held-out runs over the sensor's noise.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from statistics import median

import numpy as np

from exactarm.identify.gear import identify_gears
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_gear_runs

# Hz, deg/s, repeats
SHAPES = {"few long runs": (4000.0, (12.0,), 5), "many short runs": (1000.0, (22.0, 45.0), 24)}


def measured(rate_hz: float, speeds: tuple[float, ...], repeats: int, threads: int, times: int) -> dict:
    robot = load_robot("racer-7-1.4")
    random = np.random.default_rng(1)
    data = measure_gear_runs(VirtualRobot.of(robot), [0], np.deg2rad(speeds), repeats, Sensors(), random,
                             rate_hz)
    clock, processor, result = [], [], None
    for _ in range(times):
        start, busy = time.perf_counter(), time.process_time()
        result = identify_gears(robot, data, threads=threads)
        clock.append(time.perf_counter() - start), processor.append(time.process_time() - busy)
    over_noise = max(gear.after["validation"].rms / gear.noise for gear in result.gears)
    return {
        "samples": len(data), "runs": int(np.unique(data.run).size), "seconds": median(clock),
        "processor_seconds": median(processor), "held_out_over_noise": over_noise,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    rows = {name: measured(*shape, arguments.threads, arguments.repeats) for name, shape in SHAPES.items()}
    for name, row in rows.items():
        print(f"{name:16}  {row['samples']:8d} samples in {row['runs']:3d} runs: {row['seconds']:.2f} s, "
              f"{row['processor_seconds']:.2f} s of the processor; held out {row['held_out_over_noise']:.2f} "
              "x noise")
    if arguments.out:
        arguments.out.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
