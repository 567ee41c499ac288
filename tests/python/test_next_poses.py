"""The poses that a diagnosis asks for: against the fit that the new measurements would really allow."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout, predict_poses
from exactarm.dataset import Dataset
from exactarm.diagnose.next_poses import plan_separation, separating_poses
from exactarm.diagnose.pose_problem import PoseProblem
from exactarm.effects.gear_ratio import GearRatio
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.identify.pose_space import PoseSpace
from exactarm.robot import Placement
from exactarm.robot_file import load_robot

SPRING, RATIO = JointCompliance(2, (2e-6, 0.0)), GearRatio(2, (0.0,))


@pytest.fixture(scope="module")
def narrow():
    """The UR10 measured with axis 2 in a narrow range, where a spring and a wrong ratio look alike."""
    robot = replace(load_robot("ur10"), tool=Placement(position=np.array([0.05, 0.0, 0.1])))
    rng = np.random.default_rng(2)
    q = rng.uniform(-1.2, 1.2, (60, 6))
    q[:, 1] = rng.uniform(-0.9, -0.7, 60)
    data = Dataset.of_arrays("poses", {"q": q})
    exact = predict_poses(robot, Layout.of(()), data, tangents=False).position
    measured = replace(data, position=exact + rng.normal(0.0, 1e-4, (60, 3)))
    problem = PoseProblem(robot, measured, measured.select(np.zeros(60, bool)))
    return robot, problem.fit(problem.declared())


def left_by_rival(robot, fitted, q, repeats):
    """Whitened length of the spring's signal after declared parameters and ratio were fitted to old and new poses."""
    both_ways = np.repeat(q, 2, axis=0)
    approach = np.tile([[-1.0], [1.0]], (len(q), robot.axes))
    new = Dataset.of_arrays("poses", {"q": both_ways, "approach": approach}, position=np.zeros((len(both_ways), 3)))
    new = replace(new, session=np.full(len(both_ways), fitted.view.data.session[0]))
    views = (fitted.view, *[predict_poses(robot, fitted.layout, new).view] * repeats)
    signal = np.concatenate([(2e-6 * v.response(SPRING)[:, :3, 0]).ravel() for v in views])
    others = [np.concatenate([v.tangents["measured"], v.response(RATIO)[:, :3]], axis=2) for v in views]
    columns = np.concatenate([each.reshape(-1, each.shape[2]) for each in others])
    columns = columns / np.linalg.norm(columns, axis=0)
    rest = signal - columns @ np.linalg.lstsq(columns, signal, rcond=1e-12)[0]
    return np.linalg.norm(rest) / fitted.sigma[0]


def test_promised_distance_is_what_a_fit_would_leave(narrow):
    robot, fitted = narrow
    plan = plan_separation(robot, fitted, SPRING, RATIO, 0)
    assert plan.after == pytest.approx(left_by_rival(robot, fitted, plan.q, plan.repeats), rel=1e-3)
    assert plan.before == pytest.approx(left_by_rival(robot, fitted, plan.q, 0), rel=0.05, abs=0.05)
    assert plan.after > 4.0 > plan.before


def test_chosen_poses_part_better_than_random_ones(narrow):
    robot, fitted = narrow
    plan = plan_separation(robot, fitted, SPRING, RATIO, 0)
    space = PoseSpace.of(robot)
    assert np.all((plan.q >= space.lower) & (plan.q <= space.upper))
    rng = np.random.default_rng(5)
    random = [left_by_rival(robot, fitted, space.draw(len(plan.q), rng), plan.repeats) for _ in range(40)]
    assert plan.after > max(random)


def test_sentence_names_poses_effects_and_distance(narrow):
    robot, fitted = narrow
    text = separating_poses(robot, fitted, SPRING, RATIO, 0)
    assert text.startswith("Measure q = (") and "joint compliance of axis 2 and gear ratio of axis 2 stand" in text
    assert text == separating_poses(robot, fitted, SPRING, RATIO, 0)


def test_says_so_when_no_pose_parts_them(narrow):
    robot, fitted = narrow
    faint = SPRING.with_values((1e-12, 0.0))
    assert separating_poses(robot, fitted, faint, RATIO, 0).startswith("No unloaded poses inside the limits part")
