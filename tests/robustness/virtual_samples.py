"""Small valid files of virtual robots, beside those of shipped data (samples.py): name -> bytes. The same
every time."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from exactarm.commands.design_for import experiment_json
from exactarm.compensate.measuring_program import Stop, measuring_program
from exactarm.data.dataset import Dataset, write_dataset
from exactarm.diagnose.next_poses import Experiment
from exactarm.robot.robot import Robot
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_poses
from exactarm.simulate.closures import fixture_text, measure_closures

SEED = 4
DIALECTS = ("rapid", "fanuc", "inform")  # whose samples are our own measuring programs
SESSIONS = "session,payload_kg,payload_z_mm,temperature_degC\n1,2.5,80,21\n2,,0,23\n"
ABOUT = 'serial = "2012300001"\ninstrument = "tracker"\ninstrument_u_mm = "0.015"\nmeasured = "2012-07-03"\n'
CALIBRATION = """\
[mounting]
delta_theta = [ 0.0001, -0.0002, 0.0003, 0.0, 0.0001, 0.0]
delta_a = [ 0.00005, 0.0001, -0.0001, 0.0, 0.0, 0.0]
delta_d = [ 0.0001, 0.0, 0.0, 0.0002, 0.0, 0.0]
delta_alpha = [ 0.0001, -0.0003, 0.0002, 0.0, 0.0, 0.0]
joint_selftest_data_calculated = [0,0,0]
"""
YAML = """\
joint_names: [joint_1, joint_2, joint_3, joint_4, joint_5, joint_6]
points:
- positions: [0.1, -1.2, 1.3, -0.4, 1.5, 0.2]
  time_from_start: {sec: 0, nanosec: 0}
- positions: [0.2, -1.1, 1.2, -0.3, 1.4, 0.1]
  time_from_start: {sec: 1, nanosec: 0}
"""


def with_pulses(robot: Robot) -> Robot:
    """A controller that counts pulses, as the dialect INFORM needs it."""
    pulses = (1e5,) * robot.axes
    return replace(robot, controller=replace(robot.controller, coupling=(), pulses_per_rad=pulses))


def virtual_samples() -> dict[str, bytes]:
    robot, random = load_robot("ur10"), np.random.default_rng(SEED)
    true = VirtualRobot.of(robot)
    q = random.uniform(-0.6, 0.6, (30, 6)) + [0.3, -1.2, 1.0, 0.2, 0.9, 0.0]
    points = measure_poses(true, q[:8], Sensors(counts=0), random)
    targets = pd.DataFrame(q[:8], columns=[f"q_{i}_rad" for i in range(1, 7)])
    sessions = measure_poses(true, q, Sensors(position_m=3e-5, counts=0), random)
    sessions = replace(sessions, session=1 + np.arange(30) // 15)
    tenth_px = Sensors(orientation_rad=7e-5, counts=0)
    pictures, fixture = measure_closures(true, "camera", 1, 8, tenth_px, random)
    experiment = experiment_json(Experiment(q[:3], 0.0, 0.4, 1.0, "this or that"))
    racer = with_pulses(load_robot("racer-7-1.4"))
    programs = dict(measuring_program(racer, dialect, [Stop(q[1] * 0.5, q[1] * 0.5 - 0.05)] * 2)
                    for dialect in DIALECTS)
    return {
        "camera.csv": _written(pictures, robot), "camera.toml": fixture_text(fixture).encode(),
        "two.csv": _written(sessions, robot), "sessions.csv": SESSIONS.encode(),
        "points.csv": _written(points, robot), "targets.csv": targets.to_csv(index=False).encode(),
        "experiments.json": json.dumps({"experiments": [experiment]}).encode(),
        "about.toml": ABOUT.encode(), "calibration.conf": CALIBRATION.encode(),
        "trajectory.yaml": YAML.encode(),
    } | {name: text.encode() for name, text in programs.items()}


def _written(data: Dataset, robot: Robot) -> bytes:
    with TemporaryDirectory() as folder:
        write_dataset(Path(folder) / "data.csv", data, robot)
        return (Path(folder) / "data.csv").read_bytes()
