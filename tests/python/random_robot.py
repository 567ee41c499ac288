"""Seeded random robots of the compiled core, with masses: arbitrary geometry, an axis that slides where
asked."""

from __future__ import annotations

import numpy as np

from exactarm import _core


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    matrix, triangle = np.linalg.qr(rng.normal(size=(3, 3)))
    matrix = matrix * np.sign(np.diag(triangle))
    return matrix if np.linalg.det(matrix) > 0 else -matrix


def random_core_robot(rng: np.random.Generator, axes: int, sliding: int | None = None) -> _core.Robot:
    joints = []
    for i in range(axes):
        kind = _core.JointType.prismatic if i == sliding else _core.JointType.revolute
        sign = rng.choice([-1.0, 1.0])
        zero, alpha = rng.uniform(-3, 3, 2)
        d, a = rng.uniform(-0.7, 0.7, 2)
        frame = _core.Frame(kind, sign, zero, d, a, alpha, beta=rng.choice([0.0, rng.uniform(-0.3, 0.3)]))
        mass, centre_of_mass = rng.uniform(0.5, 40.0), rng.uniform(-0.3, 0.3, 3)
        turn = random_rotation(rng)
        inertia = turn @ np.diag(rng.uniform(0.2, 0.4, 3) * mass * 0.05) @ turn.T
        joints.append(_core.Joint(frame, link=_core.LinkInertia(mass, centre_of_mass, inertia)))
    base = _core.Pose(random_rotation(rng), rng.uniform(-1, 1, 3))
    tool = _core.Pose(random_rotation(rng), rng.uniform(-0.3, 0.3, 3))
    return _core.Robot(joints, base, tool, gravity=np.array([0.3, -0.2, -9.8]))
