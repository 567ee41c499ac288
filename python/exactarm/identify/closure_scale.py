"""The scale of closures: whether anything tells how large the robot is, and what is held where nothing does.

All lengths of robot and surroundings times a common factor close as well. Where nothing gives a length, the
longest one of the robot keeps its declared value. Every interval knows that what is held is only as good as a
drawing.
"""

from dataclasses import replace

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.identify.closure_fit import ClosureFit, Pulls, pseudo_inverse
from exactarm.identify.partner_prior import partner_tells_scale
from exactarm.measurement.closures import device_of, predict_closures
from exactarm.measurement.contacts import SENSORS
from exactarm.measurement.known_lengths import known_lengths
from exactarm.numerics.factors import lstsq
from exactarm.robot.robot import Robot


def scale_is_known(layout: Layout, data: Dataset) -> bool:
    """Whether a known length, an absolute bar, a calibrated partner or a tracker tells the size of things, or
    nothing has any."""
    if gravity_alone(data):
        return True
    tracked = data.position is not None and bool(np.isfinite(data.position).any())
    read = data.length is not None and bool(np.isfinite(data.length).any())
    return tracked or read or partner_tells_scale(data) or bool(known_lengths(layout, data.fixture))


def gravity_alone(data: Dataset) -> bool:
    """Whether no row of `touches` shows a length."""
    return bool(np.isin(device_of(data), list(SENSORS)).all())


def longest_length(layout: Layout, held: set[str], first: int) -> str:
    """The longest length of the robot that is still free."""
    lengths = [(abs(value), name) for name, value in zip(layout.names[first:], layout.values[first:])
               if name.unit == "m" and name not in held]
    return max(lengths)[1]


def with_held_in_doubt(fit: ClosureFit, whole: Layout, data: Dataset, pulls: Pulls,
                       threads: int = 1) -> ClosureFit:
    """The fit whose intervals know that what is held is only as good as a drawing. `whole`: the layout before
    anything was held."""
    scale = (np.sqrt(fit.worth) * fit.weight)[:, None] / fit.sigma
    doubt = _held_doubt(fit.robot, fit.layout, whole, data, scale, pulls, fit.fit.at_bound, threads)
    return replace(fit, fit=replace(fit.fit, covariance=fit.fit.covariance + doubt @ doubt.T))


def expected_deviations(robot: Robot, layout: Layout, whole: Layout, data: Dataset, sigma: float,
                        pulls: Pulls, threads: int = 1) -> np.ndarray:
    """(P,) standard deviations of the free parameters of `layout` that touches good to `sigma` (m or rad) let
    expect; `whole`: as above."""
    prediction = predict_closures(robot, layout, data, threads=threads)
    rows = prediction.jacobian.reshape(-1, layout.size) / sigma
    pull = pulls.rows(layout)[0]
    doubt = _held_doubt(robot, layout, whole, data, np.array(1.0 / sigma), pulls,
                        np.zeros(layout.size, bool), threads)
    return np.sqrt(np.diag(pseudo_inverse(rows.T @ rows + pull.T @ pull) + doubt @ doubt.T))


def _held_doubt(robot: Robot, fitted: Layout, whole: Layout, data: Dataset, scale: np.ndarray, pulls: Pulls,
                at_bound: np.ndarray, threads: int) -> np.ndarray:
    """(P, h): what each held parameter, a tolerance off, adds to the P estimates.

    Of unseen directions one parameter stays where the drawing has it (of two parallel axes under an
    inclinometer the second zero, the longest length where none is known); the others took up its
    deviation h, x = G h with G = -(H_kk)^-1 H_kh of the normal matrix, h as wide as the drawing's tolerance.
    scale: 1 / standard deviation of the rows' numbers, (N, m) or what becomes it.
    """
    estimates = dict(zip(fitted.names, fitted.values))
    free = np.array([name in estimates for name in whole.names])
    tolerance = np.array([pulls.drawing.get(n, (0.0, own))[1] for n, own in zip(whole.names, whole.prior)])
    held = ~free & np.isfinite(tolerance)
    doubt = np.zeros((fitted.size, held.sum()))
    if not held.any():
        return doubt
    layout = whole.at(np.array([estimates.get(n, value) for n, value in zip(whole.names, whole.values)]))
    prediction = predict_closures(robot, layout, data, threads=threads)
    weights = scale * prediction.used
    rows = (weights[:, :, None] * prediction.jacobian).reshape(weights.size, layout.size)
    rows = np.concatenate([rows, pulls.rows(layout)[0]])
    moved = np.flatnonzero(free)[~at_bound]
    doubt[~at_bound] = lstsq(rows[:, moved], rows[:, held] * tolerance[held], rcond=None)[0]
    return doubt
