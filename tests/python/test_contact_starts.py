"""Contacts find where they are although the tool is not known: small faces, touched with the wrist turned
every way."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.identify.closures import nominal_closures
from exactarm.measurement.closures import touches
from exactarm.measurement.touching import touching
from exactarm.robot.robot import Placement
from exactarm.robot_file import load_robot
from exactarm.simulate import VirtualRobot, deviated
from exactarm.simulate.virtual_robot import placed

NORMALS = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
BLOCKS_M = ((0.5, 0.1, 0.2), (0.1, -0.5, 0.3))
EDGE_M, NOISE_M, TOUCHES_A_FACE = 0.1, 3e-5, 14


def touched_blocks(name: str, seed: int) -> tuple[VirtualRobot, Dataset]:
    """An arm that deviates from its drawing touches five faces of two blocks with a tool on its flange."""
    random = np.random.default_rng(seed)
    nominal = load_robot(name)
    true = placed(deviated(nominal, 1.0, random, frames=False), random)
    robot = VirtualRobot.of(nominal, [], replace(true, base=Placement()))
    points, faces, sessions = [], [], []
    for session, centre in enumerate(BLOCKS_M, start=1):
        for face, normal in enumerate(NORMALS):
            across = random.uniform(-EDGE_M / 2, EDGE_M / 2, (TOUCHES_A_FACE, 3))
            points.append(np.array(centre) + normal * EDGE_M / 2 + across - np.outer(across @ normal, normal))
            faces += [face] * TOUCHES_A_FACE
            sessions += [session] * TOUCHES_A_FACE
    points = np.concatenate(points) + random.normal(0.0, NOISE_M, (len(faces), 3))
    q = np.full((len(points), nominal.axes), np.nan)
    for _ in range(30):
        left = np.flatnonzero(np.isnan(q).any(axis=1))
        if not len(left):
            break
        starts = random.uniform(-2.5, 2.5, (len(left), nominal.axes))
        found, lack = touching(robot.true, Layout.of(()), starts, None, position=points[left])
        q[left[lack < 1e-9]] = found[lack < 1e-9]
    at = np.flatnonzero(np.isfinite(q).all(axis=1))
    data = Dataset.of_arrays("closures", {"q": q[at]}, contacts={"plane": np.array(faces)[at]},
                             session=np.array(sessions)[at])
    return robot, data


@pytest.mark.parametrize("name", ["panda", *(pytest.param(name, marks=pytest.mark.slow)
                                             for name in ("ur10", "tx40"))])
def test_small_faces_are_found_with_an_unknown_tool(name):
    """Around a wrong tool a face lay across its touches and stayed there, 9 to 43 mm off; an arm of this
    deviation misses its faces by 2 to 4 mm at most (seeds 0 to 2 of each arm;
    the first is run here)."""
    robot, data = touched_blocks(name, 0)
    data = touches(data)
    fit = nominal_closures(robot.nominal, data, Layout.of(()))
    assert len(data) > 130
    assert fit.prediction.error().max() < 5e-3
