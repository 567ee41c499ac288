"""Unknown functions against effects that were found step by step: the likelier explanation counts."""

from types import SimpleNamespace

import numpy as np
import pytest

from exactarm.diagnose.posterior import steps_win
from exactarm.diagnose.search import log_prior_of_count
from exactarm.noise.estimate import log_likelihood_under, normal_noise

ROWS, NAME_PRIOR = 100, np.log(0.8 / 50)


@pytest.fixture
def residual():
    return 1e-4 * np.random.default_rng(90).standard_normal((ROWS, 3))


def steps(residual, columns):
    fit = lambda size: SimpleNamespace(layout=SimpleNamespace(size=size), residual=residual)
    return SimpleNamespace(fits=(fit(25), fit(25 + columns)), accepted=("one",))


def causes(residual, more_nats):
    """Whose unknown functions are likelier by `more_nats` than one effect of a single column that leaves
    `residual`."""
    noise = normal_noise(residual)
    price = 0.5 * np.log(3 * ROWS)
    score = log_likelihood_under(noise, residual) - price + log_prior_of_count(1) + NAME_PRIOR + more_nats
    return SimpleNamespace(noise=noise, score=score, name_prior=NAME_PRIOR, places=())


@pytest.mark.parametrize("more_nats, win", [(-1.0, True), (1.0, False)])
def test_the_likelier_explanation_counts(residual, more_nats, win):
    assert steps_win(causes(residual, more_nats), steps(residual, 1)) == win


def test_an_effect_pays_for_every_column(residual):
    unknown = causes(residual, -1.0)
    assert not steps_win(unknown, steps(residual, 2)) and steps_win(unknown, steps(0.99 * residual, 2))


def test_what_leaves_more_does_not_count(residual):
    assert not steps_win(causes(residual, -1.0), steps(1.01 * residual, 1))


@pytest.mark.parametrize("columns, left, win", [(81, 1.0, True), (1, 1.0, False), (81, 3.0, False)])
def test_a_curve_pays_for_its_columns_as_effects_do(residual, columns, left, win):
    """A curve of 81 columns that leaves the noise, beside an effect of five that leaves as much; the same of
    one column; and beside an effect that leaves three times as much. The score, of the last picture, knows no
    price of what stands."""
    curve = causes(residual, 1000.0)
    curve.places, curve.fits = ("curve",), steps(residual, columns).fits
    assert steps_win(curve, steps(left * residual, 5)) == win
