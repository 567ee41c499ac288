"""Isolability: what the table promises is what separate fits of simulated causes show."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.design.pose_space import PoseSpace
from exactarm.diagnose.isolability import isolability
from exactarm.diagnose.pose_problem import PoseProblem
from exactarm.effects.joint_coupling import JointCoupling
from exactarm.identify import pose_fit
from exactarm.robot.robot import Placement
from exactarm.robot_file import load_robot

NOISE_M = 5e-5


@pytest.fixture(scope="module")
def planned():
    robot = replace(load_robot("ur10"), tool=Placement(position=np.array([0.05, 0.0, 0.1])))
    poses = Dataset.of_arrays("poses", {"q": PoseSpace.of(robot).draw(50, np.random.default_rng(4))})
    return robot, poses, isolability(robot, poses, NOISE_M, 0)


@pytest.mark.slow
def test_seen_is_the_length_that_a_fit_leaves_of_the_cause(planned, monkeypatch):
    """A tracker's scales at their plausible sizes, one after the other: what the declared parameters cannot
    absorb of each, in noise-free data, all components weighed alike as under the noise of the table."""
    monkeypatch.setattr(pose_fit, "_APART", np.inf)
    robot, poses, table = planned
    at = [effect.name for effect in table.effects].index("tracker_scale")
    sizes = [0.0 if p.fixed else p.plausible for p in table.effects[at].parameters()]
    squares = []
    for scales in np.diag(sizes):
        scaled = Layout.of((table.effects[at].with_values(scales),), estimate=False)
        data = replace(poses, position=predict_poses(robot, scaled, poses, tangents=False).position)
        problem = PoseProblem(robot, data, data.select(np.zeros(len(data), bool)))
        squares.append(np.sum(problem.fit(problem.declared()).residual ** 2))
    assert np.sqrt(sum(squares)) / NOISE_M == pytest.approx(table.seen[at], rel=0.1)


@pytest.mark.slow
def test_every_cause_has_a_name_of_its_own(planned):
    """Growth of a link and drift of an axis were both "thermal drift of axis 1": one lost its column."""
    titles = planned[2].titles
    assert len(set(titles)) == len(titles) and "thermal growth of link 3" in titles


@pytest.mark.slow
def test_an_axis_whose_turn_moves_nothing_shows_nothing():
    # the target lies on axis 6
    robot = replace(load_robot("ur10"), tool=Placement(position=np.array([0.0, 0.0, 0.1])))
    poses = Dataset.of_arrays("poses", {"q": PoseSpace.of(robot).draw(40, np.random.default_rng(1))})
    table = isolability(robot, poses, NOISE_M, 0)
    hidden = [e.joint for e, seen in zip(table.effects, table.seen)
              if e.name == "gear_harmonics" and seen < 0.01]
    assert hidden == [6]


def test_half_the_noise_is_twice_the_distance_and_none_exceeds_what_is_seen(planned):
    robot, poses, table = planned
    finer = isolability(robot, poses, 0.5 * NOISE_M, 0)
    assert np.allclose(finer.seen, 2.0 * table.seen, rtol=0.02)
    apart = np.where(np.isfinite(table.apart), table.apart, 0.0)
    assert np.all(apart <= table.seen[:, None] * (1.0 + 1e-9)) and np.all(np.isinf(np.diag(table.apart)))


@pytest.mark.slow
def test_a_narrow_axis_confuses_its_spring_with_its_gear():
    robot = replace(load_robot("ur10"), tool=Placement(position=np.array([0.05, 0.0, 0.1])))
    rng = np.random.default_rng(2)
    wide, narrow = rng.uniform(-1.5, 1.5, (60, 6)), rng.uniform(-1.5, 1.5, (60, 6))
    narrow[:, 1:4] = [-0.8, 0.5, 0.3] + rng.uniform(-0.1, 0.1, (60, 3))

    def apart(q):
        table = isolability(robot, Dataset.of_arrays("poses", {"q": q}), NOISE_M, 0)
        labels = [(e.name, e.joint) for e in table.effects]
        return table.apart[labels.index(("joint_compliance", 2)), labels.index(("gear_harmonics", 2))]

    assert apart(narrow) < 1.0 < 4.0 < apart(wide)


@pytest.mark.slow
def test_what_the_robot_file_declares_is_no_unknown():
    """A declared coupling moves the arm that is planned, too: without it no frames would fit."""
    robot = replace(load_robot("ur10"), effects=(JointCoupling(3, (2.0, 1.0)),))
    poses = Dataset.of_arrays("poses", {"q": PoseSpace.of(robot).draw(40, np.random.default_rng(1))})
    table = isolability(robot, poses, NOISE_M, 0)
    assert ("joint_coupling", 3) not in [(e.name, e.joint) for e in table.effects if e.values[0] == 2.0]
