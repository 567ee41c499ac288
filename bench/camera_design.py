"""Designed pictures of a board against random ones that see it as well: what the calibrated arm is wrong by.

    python bench/camera_design.py [ARMS [POSES]]

Virtual arms (Panda and UR10 in turn) that deviate from their drawing as usual. `exactarm design --contact
camera` proposes two places of the board and POSES poses (40) by the drawing; beside them stand as many random
poses of the same places that see the board within the same limits. The board lies 2 cm and 2 degrees off the
proposal, the camera sits 1 cm and 1 degree off the flange's target, its lens is unknown; a tenth of a pixel
of noise, and axes that repeat to 0.03 mrad (some 0.05 mm at the target). Both calibrations are judged by the
same 100 poses under a tracker without noise: mean position error, mm, beside what the design predicts (RMS
over its work space).
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import CameraSetup, Fixture
from exactarm.design.camera_design import design_pictures
from exactarm.design.closure_design import ClosureDesignOptions
from exactarm.identify.calibrate import CalibrationOptions
from exactarm.identify.closures import calibrate_closures
from exactarm.identify.evaluate import evaluate_poses
from exactarm.measurement.camera import Camera
from exactarm.numerics.rotation import exp
from exactarm.robot.robot import Placement, Robot
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, deviated, measure_poses
from exactarm.simulate.pictures import TRUE_LENS, pictures_at
from exactarm.simulate.profiles import limit
from exactarm.simulate.virtual_robot import placed

ARMS, PLACES, JUDGED = ("panda", "ur10"), 2, 100
SETUP = CameraSetup(size=(1600, 1200), lens=(1400.0, 1400.0, 800.0, 600.0, 0.0, 0.0, 0.0, 0.0, 0.0))
SENSORS = Sensors(position_m=5e-5, orientation_rad=7e-5, counts=0)  # 0.1 px of 1,400 for a radian
REPEATS_RAD = 3e-5
BOARD_M, CAMERA_M, BOARD_RAD, CAMERA_RAD = 0.02, 0.01, 0.035, 0.017


def truly(camera: Camera, session: int, carried: np.ndarray, random: np.random.Generator) -> Camera:
    """The camera of the design as it was set up; carried (6,): how far it sits off, at every place alike."""
    values = np.array(camera.values)
    values[:6] += carried
    values[6:12] += np.concatenate([random.normal(0.0, BOARD_RAD, 3), random.normal(0.0, BOARD_M, 3)])
    values[13:] = TRUE_LENS
    return replace(camera.with_values(values), session=session)


def measured(true: Robot, cameras: list[Camera], q: np.ndarray, session: np.ndarray,
             random: np.random.Generator) -> Dataset:
    parts = []
    for camera in cameras:
        asked = q[session == camera.session]
        taken = pictures_at(true, Layout.of(()), camera, random.normal(asked, REPEATS_RAD), SENSORS, random)
        parts.append(replace(taken, joints={"q": asked[taken.picture]}))
    stack = lambda pick: np.concatenate([pick(part) for part in parts])
    pixel = stack(lambda part: part.pixel)
    return Dataset.of_arrays(
        "closures", {"q": stack(lambda part: part.joints["q"])}, pixel=pixel,
        picture=stack(lambda part: part.picture), corner=stack(lambda part: part.corner),
        session=stack(lambda part: part.session), contacts={"camera": np.zeros(len(pixel), int)},
        fixture=Fixture(camera=SETUP), identification=np.ones(len(pixel), bool),
    )


def errors_of(name: str, seed: int, count: int) -> tuple[float, ...]:
    """m: predicted with random poses and with the design, then the same as measured."""
    random = np.random.default_rng(seed)
    tool = Placement(exp(random.normal(0.0, 0.1, 3)), random.normal(0.0, 0.05, 3))
    nominal = replace(load_robot(name), tool=tool)
    true = replace(deviated(nominal, 1.0, random, frames=False), base=Placement())
    design = design_pictures(nominal, SETUP, ClosureDesignOptions(places=PLACES, count=count, seed=seed))
    carried = np.concatenate([random.normal(0.0, CAMERA_RAD, 3), random.normal(0.0, CAMERA_M, 3)])
    cameras = [truly(camera, k, carried, random) for k, camera in enumerate(design.cameras, 1)]
    under = VirtualRobot(nominal, placed(true, random))
    q = random.uniform(limit(nominal, "q_min"), limit(nominal, "q_max"), (JUDGED, nominal.axes))
    judge = measure_poses(under, q, replace(SENSORS, position_m=0.0), random)  # its noise would hide both
    found = []
    for q, session in ((design.q_random, design.session_random), (design.q, design.session)):
        data = measured(true, cameras, q, session, random)
        robot = calibrate_closures(nominal, data, CalibrationOptions(compliance=())).robot
        found.append(evaluate_poses(robot, judge).overall.mean)
    return (*design.deviation[1:], *found)


def main(arms: int, count: int) -> None:
    print("arm    predicted random, design   measured random, design [mm]")
    ratios = []
    for seed in range(arms):
        start = time.process_time()
        found = errors_of(ARMS[seed % len(ARMS)], seed, count)
        ratios.append(found[3] / found[2])
        print(f"{ARMS[seed % len(ARMS)]:6s}", *(f"{1e3 * each:.3f}" for each in found),
              f"  {time.process_time() - start:.0f} s", flush=True)
    print(f"measured, design over random: median {np.median(ratios):.2f}, better in "
          f"{np.sum(np.array(ratios) < 1.0)} of {arms}")


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:3]]
    main(*given, *(6, 40)[len(given):])
