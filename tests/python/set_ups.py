"""Random set-ups for tests of calibration: a deviated robot at an unknown place, measured with noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.robot.robot import Placement, Robot
from exactarm.simulate.virtual_robot import deviated
from random_robot import random_rotation

TOOL_REACH_M = 0.5


def at_random_place(robot: Robot, rng: np.random.Generator, tool_reach: float = TOOL_REACH_M) -> Robot:
    """Base anywhere and turned any way; target up to `tool_reach` (m) off the flange, away from the last
    axis."""
    offset = rng.normal(size=3)
    offset *= rng.uniform(0.1, 1.0) * tool_reach / np.linalg.norm(offset)
    return replace(robot, base=Placement(random_rotation(rng), rng.normal(0.0, 2.0, 3)),
                   tool=Placement(position=offset))


def true_robot(nominal: Robot, rng: np.random.Generator, scale: float = 1.0) -> Robot:
    """`nominal` with deviations of mm and mrad, its declared masses and springs, at a random place."""
    true = deviated(nominal, scale, rng, frames=False)
    return at_random_place(replace(true, links=nominal.links), rng)


def joints_in_limits(robot: Robot, count: int, rng: np.random.Generator) -> np.ndarray:
    lower = np.array([-2.0 if joint.q_min is None else joint.q_min for joint in robot.joints])
    upper = np.array([2.0 if joint.q_max is None else joint.q_max for joint in robot.joints])
    return rng.uniform(lower, upper, (count, robot.axes))


def measured(
    nominal: Robot, truth: list[Robot], q: list[np.ndarray], noise_m: float, rng: np.random.Generator, *,
    layout: Layout = Layout.of(()), noise_rad: float | None = None, **columns,
) -> Dataset:
    """Session s measures truth[s] at the poses q[s] (K, n) that `nominal` is commanded to; further columns as
    given.

    noise_rad: orientation is measured too.
    """
    rows = sum(map(len, q))
    theta = (np.concatenate(q) - nominal.controller_offsets) * nominal.controller_ratios
    session = np.repeat(1 + np.arange(len(q)), [len(each) for each in q])
    joints = {"theta": theta} | columns.pop("joints", {})
    data = Dataset.of_arrays("poses", joints, position=np.zeros((rows, 3)), session=session, **columns)
    position, rotation = np.empty((rows, 3)), np.empty((rows, 3, 3))
    for number, robot in enumerate(truth, start=1):
        here = session == number
        prediction = predict_poses(robot, layout, data.select(here), tangents=False)
        position[here], rotation[here] = prediction.position, prediction.rotation
    data = replace(data, position=position + rng.normal(0.0, noise_m, (rows, 3)))
    if noise_rad is None:
        return data
    from exactarm.numerics.rotation import exp

    return replace(data, rotation=exp(rng.normal(0.0, noise_rad, (rows, 3))) @ rotation)
