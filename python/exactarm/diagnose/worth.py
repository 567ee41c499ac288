"""Whether effects are worth their place: what they take away on rows that they have not learnt from.

Cross-validated over whole poses or runs in the linear picture: the fall of the square sum over the problem's
units must be large enough and certain, by any of four measures, and must hold in stretches of the data left
out whole.
"""

from __future__ import annotations

import numpy as np

from exactarm.diagnose.cross_validation import CrossValidation, folds_of
from exactarm.diagnose.decisions import RESPONDING, RIDGE
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.scan import linear_columns, prior_of
from exactarm.effects.base import Effect
from exactarm.numerics.orthonormal import orthonormal

_FOLD_CERTAINTY = 2.5  # the mean fall of the folds beside its standard error
# of -2 log density: a right model is outdone by a wrong one by c in fewer than exp(-c / 2) of cases (Ville)
CHANCE_AGAINST = _FOLD_CERTAINTY**2  # 4 %
_LEAST_FALLING = 8  # folds
_LEAST_SHOWING = 3  # units to judge by


def is_worth(problem: Problem, fitted: Fitted, effects: list[Effect], parted: CrossValidation) -> bool:
    """Whether the effects take enough of the held-out square sum away, and surely so over the problem's
    units; parted: the fit by folds."""
    if any(effect.excludes_rows() for effect in effects):
        return True
    parameters = [p for effect in effects for p in effect.parameters()]
    free = np.array([not p.fixed for p in parameters], bool)  # searched orders too
    columns = np.concatenate([fitted.columns(effect) for effect in effects], axis=1)[:, free]
    prior = np.array([p.prior for p in parameters])[free]
    enough = takes_enough(problem, fitted, columns, prior, parted, problem.least_share)
    return enough and holds_elsewhere(problem, fitted, effects)


def takes_enough(problem: Problem, fitted: Fitted, columns: np.ndarray, prior: np.ndarray,
                 parted: CrossValidation, least_share: float) -> bool:
    """Whether columns (R, k), with standard deviations (k,) of their coefficients, take that share of the
    held-out square sum away, and surely so."""
    alone = orthonormal(fitted.cleared(columns))
    lost = 1.0 - parted.told_by_others(alone)[parted.folds]
    groups = problem.groups_for(by_row(alone, fitted), lost)
    if not np.array_equal(groups, problem.groups()):
        parted = CrossValidation.of(fitted, folds_of(groups, problem.seed))
    units, without = problem.units(parted.folds), parted.numbers_squared()
    falls = np.bincount(units, weights=np.sum(without - parted.numbers_squared(columns, prior), axis=1))
    fall = falls[_showing(fitted, columns, units)]
    certain = _as_promised(falls, _promised(fitted, columns, prior, units))
    certain = certain or fall.mean() > _FOLD_CERTAINTY * fall.std(ddof=1) / np.sqrt(len(fall))
    # What shows in bursts (a resonance that is passed) falls very unevenly, but it falls everywhere.
    certain = certain or (len(fall) >= _LEAST_FALLING and np.all(fall > 0.0))
    # A fall g of a square sum of white noise scatters by 2 sqrt(g): beyond 4 z^2 every unit is sure of it.
    certain = certain or (len(fall) >= _LEAST_SHOWING and np.all(fall > 4.0 * _FOLD_CERTAINTY**2))
    least = max(least_share, problem.rounding_share(fitted))
    to_explain = without[problem.numbers_to_explain(by_number(columns, fitted))]
    return bool(certain and fall.sum() > least * to_explain.sum())


def holds_elsewhere(problem: Problem, fitted: Fitted, effects: list[Effect]) -> bool:
    """Whether what is learnt without one large stretch of the data makes it no worse: nearness in time proves
    nothing there. What one session alone tells of is not asked for elsewhere."""
    stretches = problem.stretches()
    if stretches is None or any(effect.excludes_rows() or problem.at_one_place(effect) for effect in effects):
        return True
    fitted = problem.elsewhere(fitted)
    columns = np.concatenate([linear_columns(fitted, effect) for effect in effects], axis=1)
    prior = np.concatenate([prior_of(effect) for effect in effects])
    parted = CrossValidation.of(fitted, np.unique(stretches, return_inverse=True)[1])
    without, left = parted.squares(), parted.squares(columns, prior)
    if not problem.far_elsewhere:
        return problem.holds(without, left)
    # Errors that grow by more than the others cannot know, in white noise, are those of a wrong effect.
    # u = |D d|^2 of it is theirs on average, with a variance of up to 2 u^2, and 4 u beside noise.
    unknown = parted.unknown(columns, prior) - parted.unknown()
    chance = _FOLD_CERTAINTY * np.sqrt(4.0 * np.maximum(unknown, 0.0) + 2.0 * unknown**2)
    allowed = np.maximum(problem.least_elsewhere * without, np.maximum(chance, CHANCE_AGAINST))
    right = bool(np.all(left - without - unknown < allowed))
    return right and problem.holds(parted.deviances(), parted.deviances(columns, prior))


def _promised(fitted: Fitted, columns: np.ndarray, prior: np.ndarray, units: np.ndarray) -> np.ndarray:
    """(U,) by how much the square sum of each unit should fall, if the effect is the same over all of
    them."""
    left = fitted.cleared(columns)
    penalty = np.diag(1.0 / prior**2) + RIDGE * np.diag(np.sum(left**2, axis=0) + np.finfo(float).tiny)
    change = left @ np.linalg.solve(left.T @ left + penalty, left.T @ fitted.free_residual)
    return np.bincount(units, weights=by_row(change[:, None], fitted))


def _as_promised(fall: np.ndarray, promised: np.ndarray) -> bool:
    """Whether the units fall in proportion to what each shows of the effect; a few may show nearly all of it.

    fall = b promised + e, the variance of e in proportion to promised (a ratio estimate, Cochran 1977): is b
    surely above zero?
    """
    shown = promised > RESPONDING * promised.max()
    if shown.sum() < _LEAST_SHOWING:
        return False
    fall, promised = fall[shown], promised[shown]
    slope = fall.sum() / promised.sum()
    scatter = np.sum((fall - slope * promised) ** 2 / promised) / (len(fall) - 1)
    return bool(slope > _FOLD_CERTAINTY * np.sqrt(scatter / promised.sum()))


def _showing(fitted: Fitted, columns: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Which units (U,) bool respond to the columns at all."""
    response = np.bincount(units, weights=by_row(columns, fitted))
    showing = response > RESPONDING * response.max()
    return showing if showing.sum() >= _LEAST_SHOWING else np.ones(len(response), bool)


def by_row(columns: np.ndarray, fitted: Fitted) -> np.ndarray:
    """(N,) square sums of whitened columns (R, k) by row of the data."""
    return np.sum(by_number(columns, fitted), axis=1)


def by_number(columns: np.ndarray, fitted: Fitted) -> np.ndarray:
    """(N, m) square sums of whitened columns (R, k) by number of the data."""
    return np.sum(columns[: fitted.data_numbers].reshape(*fitted.residual.shape, -1) ** 2, axis=2)
