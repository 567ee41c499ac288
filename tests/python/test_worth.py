"""An effect is accepted only where it takes enough away from rows that it has not learnt from."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from exactarm.diagnose.cross_validation import CrossValidation, folds_of
from exactarm.diagnose.motion_problem import MotionProblem
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.worth import holds_elsewhere, is_worth, takes_enough

ROWS, GROUPS = 240, 40


class Cause:
    """One linear parameter with a response (N,) of its own."""

    def __init__(self, response, excludes=False):
        self.response, self.excludes = response, excludes

    def parameters(self):
        return (SimpleNamespace(fixed=False, search=(), prior=np.inf),)

    def excludes_rows(self):
        return self.excludes


def state_of(residual):
    """A fit of one declared parameter, a constant, that has left `residual` (N,) in units of its noise."""
    basis = np.full((ROWS, 1), ROWS**-0.5)
    free = residual - basis[:, 0] * (basis[:, 0] @ residual)
    return SimpleNamespace(whitened=residual, free_residual=free, basis=basis, data_numbers=ROWS,
                           cleared=lambda columns: columns - basis @ (basis.T @ columns),
                           residual=residual[:, None], columns=lambda cause: cause.response[:, None])


def problem_of(groups, least_share=0.02, stretches=None, least_elsewhere=0.0, rounding=0.0):
    return SimpleNamespace(groups=lambda: groups, groups_for=lambda response, lost: groups, seed=0,
                           at_one_place=lambda effect: False,
                           units=lambda folds: folds, numbers_to_explain=lambda response: response > 0.0,
                           least_share=least_share, stretches=lambda: stretches,
                           far_elsewhere=False, elsewhere=lambda fitted: fitted,
                           rounding_share=lambda fitted: rounding,
                           holds=lambda without, left: left.sum() < (1.0 - least_elsewhere) * without.sum())


def worth(residual, cause, **options):
    groups = np.repeat(np.arange(GROUPS), ROWS // GROUPS)
    fitted, problem, folds = state_of(residual), problem_of(groups, **options), folds_of(groups, 0)
    return is_worth(problem, fitted, [cause], CrossValidation.of(fitted, folds))


def drawn(seed):
    rng = np.random.default_rng(seed)
    return rng.normal(size=ROWS), rng.normal(size=ROWS)


@pytest.mark.parametrize("seed", range(5))
def test_what_acts_everywhere_is_worth_its_place(seed):
    noise, response = drawn(seed)
    assert worth(noise + response, Cause(response))


@pytest.mark.parametrize("seed", range(5))
def test_what_is_not_there_is_not_worth_its_place(seed):
    noise, response = drawn(seed)
    assert not worth(noise, Cause(response))


def test_what_is_surely_there_but_takes_too_little_is_not_worth_its_place():
    """It takes about half of the square sum away."""
    noise, response = drawn(1)
    assert worth(noise + response, Cause(response), least_share=0.3)
    assert not worth(noise + response, Cause(response), least_share=0.8)
    assert not worth(noise + response, Cause(response), rounding=0.8)


def test_what_one_group_alone_shows_against_the_others_is_not_worth_its_place():
    """A row that is wrong by itself: every group answers to the cause, one seems to have it."""
    noise, response = drawn(2)
    assert not worth(noise + 30.0 * (np.arange(ROWS) == 7), Cause(response + 0.3))


def test_what_says_that_rows_are_wrong_is_not_cross_validated():
    noise, response = drawn(3)
    assert worth(noise, Cause(response, excludes=True))


def test_what_helps_in_one_stretch_and_hurts_in_another_does_not_hold_elsewhere():
    noise, response = drawn(4)
    stretches = np.repeat([0, 1], ROWS // 2)
    turned = np.where(stretches == 0, 1.0, -1.0)
    problem = problem_of(np.arange(ROWS), stretches=stretches)
    assert holds_elsewhere(problem, state_of(noise + response), [Cause(response)])
    assert not holds_elsewhere(problem, state_of(noise + turned * response), [Cause(response)])


def test_an_effect_of_one_axis_takes_its_share_of_the_noise_of_that_axis():
    """A tenth of the square sum of one axis of six is a sixtieth of all; the first seed tried."""
    rng = np.random.default_rng(5)
    rows, axes, share = 1200, 6, 0.1
    response = np.zeros((rows, axes))
    response[:, 2] = rng.normal(size=rows)
    residual = rng.normal(size=(rows, axes)) + share**0.5 * response
    basis = np.full((rows * axes, 1), (rows * axes) ** -0.5)
    clear = lambda columns: columns - basis @ (basis.T @ columns)
    fitted = SimpleNamespace(whitened=residual.ravel(), basis=basis, data_numbers=residual.size,
                             free_residual=clear(residual.reshape(-1, 1))[:, 0], cleared=clear,
                             residual=residual)
    groups = np.repeat(np.arange(GROUPS), rows // GROUPS)
    parted = CrossValidation.of(fitted, folds_of(groups, 0))
    for explained, enough in (MotionProblem.numbers_to_explain, True), (Problem.numbers_to_explain, False):
        problem = problem_of(groups)
        problem.numbers_to_explain = partial(explained, problem)
        found = takes_enough(problem, fitted, response.reshape(-1, 1), np.array([np.inf]), parted, 0.02)
        assert found == enough
