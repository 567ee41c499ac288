"""Which problem class analyses which kind of data."""

from __future__ import annotations

from exactarm.data.dataset import Dataset
from exactarm.diagnose.closure_problem import ClosureProblem
from exactarm.diagnose.gear_problem import GearProblem
from exactarm.diagnose.motion_problem import MotionProblem
from exactarm.diagnose.pose_problem import PoseProblem
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.tracked_problem import TrackedProblem
from exactarm.errors import InputError
from exactarm.identify.loads import with_loads
from exactarm.robot.robot import Robot

PROBLEMS: dict[str, type[Problem]] = {cls.kind: cls
                                      for cls in (PoseProblem, GearProblem, MotionProblem, TrackedProblem,
                                                  ClosureProblem)}


def problem_for(robot: Robot, data: Dataset, held_out: Dataset, threads: int, seed: int) -> Problem:
    """The problem of the data's kind. Raises InputError for a kind that cannot be diagnosed."""
    if data.kind not in PROBLEMS:
        raise InputError(f"diagnosis reads {', '.join(PROBLEMS)}; found {data.kind}")
    return PROBLEMS[data.kind](with_loads(robot, data), data, held_out, threads, seed)
