"""Robots and seeded poses for the tests of identifiability and design."""

from __future__ import annotations

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.effects.frames import Frames
from exactarm.identify.declared import geometry_layout
from exactarm.robot.robot import Joint, Placement, Robot

RIGHT = np.pi / 2
TOOL = Placement(position=np.array([0.03, 0.02, 0.05]))


def robot_of(rows, types=None, tool=TOOL, ratios=True) -> Robot:
    """A robot from rows of (d, a, alpha) or (None, a, alpha, beta)."""
    joints = []
    for i, row in enumerate(rows):
        d, a, alpha, *beta = row
        kind = "revolute" if types is None else types[i]
        joints.append(
            Joint(
                type=kind, d=d or 0.0, a=a, alpha=alpha, beta=beta[0] if beta else None,
                ratio=100.0 + 7.0 * i if ratios else None, q_min=-2.4, q_max=2.2,
            )
        )
    return Robot("made-up", tuple(joints), tool=tool)


def racer_like(hayati: bool = True, target_on_axis: bool = False) -> Robot:
    """The source's arm: axes 2 and 3 parallel, spherical wrist, beta at frame 3 (its Table A.12)."""
    third = (None, 0.13, RIGHT, 0.0) if hayati else (0.0, 0.13, RIGHT)
    rows = [(0.43, 0.15, RIGHT), (0.0, 0.59, 0.0), third, (0.684, 0.0, -RIGHT), (0.0, 0.0, RIGHT),
            (0.1, 0.0, 0.0)]
    return robot_of(rows, tool=Placement() if target_on_axis else TOOL)


def random_joints(robot: Robot, count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    lower = np.array([joint.q_min for joint in robot.joints])
    upper = np.array([joint.q_max for joint in robot.joints])
    return lower + (upper - lower) * rng.random((count, robot.axes))


def stacked_jacobian(robot: Robot, q: np.ndarray, frames: bool = True, orientation: bool = False):
    """(R, P) Jacobian of the declared model with its layout; the measuring frame is tilted and far away."""
    layout = geometry_layout(robot)
    if frames:
        tilt = np.array([[0.0, -0.8, 0.6], [1.0, 0.0, 0.0], [0.0, 0.6, 0.8]])
        base = Placement(tilt, np.array([1.0, 2.0, 0.3]))
        layout = Layout.of((Frames.of(1, base, robot.tool, orientation),)).joined(layout)
    prediction = predict_poses(robot, layout, Dataset.of_arrays("poses", {"q": q}))
    rows = prediction.jacobian if orientation else prediction.jacobian[:, :3]
    return rows.reshape(-1, layout.size), layout
