"""The arm with what its flange carries in a motion: one body more in its last link, by rows.

    pi_n += (m, m c, m (|c|^2 1 - c c'))     m kg, c (3,) m, DH frame n: columns payload_kg, payload_x_m

A payload, known or of a session that was not weighed (`Effect.carries`), is part of the last link, so it
enters torque, mass matrix and springs alike. Rows of one payload share an arm; arms without masses carry
nothing.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.effects.base import Effect
from exactarm.effects.payload import inertial, with_added
from exactarm.robot.robot import Robot

Arm = tuple[np.ndarray | slice, Robot]


def loaded_arms(robot: Robot, data: Dataset, effects: Iterable[Effect] = ()) -> tuple[Arm, ...]:
    """Rows, and the arm that moves in them with what the data and the effects say that its flange carries."""
    own = [carried for carried in (effect.carries(data) for effect in effects) if carried is not None]
    if robot.links is None or (data.payload is None and not own):
        return ((slice(None), robot),)
    pi = carried_bodies(data)
    for at, added in own:
        pi[at] += added
    kinds, which = np.unique(pi, axis=0, return_inverse=True)
    rows = (np.flatnonzero(which.ravel() == place) for place in range(len(kinds)))
    return tuple((at, _with(robot, kind)) for at, kind in zip(rows, kinds))


def carried_bodies(data: Dataset) -> np.ndarray:
    """(N, 10) inertial parameters of the known payload of every row in frame n; zero where there is none."""
    pi = np.zeros((len(data), 10))
    if data.payload is not None:
        known = np.column_stack(data.payload)
        for kind in np.unique(known, axis=0):
            pi[(known == kind).all(axis=1)] = inertial((kind[0], *(kind[0] * kind[1:])))[0]
    return pi


def _with(robot: Robot, carried: np.ndarray) -> Robot:
    last = with_added(robot.links[-1], carried)
    return replace(robot, links=(*robot.links[:-1], last))
