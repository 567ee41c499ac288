"""Own share of an effect: what a fit without it, with the same priors, leaves on held-out rows."""

from types import SimpleNamespace as Plain

import numpy as np
import pytest

from exactarm.diagnose.held_out_evidence import freedom_of, log_density
from exactarm.diagnose.own_share import own_shares

RNG = np.random.default_rng(4)


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


def test_the_share_is_that_of_a_fit_without_the_effect():
    design, measured, fitted_rows, judged, priors = linear_model()
    values = refitted(design[fitted_rows], measured[fitted_rows], priors)
    others = refitted(design[fitted_rows, 1:], measured[fitted_rows], priors[:, 1:])
    left = measured[judged] - design[judged] @ values
    left_without = measured[judged] - design[judged, 1:] @ others
    expected = 1.0 - np.sum(left**2) / np.sum(left_without**2)
    parameters = [Plain(search=False)] * 121
    fitted = Plain(
        sigma=np.ones(1), design=np.concatenate([design[fitted_rows], priors]), data_numbers=40,
        residual=(measured[fitted_rows] - design[fitted_rows] @ values)[:, None], weight=np.ones(40),
        layout=Plain(effects=("small", "curve"), slices=(slice(0, 1), slice(1, 121)), size=121, values=values,
                     parameters=parameters))
    problem = Plain(held_out_picture=lambda fitted: (left[:, None], design[judged, None, :]), held_out=left,
                    correlation_factor=lambda fitted: 0.5)
    small, _curve = own_shares(problem, fitted, 0)
    assert np.isclose(small.share, expected, atol=1e-6)
    freedom = freedom_of(np.abs(fitted.residual[:, 0]), 1)
    gain = 0.5 * (log_density(np.abs(left), 1, freedom) - log_density(np.abs(left_without), 1, freedom))
    assert small.gain == pytest.approx(gain, rel=1e-4) and gain > 1.0
    assert 0.0 < expected < 0.9
