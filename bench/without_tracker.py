"""Calibration without a tracker, judged by one: how near it comes to the tracker's own calibration.

    python bench/without_tracker.py [ARMS]

Virtual arms (Panda and UR10 in turn) that deviate from their drawing as usual, with a tool somewhere; noise
of a touch and of a tracker's coordinate 0.05 mm, of an inclinometer 0.05 mrad. Without a tracker: two seats
and a block of four faces at each of two places, and an inclinometer in 60 poses; or a camera of unknown lens
on the flange, 30 pictures of a board at each of two places, a tenth of a pixel of noise. With: 60 random
poses. All are judged by the same 100 further poses under a tracker (frames fitted); mean position error, mm.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.identify.calibrate import CalibrationOptions, calibrate
from exactarm.identify.closures import calibrate_closures
from exactarm.identify.evaluate import evaluate_poses
from exactarm.measurement.contacts import CONTACT_CLASSES
from exactarm.robot.robot import Placement
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, deviated, measure_poses
from exactarm.simulate.closures import measure_closures
from exactarm.simulate.profiles import limit
from exactarm.simulate.virtual_robot import placed

ARMS = ("panda", "ur10")
SENSORS = Sensors(position_m=5e-5, orientation_rad=5e-5, counts=0)
TOUCHES = {"socket": 15, "plane": 12, "tilt": 30}  # of each contact at each place
PLACES, FITTED, JUDGED = 2, 60, 100
PICTURES, PIXEL_RAD = 30, 7e-5  # at each place; of a picture that is 1,400 pixels for a radian
ALONE = CalibrationOptions(compliance=())


def one_estimate(parts: list[Dataset]) -> Dataset:
    """Rows of several devices, each sort in sessions of its own; the known lengths of all."""
    count, stack = sum(map(len, parts)), np.concatenate
    marks = {name: stack([part.contacts.get(name, np.full(len(part), -1)) for part in parts])
             for name in CONTACT_CLASSES if any(name in part.contacts for part in parts)}
    tilt = stack([np.full((len(part), 2), np.nan) if part.tilt is None else part.tilt for part in parts])
    known = tuple(entry for part in parts for entry in part.fixture.distances)
    return Dataset.of_arrays(
        "closures", {name: stack([part.joints[name] for part in parts]) for name in parts[0].joints},
        session=stack([part.session + 10 * place for place, part in enumerate(parts)]), contacts=marks,
        tilt=tilt, fixture=replace(parts[0].fixture, distances=known), identification=np.ones(count, bool),
    )


def errors_of(name: str, seed: int) -> tuple[float, ...]:
    """Mean error, m: nominal, calibrated by touches, by pictures, by the tracker."""
    random = np.random.default_rng(seed)
    nominal = load_robot(name)
    true = placed(deviated(nominal, 1.0, random, frames=False), random)
    touching = VirtualRobot(nominal, replace(true, base=Placement()))
    parts = [measure_closures(touching, contact, PLACES, count, SENSORS, random)[0]
             for contact, count in TOUCHES.items()]
    lower, upper = limit(nominal, "q_min"), limit(nominal, "q_max")
    draw = lambda count: measure_poses(VirtualRobot(nominal, true),
                                       random.uniform(lower, upper, (count, nominal.axes)), SENSORS, random)
    fitted, judge = draw(FITTED), draw(JUDGED)
    without = calibrate_closures(nominal, one_estimate(parts), ALONE).robot
    by_tracker = calibrate(nominal, replace(fitted, identification=np.ones(FITTED, bool)), ALONE).robot
    sharp = replace(SENSORS, orientation_rad=PIXEL_RAD)
    seen = measure_closures(touching, "camera", PLACES, PICTURES, sharp, random)[0]
    seen = replace(seen, identification=np.ones(len(seen), bool))
    pictures = calibrate_closures(nominal, seen, ALONE).robot
    return tuple(evaluate_poses(robot, judge).overall.mean
                 for robot in (nominal, without, pictures, by_tracker))


def main(count: int) -> None:
    started, ratios = time.process_time(), []
    print("| arm | nominal | touches | pictures | tracker | touches / tracker | pictures / tracker |\n"
          "| --- | --- | --- | --- | --- | --- | --- |")
    for seed in range(1, count + 1):
        name = ARMS[seed % len(ARMS)]
        errors = errors_of(name, seed)
        ratios.append((errors[1] / errors[3], errors[2] / errors[3]))
        numbers = " | ".join(f"{1e3 * error:.3f}" for error in errors)
        print(f"| {name} {seed} | {numbers} | {ratios[-1][0]:.2f} | {ratios[-1][1]:.2f} |", flush=True)
    for which, all_of in zip(("touches", "pictures"), np.array(ratios).T):
        print(f"{which} / tracker: median {np.median(all_of):.2f}, largest {all_of.max():.2f}")
    print("mean error in mm; "
          f"{time.process_time() - started:.0f} s of processor time")


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 8)
