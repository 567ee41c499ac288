"""The declared gear at the chain's first station: phi = Xi_d^{-1}(theta), by direction of motion (E5).

Each direction has its own table with Xi_d(0) = 0; where the direction is 0 (unknown, at rest) the mean
of both tables is taken, and a direction without a table of its own uses the other one's.
"""

from __future__ import annotations

import numpy as np

from exactarm import _core
from exactarm.chain.view import View
from exactarm.robot import GearTable, Joint

_BRIDGE_S = 0.02
_JUMP, _LEAST_JUMP_RAD = 3.0, 1e-9  # a step this many times its neighbours' is none of the motion


def declared_output_angle(view: View) -> tuple[np.ndarray, np.ndarray]:
    """phi (N, n) of the declared gears at view.theta, and dphi/dtheta (N, n)."""
    phi, slope = view.theta / view.robot.ratios, np.ones((view.rows, view.axes)) / view.robot.ratios
    for i, joint in enumerate(view.robot.joints):
        if not joint.has_harmonics:
            continue
        for direction, table in direction_tables(joint):
            rows = view.direction[:, i] == direction
            if rows.any():
                theta = view.theta[rows, i]
                theta = theta[:1] if np.ptp(theta) == 0.0 else theta  # an axis that stands still needs one row
                output = _core.gear_output_angle(joint.ratio, table, theta)
                phi[rows, i] = output
                slope[rows, i] = 1.0 / _core.gear_ratio(joint.ratio, table, output, 0)
    return phi, slope


def bridged(phi: np.ndarray, nominal: np.ndarray, direction: np.ndarray, runs, step: float) -> np.ndarray:
    """phi (N, n) of a motion without the jump from one direction's table to the other's at a reversal.

    The model does not define the transition; here it is a cubic in what phi deviates from `nominal`, over 20 ms
    to either side.
    """
    deviation, reach = phi - nominal, max(2, int(np.ceil(_BRIDGE_S / step)))
    out = deviation.copy()
    for rows in runs:
        last = len(rows) - 1
        for i in range(phi.shape[1]):
            x, sign = deviation[rows, i], direction[rows, i]
            steps = np.abs(np.diff(x))
            for flip in np.flatnonzero(sign[1:] != sign[:-1]):
                beside = steps[[max(flip - 1, 0), min(flip + 1, last - 1)]].max()
                if steps[flip] <= _JUMP * beside + _LEAST_JUMP_RAD:
                    continue
                a, b = max(flip - reach, 0), min(flip + 1 + reach, last)
                s = (np.arange(a, b + 1) - a) / (b - a)
                start, end = out[rows[a], i], out[rows[b], i]
                out[rows[a : b + 1], i] = start + (end - start) * s**2 * (3.0 - 2.0 * s)
    return nominal + out


def direction_tables(joint: Joint) -> tuple[tuple[int, _core.GearTable], ...]:
    """(-1: cw, 0: mean, +1: ccw) with the core's tables."""
    cw, ccw = joint.cw or joint.ccw, joint.ccw or joint.cw
    return ((-1, cw.core()), (0, mean_table(cw, ccw).core()), (1, ccw.core()))


def mean_table(cw: GearTable, ccw: GearTable) -> GearTable:
    """Harmonics with half the coefficients of either table."""
    if cw is ccw:
        return cw
    return GearTable(
        np.concatenate([cw.order, ccw.order]),
        0.5 * np.concatenate([cw.a, ccw.a]),
        0.5 * np.concatenate([cw.b, ccw.b]),
    )
