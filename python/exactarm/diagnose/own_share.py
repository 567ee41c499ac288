"""Own share of an effect: of the held-out square sum of the model without it, what it takes away, with all
others in the model.

    share = 1 - S / S_without;  without it, the other parameters are fitted anew (linear picture, with their
    priors: curves that the data hold in check only by them would run away on rows that were not fitted), or,
    where it leaves rows out, with these rows.

Its gain is the log of the density of the held-out rows with it, less that without it, and shown is how much
of it they show (held_out_evidence.py), with the variance of that by the noise of both sets of rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from exactarm.diagnose.decisions import RIDGE
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.held_out_evidence import freedom_of, log_density, spread_of
from exactarm.diagnose.problem import Problem


@dataclass(frozen=True)
class Own:
    """Of one effect: share of the held-out square sum, how many times larger the judged error is without it
    (RMS, in its own unit: axes and orientations have another noise each), what it gains there (nats; 0 where
    no row is held out), how much of it is shown there, and the variance of that."""

    share: float
    without: float
    gain: float
    shown: float
    variance: float


def own_shares(problem: Problem, fitted: Fitted, first: int) -> tuple[Own, ...] | None:
    """Of every effect of the layout from the place `first` on; None where the kind of data has no target."""
    judged = problem.held_out_picture(fitted)
    if judged is None:
        return None
    residual, jacobian = judged
    scale = fitted.sigma
    numbers, judged_numbers = residual.shape[1], problem.numbers_of_error
    of_error = slice(judged_numbers if judged_numbers > 1 else None)
    rms = lambda left: float(np.sqrt(np.mean(left[:, of_error] ** 2)))
    error = lambda left: np.linalg.norm(left / scale, axis=1)
    freedom = freedom_of(error(fitted.residual[fitted.weight > 0.0]), numbers)
    worth = problem.correlation_factor(fitted) if len(problem.held_out) else 0.0
    density = lambda left: log_density(error(left), numbers, freedom)
    design = fitted.design
    norm = np.linalg.norm(design, axis=0)
    norm[norm == 0.0] = 1.0
    gram = design.T @ design / np.outer(norm, norm) + RIDGE * np.eye(len(norm))
    found = []
    for place in range(first, len(fitted.layout.effects)):
        out = _rows_out(fitted, place)
        step = (_without_values(fitted, place, design, gram, norm) if out is None
                else _with_rows(fitted, out, gram, norm))
        without = residual + jacobian @ step
        square, other = (float(np.sum(error(left) ** 2)) for left in (residual, without))
        gain = float(worth * (density(residual) - density(without)))
        shown = (1.0, np.inf) if out is not None else _shown(fitted, residual, jacobian, jacobian @ step,
                                                             freedom, worth)
        found.append(Own(1.0 - square / max(other, 1e-300), rms(without) / max(rms(residual), 1e-300), gain,
                         *shown))
    return tuple(found)


def _without_values(fitted: Fitted, place: int, design: np.ndarray, gram: np.ndarray,
                    norm: np.ndarray) -> np.ndarray:
    """(P,) by which the parameters fall where one effect goes and the others are fitted anew."""
    where, rows = fitted.layout.slices[place], fitted.data_numbers
    linear = np.array([not p.search for p in fitted.layout.parameters[where]], bool)
    values = np.where(linear, fitted.layout.values[where], 0.0)
    rest = np.delete(np.arange(fitted.layout.size), np.arange(where.start, where.stop))
    onto = (design[:rows].T @ (design[:rows, where] @ values))[rest] / norm[rest]
    step = np.zeros(len(norm))
    step[where] = values
    step[rest] = -linalg.solve(gram[np.ix_(rest, rest)], onto, assume_a="pos") / norm[rest]
    return step


def _rows_out(fitted: Fitted, place: int) -> np.ndarray | None:
    """(N,) bool: rows that one effect leaves out; None where it is not of that sort."""
    effect = fitted.layout.effects[place]
    return ~effect.keep(fitted.view) if effect.excludes_rows() else None


def _with_rows(fitted: Fitted, out: np.ndarray, gram: np.ndarray, norm: np.ndarray) -> np.ndarray:
    """(P,) by which the parameters fall where rows that were left out count again."""
    columns = (fitted.jacobian[out] / fitted.sigma[:, None]).reshape(-1, len(norm)) / norm
    left = (fitted.residual[out] / fitted.sigma).ravel()
    return -linalg.solve(gram + columns.T @ columns, columns.T @ left, assume_a="pos") / norm


def _shown(fitted: Fitted, residual: np.ndarray, jacobian: np.ndarray, change: np.ndarray, freedom: float,
           worth: float) -> tuple[float, float]:
    """How much of a change (K, m) that an effect makes the rows show that are left with residual (K, m), and
    its variance."""
    scale, numbers = fitted.sigma, residual.shape[1]
    spread, weight = spread_of(np.linalg.norm(residual / scale, axis=1), numbers, freedom)
    weighted = change * weight[:, None] / scale**2
    square = float(np.sum(weighted * change))
    if square <= 0.0 or worth <= 0.0:
        return 1.0, np.inf
    onto = np.einsum("nap,na->p", jacobian, weighted) / square
    return (1.0 + float(np.sum(weighted * residual)) / square,
            spread / (worth * square) + float(onto @ fitted.fit.covariance @ onto))
