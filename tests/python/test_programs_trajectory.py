"""JointTrajectory files with traps: read before and after `compensate` by PyYAML, not by the package's
reader."""

import json
import re

import numpy as np
import pytest
import yaml

from compensation_cell import nearby
from exactarm.errors import InputError
from interpreters import joint_trajectory
from interpreters.verdict import arm_of, compensate, corrected, robot_of

NAMES = tuple(f"a{i}" for i in range(1, 7))
ROBOT = robot_of(joint_names=NAMES)
ARM = arm_of(ROBOT)
Q = nearby(ROBOT, 1)[0] + np.linspace(0.0, 0.1, 4)[:, None]
ORDER = (3, 1, 0, 5, 4, 2)


def execute(files):
    return joint_trajectory.execute(files, ARM, Q[0], NAMES)


def trajectory(order=ORDER):
    points = [{"positions": [float(row[i]) for i in order], "time_from_start": {"sec": k, "nanosec": 0}}
              for k, row in enumerate(Q)]
    return {"joint_names": [NAMES[i] for i in order], "points": points}


def dump(data, **style):
    return yaml.safe_dump(data, **style)


FLOW = dump(trajectory(), default_flow_style=None, width=1000)
RIGHT = {
    "block style": dump(trajectory()),
    "lists in brackets": FLOW,
    "in the order of the robot": dump(trajectory(range(6))),
    "a goal": dump({"trajectory": trajectory(), "goal_time_tolerance": {"sec": 1, "nanosec": 0}}),
    "points before names": dump(trajectory(), sort_keys=True).replace("joint_names", "joint_names"),
    "comments that look like numbers": FLOW.replace("points:",
                                                    "points:  # [1, 2, 3]\n# positions: [1, 2, 3]"),
    "quoted names": FLOW.replace("a4", "'a4'").replace("a2", '"a2"'),
    "as it is shown, with the end of the message": FLOW + "---\n",
    "a goal of no joints beside it": dump({"trajectory": trajectory(), "multi_dof_trajectory": {
        "joint_names": [], "points": []}}),
    "times in seconds": re.sub(r"(time_from_start: )\{nanosec: 0, sec: (\d+)\}", r"\1\2.0", FLOW),
    "a gripper and a rail beside the arm": re.sub(r"(positions: \[)([^\]]*)", r"\1 0.3, \2, 0.02", re.sub(
        r"(joint_names: \[)([^\]]*)", r"\1rail, \2, gripper", FLOW)),
    "JSON": json.dumps(trajectory()),
    "JSON of several lines": json.dumps(trajectory(), indent=2),
}
REFUSED = {
    "an unknown name": FLOW.replace("a4", "wrist"),
    "a key that is a list": FLOW + "? [a, b]\n: 1\n",
    "keys of a time that are mappings": FLOW.replace("nanosec: 0", "? {nanosec: 0}\n"),
    "a list among the names": FLOW.replace("a4", "[a4]"),
    "a name given twice": FLOW.replace("a4", "a2"),
    "a point with too few numbers": FLOW.replace("positions: [", "positions: [0.1, ", 1),
    "a name without a position": re.sub(r"(joint_names: \[)([^\]]*)", r"\1\2, gripper", FLOW),
    "no number": re.sub(r"(positions: \[)[^,]*", r"\1.nan", FLOW, count=2),
    "an angle in degrees": re.sub(r"(positions: \[)[^,]*", r"\g<1>98.0", FLOW, count=2),
    "numbers that stand for others": re.sub(r"positions: \[[^\]]*\]", "positions: *first", FLOW.replace(
        "positions: [", "positions: &first [", 1).replace("positions: &first", "held", 1)).replace(
        "held", "positions: &first"),
}


@pytest.mark.parametrize("name", RIGHT)
@pytest.mark.slow
def test_every_point_is_reached(tmp_path, name):
    corrected(tmp_path, ROBOT, execute, {"prog.yaml": RIGHT[name].encode()})


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_one_right_number_is_refused(tmp_path, name):
    with pytest.raises(InputError, match=r"prog.yaml\S* \S"):
        compensate(tmp_path, ROBOT, {"prog.yaml": REFUSED[name].encode()})


