"""Can the torques of the TX40 show that motor 5 also turns axis 6?

    python bench/wrist_coupling.py

The coupling (rad of axis 6 per rad of axis 5) is held at several values, everything else of the declared
model is fitted anew on the first 70 % of the motion, and the torque error of the last 30 % printed, axis by
axis. The true one is -1. Where all rows are alike, the data cannot tell.
"""

from __future__ import annotations

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import read_dataset
from exactarm.diagnose.problems import problem_for
from exactarm.effects.joint_coupling import JointCoupling
from exactarm.files.examples import data_path
from exactarm.robot_file import load_robot

COUPLINGS = (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0)
MOTOR, TURNED = 5, 6


def main() -> None:
    robot = load_robot("tx40")
    data = read_dataset([data_path("tx40/motion.parquet")], robot)
    rows = data.split(0)
    problem = problem_for(robot, data.select(rows), data.select(~rows), threads=1, seed=0)
    declared = problem.declared()
    reference = problem.fit(declared)
    print("coupling  square sum of the fit   held-out RMS in Nm: all, then axes 1 to 6")
    for coupling in COUPLINGS:
        wrist = JointCoupling(TURNED, (float(MOTOR), coupling))
        fitted = problem.fit(declared.joined(Layout.of((wrist,), estimate=False)))
        rms = np.sqrt(np.mean(problem.errors(fitted, problem.held_out).reshape(-1, robot.axes) ** 2, axis=0))
        numbers = "  ".join(f"{value:.2f}" for value in rms)
        print(f"{coupling:8.1f}  {fitted.square(reference):22.1f}   {np.sqrt(np.mean(rms**2)):.2f}  "
              f"{numbers}")


if __name__ == "__main__":
    main()
