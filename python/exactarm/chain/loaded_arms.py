"""The arm with what its flange carries in a motion: one body more in its last link, by rows.

    pi_n += (m, m c, m (|c|^2 1 - c c'))     m kg, c (3,) m, flange frame: columns payload_kg, payload_x_m

A known payload is declared like a link, so it enters torque, mass matrix and springs alike. Rows of one
payload share an arm; arms without declared masses carry nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exactarm import _core
from exactarm.dataset import Dataset
from exactarm.effects.payload import inertial, with_added
from exactarm.robot import Robot

Arm = tuple[np.ndarray | slice, _core.Robot]


def loaded_arms(robot: Robot, data: Dataset) -> tuple[Arm, ...]:
    """Rows, and the arm that moves in them."""
    if data.payload is None or robot.links is None:
        return ((slice(None), robot.core),)
    mass, centre = data.payload
    kinds, which = np.unique(np.column_stack([mass, centre]), axis=0, return_inverse=True)
    rows = (np.flatnonzero(which.ravel() == place) for place in range(len(kinds)))
    return tuple((at, _with(robot, kind)) for at, kind in zip(rows, kinds))


def _with(robot: Robot, carried: np.ndarray) -> _core.Robot:
    mass, centre = carried[0], carried[1:]
    last = with_added(robot.links[-1], inertial((mass, *(mass * centre)))[0])
    return replace(robot, links=(*robot.links[:-1], last)).core
