"""Whether a partner's robot file can be that of the arm that was touched, in a second and before any fit.

    min over t, s, b, R of the median of  | |p + R_A t - b - R (p_B + R_B s)| - d |

p, R_A and p_B, R_B: the flanges of both arms as declared; t, s: their balls; b, R: where the partner stands;
d: the declared distance of the balls. Twelve unknowns, by least squares with a soft loss (touches may have
slipped) from several t. A whole fit has these unknowns and no others before the geometry is free, so that
what fails here fails there.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy  # scipy.optimize is imported at its first use

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.measurement.closures import predict_closures
from exactarm.measurement.partner import Partner, partner_of, placed_by
from exactarm.numerics.rotation import exp, left_jacobian
from exactarm.robot.robot import Robot

MOST_ROWS = 300
_SOFT_M = 0.02  # beyond, a row counts by its distance and no more by its square: far above any deviation
_STEPS = 60


def partner_misfit(robot: Robot, carried: Layout, data: Dataset, tools: Sequence[np.ndarray],
                   enough: float) -> float:
    """Median distance in m by which the balls miss each other at best, from the first of `tools` (3,) that
    comes below `enough`; carried: the robot file's own effects; data: touches of a partner alone."""
    rows = data.select(np.unique(np.linspace(0, len(data) - 1, min(len(data), MOST_ROWS)).astype(int)))
    view = predict_closures(robot, carried.held, rows, tangents=False).view
    declared = partner_of(rows.fixture, rows)
    other = replace(Partner(None, (), 1, 0), declared_as=declared).flange(view, np.arange(len(rows)))
    turned = view.signals["target_rotation"].reshape(-1, 3, 3) @ robot.tool.rotation.T
    last = view.signals["target"] + view.signals["displacement"][:, :3] - turned @ robot.tool.position
    best = np.inf
    for tool in tools:
        turn, base, ball = placed_by(last + turned @ tool, other.position, other.rotation, np.zeros(3))
        about = (last, turned, other.position, other.rotation, turn)
        start = np.concatenate([base, np.zeros(3), ball, tool])
        found = scipy.optimize.least_squares(
            lambda v, about=about: distances(v, *about)[0] - declared.distance, start,
            lambda v, about=about: distances(v, *about)[1], loss="soft_l1", f_scale=_SOFT_M, max_nfev=_STEPS)
        best = min(best, float(np.median(np.abs(found.fun))))
        if best < enough:
            break
    return best


def distances(v: np.ndarray, last: np.ndarray, turned: np.ndarray, position: np.ndarray, rotation: np.ndarray,
              turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) m between the balls at v (12,): base, its turn beside `turn`, the partner's ball and the arm's, on
    flanges at `last` and `position` (N, 3), turned by (N, 3, 3); and the derivatives (N, 12)."""
    placed = exp(v[3:6]) @ turn
    there = (position + rotation @ v[6:9]) @ placed.T
    way = last + turned @ v[9:] - there - v[:3]
    distance = np.linalg.norm(way, axis=1)
    way /= np.maximum(distance, 1e-300)[:, None]
    by_turn = np.cross(way, there) @ left_jacobian(v[3:6])
    by_ball, by_tool = (np.einsum("ni,nij->nj", way, by) for by in (placed @ rotation, turned))
    return distance, np.concatenate([-way, by_turn, -by_ball, by_tool], axis=1)
