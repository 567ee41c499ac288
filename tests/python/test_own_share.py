"""Own share of an effect: what a fit without it, with the same priors, leaves on held-out rows."""

from types import SimpleNamespace as Plain

import numpy as np
import pytest

from exactarm.diagnose.held_out_evidence import freedom_of, log_density
from exactarm.diagnose.own_share import own_shares

RNG = np.random.default_rng(4)
MOVES = Plain(excludes_rows=lambda: False)


def linear_model(rows=40, held=30, prior=30.0):
    """A small effect of one number beside a curve of more numbers than the rows hold without its prior."""
    signal = RNG.uniform(0.0, 1.0, rows + held)
    orders = np.arange(1, 61)
    curve = np.concatenate([np.cos(np.outer(signal, orders)), np.sin(np.outer(signal, orders))], axis=1)
    design = np.column_stack([signal**2, curve])
    truth = np.concatenate([[4.0], RNG.normal(size=120) / prior])
    measured = design @ truth + RNG.normal(size=rows + held)
    fitted, judged = slice(0, rows), slice(rows, None)
    priors = np.zeros((120, 121))
    priors[:, 1:] = prior * np.eye(120)
    return design, measured, fitted, judged, priors


def refitted(design, measured, priors):
    stacked = np.concatenate([design, priors])
    return np.linalg.lstsq(stacked, np.concatenate([measured, np.zeros(len(priors))]), rcond=None)[0]


def picture(model):
    """(problem, fitted) of a linear model at its estimate, and what it leaves on the held-out rows."""
    design, measured, fitted_rows, judged, priors = model
    values = refitted(design[fitted_rows], measured[fitted_rows], priors)
    left = measured[judged] - design[judged] @ values
    whole = np.concatenate([design[fitted_rows], priors])
    size = design.shape[1] - 1
    fitted = Plain(
        sigma=np.ones(1), design=whole, data_numbers=len(measured[fitted_rows]),
        residual=(measured[fitted_rows] - design[fitted_rows] @ values)[:, None],
        weight=np.ones(len(measured[fitted_rows])), fit=Plain(covariance=np.linalg.inv(whole.T @ whole)),
        layout=Plain(effects=(MOVES, MOVES), slices=(slice(0, 1), slice(1, size + 1)), size=size + 1,
                     values=values, parameters=[Plain(search=False)] * (size + 1)))
    problem = Plain(held_out_picture=lambda fitted: (left[:, None], design[judged, None, :]), held_out=left,
                    correlation_factor=lambda fitted: 0.5, numbers_of_error=1)
    return problem, fitted, left


def test_the_share_is_that_of_a_fit_without_the_effect():
    design, measured, fitted_rows, judged, priors = model = linear_model()
    others = refitted(design[fitted_rows, 1:], measured[fitted_rows], priors[:, 1:])
    problem, fitted, left = picture(model)
    left_without = measured[judged] - design[judged, 1:] @ others
    expected = 1.0 - np.sum(left**2) / np.sum(left_without**2)
    small, _curve = own_shares(problem, fitted, 0)
    assert np.isclose(small.share, expected, atol=1e-6)
    freedom = freedom_of(np.abs(fitted.residual[:, 0]), 1)
    gain = 0.5 * (log_density(np.abs(left), 1, freedom) - log_density(np.abs(left_without), 1, freedom))
    assert small.gain == pytest.approx(gain, rel=1e-4) and gain > 1.0
    assert 0.0 < expected < 0.9
    assert small.without == pytest.approx((1.0 - expected) ** -0.5, rel=1e-6)


def test_the_error_without_an_effect_is_in_its_own_unit():
    """An effect on an axis of little noise beside one of a hundred times as much: it takes most of the square
    sum in units of the noise, and next to nothing of an error in Nm."""
    scale, design = np.array([1.0, 100.0]), RNG.normal(size=(200, 2, 1)) * [[[1.0], [0.0]]]
    measured = 3.0 * design[:, :, 0] + scale * RNG.normal(size=(200, 2))
    value = float(np.sum(design[:100, :, 0] * measured[:100]) / np.sum(design[:100] ** 2))
    left = measured - value * design[:, :, 0]
    whole = (design[:100] / scale[:, None]).reshape(200, 1)
    fitted = Plain(sigma=scale, design=whole, data_numbers=200, residual=left[:100], weight=np.ones(100),
                   fit=Plain(covariance=np.linalg.inv(whole.T @ whole)),
                   layout=Plain(effects=(MOVES,), slices=(slice(0, 1),), size=1, values=np.array([value]),
                                parameters=[Plain(search=False)]))
    problem = Plain(held_out_picture=lambda fitted: (left[100:], design[100:]), held_out=left[100:],
                    correlation_factor=lambda fitted: 1.0, numbers_of_error=1)
    (small,) = own_shares(problem, fitted, 0)
    without = np.sqrt(np.mean(measured[100:] ** 2) / np.mean(left[100:] ** 2))
    assert small.without == pytest.approx(without, rel=1e-9)
    assert small.share > 0.7 and small.without < 1.01


@pytest.mark.parametrize("elsewhere, shown", [(1.0, 1.0), (0.0, 0.0), (0.5, 0.5)])
def test_held_out_rows_show_as_much_of_an_effect_as_they_have(elsewhere, shown):
    design, measured, fitted_rows, judged, priors = linear_model(rows=400, held=300)
    both, others = (refitted(design[fitted_rows, k:], measured[fitted_rows], priors[:, k:]) for k in (0, 1))
    measured[judged] = elsewhere * (design[judged] @ both) + RNG.normal(size=300)
    measured[judged] += (1.0 - elsewhere) * (design[judged, 1:] @ others)
    problem, fitted, _ = picture((design, measured, fitted_rows, judged, priors))
    small, _curve = own_shares(problem, fitted, 0)
    assert abs(small.shown - shown) < 3.0 * np.sqrt(small.variance) and 0.0 < small.variance < 0.2


@pytest.mark.parametrize("wrong", [0.0, 40.0])
def test_rows_that_are_left_out_are_worth_what_the_fit_with_them_lacks_elsewhere(wrong):
    """One of 8 rows, which is right or wrong."""
    rng, out = np.random.default_rng(2), np.arange(8) == 7
    design = rng.normal(size=(208, 1, 3))
    design[7] *= 4.0
    measured = design[:, 0] @ np.ones(3) + rng.normal(size=208)
    measured[7] += wrong
    at = lambda kept: np.linalg.lstsq(design[:8][kept, 0], measured[:8][kept], rcond=None)[0]
    values, left = at(~out), lambda x: measured - design[:, 0] @ x
    fitted = Plain(sigma=np.ones(1), design=design[:8][~out, 0], data_numbers=7, weight=1.0 - out,
                   residual=left(values)[:8, None], jacobian=design[:8], view=None,
                   layout=Plain(effects=(Plain(excludes_rows=lambda: True, keep=lambda view: ~out),)))
    problem = Plain(held_out_picture=lambda fitted: (left(values)[8:, None], design[8:]),
                    held_out=measured[8:], correlation_factor=lambda fitted: 1.0, numbers_of_error=1)
    (rows,) = own_shares(problem, fitted, 0)
    taken, others = (np.sum(left(x)[8:] ** 2) for x in (values, at(np.ones(8, bool))))
    assert rows.share == pytest.approx(1.0 - taken / others, rel=1e-6)
    assert rows.shown == 1.0 and rows.variance == np.inf
    assert (rows.gain > 3.0) == (wrong > 0.0)
