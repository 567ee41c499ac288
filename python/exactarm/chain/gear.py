"""The declared gear at the chain's first station: phi = Xi_d^{-1}(theta), by direction of motion (E5).

Each direction has its own table with Xi_d(0) = 0; where the direction is 0 (unknown, at rest) the mean
of both tables is taken, between the two their mixture Xi = (1 - d) / 2 Xi_cw + (1 + d) / 2 Xi_ccw
(chain/direction.py). A direction without a table of its own uses the other one's.
"""

import numpy as np

from exactarm import _core
from exactarm.robot.robot import Joint
from exactarm.view import View

_NEWTON_STEPS = 4  # from an error of the two tables' difference, 1e-3 rad


def declared_output_angle(view: View) -> tuple[np.ndarray, np.ndarray]:
    """phi (N, n) of the declared gears at view.theta, and dphi/dtheta (N, n)."""
    phi, slope = view.theta / view.robot.ratios, np.ones((view.rows, view.axes)) / view.robot.ratios
    way = view.direction
    for i, joint in enumerate(view.robot.joints):
        if not joint.has_harmonics:
            continue
        for direction, table in joint.tables:
            rows = way[:, i] == direction
            if rows.any():
                theta = view.theta[rows, i]
                # an axis that stands still needs one row
                theta = theta[:1] if np.ptp(theta) == 0.0 else theta
                output, ratio = _core.gear_outputs(joint.ratio, table, theta)
                phi[rows, i], slope[rows, i] = output, 1.0 / ratio
        rows = np.flatnonzero(np.mod(way[:, i], 1.0))
        if rows.size:
            phi[rows, i], slope[rows, i] = _between(joint, way[rows, i], view.theta[rows, i])
    return phi, slope


def _between(joint: Joint, direction: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """phi (N,) and dphi/dtheta (N,) between the two tables."""
    tables = ((joint.cw or joint.ccw).core(), (joint.ccw or joint.cw).core())
    mixed = lambda cw, ccw: 0.5 * (1.0 - direction) * cw + 0.5 * (1.0 + direction) * ccw
    phi = mixed(*(_core.gear_output_angle(joint.ratio, table, theta) for table in tables))
    for _ in range(_NEWTON_STEPS):
        ratio = mixed(*(_core.gear_ratio(joint.ratio, table, phi, 0) for table in tables))
        phi = phi - (mixed(*(_core.gear_motor_angle(joint.ratio, table, phi) for table in tables))
                     - theta) / ratio
    return phi, 1.0 / ratio


def differs_with_direction(joint: Joint) -> bool:
    """Whether the tables of the two directions differ: what lies between, at a reversal, no model defines."""
    if joint.cw is None or joint.ccw is None:
        return False
    return not all(np.array_equal(getattr(joint.cw, name), getattr(joint.ccw, name))
                   for name in ("order", "a", "b"))
