"""What the library has for one fit, and the joint fit of the causes taken from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exactarm.chain import Layout
from exactarm.diagnose.admissible import shown
from exactarm.diagnose.fitted import Fitted, rows_kept
from exactarm.diagnose.problem import Problem
from exactarm.effects import library
from exactarm.effects.base import Effect
from exactarm.noise.model import NoiseModel
from exactarm.noise.sharing import shared_covariance

_MOST_JUDGED = 5  # times; gross rows have pulled the last fit, and rows beside them out of place
_MOST_MOVES = 4  # of a step to a likelier place
_MOST_WIDTHS = 8  # of the priors of one effect's terms: steps of a fixed point


def candidates_for(problem: Problem, fitted: Fitted) -> list[Effect]:
    """Every effect of the library that this kind of data can show and that is not in the layout already."""
    taken = {effect.label for effect in fitted.layout.effects}
    found: list[Effect] = []
    for cls in library().values():
        if problem.shows(cls) and not cls.declared:
            candidates = cls.candidates(problem.robot, fitted.view)
            found += [e for e in candidates if e.repeatable or e.label not in taken]
    return shown(found, fitted.view)


def count_of(problem: Problem, fitted: Fitted) -> float:
    """Independent numbers in the residual: those of the data less the parameters fitted to them."""
    data = float(np.count_nonzero(fitted.whitened[: fitted.data_numbers]))
    return max(problem.correlation_factor(fitted) * data - fitted.spent, 1.0)


def refit(problem: Problem, declared: Layout, effects: list[Effect], last: Fitted, noise=None) -> Fitted:
    """The joint fit, started from the last one; effects of the record judge the rows by the last one, then by
    it, until they stay.

    noise: a noise model whose row weights the fit takes."""
    start, effects = _warm(declared, last), tuple(effects)
    known, fitted, kept = problem.knowing(last), last, None
    for _ in range(_MOST_JUDGED):
        effects = tuple(effect.renewed(fitted.view, kept is not None) for effect in effects)
        layout, before = start.joined(Layout.of(effects)), kept
        kept = rows_kept(layout, fitted.view)
        if before is not None and np.array_equal(kept, before):
            fitted = replace(fitted, layout=replace(fitted.layout, effects=(*start.effects, *effects)))
            break
        weight = kept * (1.0 if noise is None else np.sqrt(noise.weight))
        fitted = known.fit(layout, weight, last.sigma)
        start, effects = _warm(declared, fitted), fitted.layout.effects[len(declared.effects) :]
    for _ in range(_MOST_MOVES):
        moved = [effect.moved(fitted.view) for effect in fitted.layout.effects]
        if all(one.values == other.values for one, other in zip(moved, fitted.layout.effects)):
            break
        trial = known.fit(replace(fitted.layout, effects=tuple(moved)), weight, last.sigma)
        if trial.fit.cost >= fitted.fit.cost:
            break
        fitted = trial
    for _ in range(_MOST_WIDTHS):
        at = fitted.layout
        redrawn = tuple(effect.redrawn(fitted.fit.covariance[where, where]) if free.all() else effect
                        for effect, free, where in zip(at.effects, at.free, at.slices))
        if redrawn == at.effects:
            break
        fitted = known.fit(replace(at, effects=redrawn), weight, fitted.sigma)
    return fitted


def _warm(declared: Layout, last: Fitted) -> Layout:
    """The declared layout at the values of the last fit, whose first effects are the declared ones."""
    count = len(declared.effects)
    return Layout(last.layout.effects[:count], declared.free)


def known_beside(problem: Problem, fitted: Fitted, noise: NoiseModel, rows: np.ndarray | None) -> Fitted:
    """The fit with the covariance that noise shared by rows, and weights by a Student law, leave; rows (N,)
    bool: those that the noise was estimated from, None = all."""
    used = fitted.weight[fitted.weight > 0.0]
    held = noise.held_share if np.ptp(used) > 0.0 else 1.0
    if noise.wandering is None and noise.shared == 0.0 and noise.rounding is None:
        return replace(fitted, fit=fitted.fit.known_by(fitted.fit.covariance / held, fitted.fit.freedom))
    order = problem.order()
    if order is not None and rows is not None:  # a memory is counted in distances between the rows searched
        step = np.diff(np.sort(order[rows]))
        order = order / np.median(step[step > 0.0])
    columns = fitted.standard(fitted.jacobian).reshape(fitted.jacobian.shape)
    free = ~fitted.fit.at_bound
    covariance = np.zeros_like(fitted.fit.covariance)
    covariance[np.ix_(free, free)] = shared_covariance(columns[:, :, free], fitted.prior_rows[:, free], noise,
                                                       problem.groups(), order, problem.rounding()) / held
    return replace(fitted, fit=fitted.fit.known_by(covariance, fitted.fit.freedom))
