"""Seeded random robots of the compiled core, with masses: arbitrary geometry, an axis that slides where asked."""

from __future__ import annotations

import numpy as np

from exactarm import _core


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    matrix, triangle = np.linalg.qr(rng.normal(size=(3, 3)))
    matrix = matrix * np.sign(np.diag(triangle))
    return matrix if np.linalg.det(matrix) > 0 else -matrix


def random_core_robot(rng: np.random.Generator, axes: int, sliding: int | None = None) -> _core.Robot:
    frames, links = [], []
    for i in range(axes):
        frame = _core.Frame()
        frame.type = _core.JointType.prismatic if i == sliding else _core.JointType.revolute
        frame.sign = rng.choice([-1.0, 1.0])
        frame.zero, frame.alpha = rng.uniform(-3, 3, 2)
        frame.d, frame.a = rng.uniform(-0.7, 0.7, 2)
        frame.beta = rng.choice([0.0, rng.uniform(-0.3, 0.3)])
        frames.append(frame)
        link = _core.LinkInertia()
        link.mass = rng.uniform(0.5, 40.0)
        link.centre_of_mass = rng.uniform(-0.3, 0.3, 3)
        turn = random_rotation(rng)
        link.inertia = turn @ np.diag(rng.uniform(0.2, 0.4, 3) * link.mass * 0.05) @ turn.T
        links.append(link)
    robot = _core.Robot()
    robot.frames, robot.links = frames, links
    robot.base = _core.Pose(random_rotation(rng), rng.uniform(-1, 1, 3))
    robot.tool = _core.Pose(random_rotation(rng), rng.uniform(-0.3, 0.3, 3))
    robot.gravity = np.array([0.3, -0.2, -9.8])
    return robot
