"""Poses that touch: joint angles at which a target meets a contact, or a pose of the target, exactly or up to
a given lack.

    numbers(x(q)) = lack        Gauss-Newton on q from given starts, the shortest step each (Moore-Penrose)
"""

from __future__ import annotations

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import NO_CONTACT, Dataset
from exactarm.data.kinds import CLOSURES
from exactarm.measurement.closures import PAIR, ClosurePrediction, predict_closures, turn_of_axis
from exactarm.measurement.contact import Contact
from exactarm.measurement.contacts import CONTACT_CLASSES, Socket
from exactarm.numerics.factors import pinv
from exactarm.robot.robot import Robot

TOUCHES_M = 1e-9  # nearer than any device notices
_STEPS, _LONGEST_RAD = 40, 0.3
_SINGULAR = 1e-6  # of the largest singular value: no step that way


def rows_at(q: np.ndarray, contact: Contact | None, approach: np.ndarray | None = None, **more) -> Dataset:
    """Rows of the controller's angles q (N, n) that all touch `contact` (None: the rows' own x, y, z)."""
    names = {name: np.full(len(q), NO_CONTACT) for name in (*CONTACT_CLASSES, PAIR)}
    session = 1
    if contact is not None:
        names[contact.contact] = np.full(len(q), contact.number)
        session = contact.session
    joints = {"q": q} | ({} if approach is None else {"approach": approach})
    return Dataset.of_arrays(CLOSURES.name, joints, contacts=names, session=np.full(len(q), session), **more)


def predicted_at(robot: Robot, layout: Layout, q: np.ndarray, contact: Contact | None, approach=None,
                 **more) -> ClosurePrediction:
    """What a touch at q lacks, with derivatives; nothing of `layout` is free."""
    # the contact's own columns make the chain carry derivatives
    known = contact if contact is not None else Socket(None, (0.0, 0.0, 0.0), NO_CONTACT, NO_CONTACT)
    free = layout.held.joined(Layout.of((known,)))
    return predict_closures(robot, free, rows_at(q, contact, approach, **more))


def target_at(robot: Robot, layout: Layout, q: np.ndarray) -> np.ndarray:
    """(N, 3) m: where the target is in the base frame."""
    signals = predicted_at(robot, layout, q, None, position=np.zeros((len(q), 3))).view.signals
    return signals["target"] + signals["displacement"][:, :3]


def touching(
    robot: Robot, layout: Layout, q: np.ndarray, contact: Contact | None, lack: np.ndarray | float = 0.0,
    approach=None, **more
) -> tuple[np.ndarray, np.ndarray]:
    """Angles (N, n) from the starts q, and how far (N,) each still is from touching; joint limits are not
    looked at.

    lack (N, c): what the numbers are to be instead of zero; more: `length` of a bar, or `position` and
    `rotation` to reach.
    """
    left = np.full(len(q), np.inf)
    for _ in range(_STEPS):
        found = predicted_at(robot, layout, q, contact, approach, **more)
        c = found.residual.shape[1] if contact is None else contact.numbers
        rest = found.residual[:, :c] + lack
        left = np.linalg.norm(rest, axis=1)
        if left.max(initial=0.0) < TOUCHES_M:
            break
        by_joints = np.stack([turn_of_axis(found, i) for i in range(q.shape[1])], axis=2)[:, :c]
        step = (pinv(by_joints, rcond=_SINGULAR) @ rest[:, :, None])[:, :, 0]
        size = np.max(np.abs(step), axis=1, keepdims=True)
        q = q + step * np.minimum(1.0, _LONGEST_RAD / np.maximum(size, 1e-300))
    return q, left
