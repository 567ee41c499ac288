"""One fit for every kind: priors, weights and bounds count, intervals hold the truth, an unsettled noise is
said."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.effects.base import Parameter
from exactarm.effects.parameter_id import ParameterId
from exactarm.identify import layout_fit
from exactarm.identify.layout_fit import fit_layout
from exactarm.numerics.regression import Evaluation, least_squares

PRIOR = 0.3


@dataclass(frozen=True)
class Line:
    """What a layout asks of an effect, outside the library: four numbers, the second regularised, the fourth
    not negative."""

    values: tuple[float, ...]
    drawn_to_declared: ClassVar[bool] = False

    def with_values(self, values):
        return replace(self, values=tuple(values))

    def parameter_id(self, parameter):
        return ParameterId(parameter.name)

    parameter_label = parameter_id

    def parameters(self):
        return (Parameter("one", 1.0), Parameter("two", 1.0, prior=PRIOR), Parameter("three", 2.0),
                Parameter("four", 1.0, lower=0.0))


@dataclass(frozen=True)
class DrawnLine(Line):
    drawn_to_declared: ClassVar[bool] = True


def linear(columns, measured):
    """columns (N, m, 4), measured (N, m)"""
    def predict(layout, with_jacobian):
        return measured - columns @ np.array(layout.effects[0].values), columns[:, :, layout.free[0]]

    return predict


def layout(values=(0.0, 0.0, 0.0, 0.0), effect=Line):
    return Layout.of((effect(values),))


def case(rng, rows=60, components=2, sigma=(0.1, 2.0), truth=(1.0, 0.2, -2.0, 0.5)):
    columns = rng.normal(size=(rows, components, 4))
    return columns, columns @ np.array(truth) + rng.normal(size=(rows, components)) * sigma


def test_components_are_weighed_by_their_own_noise():
    found = fit_layout(linear(*case(np.random.default_rng(1), 4000)), layout(), np.ones(4000),
                       alike=np.arange(2))
    assert found.fit.converged
    np.testing.assert_allclose(found.sigma, [0.1, 2.0], rtol=0.05)
    np.testing.assert_allclose(found.fit.x, [1.0, 0.2, -2.0, 0.5], atol=0.01)


def test_the_last_round_is_brought_to_the_end():
    """The noise is sought along the way, in a curved model that steps approach little by little."""
    columns, measured = case(np.random.default_rng(9), sigma=(0.5, 2.0))

    def predict(at, with_jacobian):
        straight = columns @ np.array(at.effects[0].values)
        slope = (1.0 + 0.6 * straight)[:, :, None] * columns[:, :, at.free[0]]
        return measured - straight - 0.3 * straight**2, slope

    found = fit_layout(predict, layout(), np.ones(60), alike=np.arange(2), tolerance=1e-12)
    assert found.fit.converged and 0.0 < found.fit.offset < 1e-11


@pytest.mark.parametrize(("rms", "half"), [(6.0**0.5, 0.45), (8.0**0.5, 0.45)])
def test_an_error_that_two_components_can_have_settles(rms, half):
    """One parameter moves it from the first to the second: the noise follows in steps that hardly fall."""
    rng = np.random.default_rng(12)
    columns, noise = np.zeros((4000, 2, 4)), rng.standard_normal((4000, 2))
    wave = rms * np.sqrt(2.0) * np.sin(np.arange(4000))
    columns[:, 0, 0], columns[:, 1, 0] = wave, -wave
    measured = noise + np.column_stack([wave, 0.0 * wave])
    found = fit_layout(linear(columns, measured), layout((half, 0.0, 0.0, 0.0)), np.ones(4000),
                       alike=np.arange(2))
    assert found.fit.converged
    left = measured - columns @ found.fit.x
    np.testing.assert_allclose(found.sigma, np.sqrt(np.mean(left**2, axis=0)), rtol=0.02)
    again = fit_layout(linear(columns, measured), found.layout, np.ones(4000), alike=np.arange(2),
                       sigma=found.sigma)
    np.testing.assert_allclose(again.sigma, found.sigma, rtol=0.03)


@pytest.mark.parametrize(("effect", "drawing", "centre", "spread"), [
    (Line, {}, [0.0] * 4, [np.inf, PRIOR, np.inf, np.inf]), (DrawnLine, {}, [0.5] * 4, [1.0, 1.0, 2.0, 1.0]),
    (Line, {"one": (0.7, 0.2)}, [0.7, 0.0, 0.0, 0.0], [0.2, PRIOR, np.inf, np.inf]),
])
def test_priors_are_pseudo_observations(effect, drawing, centre, spread):
    columns, measured = case(np.random.default_rng(2), 12)
    found = fit_layout(linear(columns, measured), layout((0.5,) * 4, effect), np.ones(12), alike=np.arange(2),
                       drawing=drawing)
    scaled, known = columns / found.sigma[:, None], np.diag(np.array(spread) ** -2.0)
    normal = np.einsum("naj,nak->jk", scaled, scaled) + known
    right = np.einsum("naj,na->j", scaled, measured / found.sigma) + known @ centre
    np.testing.assert_allclose(found.fit.x, np.linalg.solve(normal, right), rtol=1e-2)


@pytest.mark.parametrize("rounding", [1e-15, 1e-19])
def test_what_shows_by_rounding_only_stays_where_it_is(rounding):
    """The moment of a payload along the axis of a SCARA's flange, which gravity never bends: it went to
    1e6 kg m, and the fit to nowhere."""
    rng = np.random.default_rng(1)
    columns, measured = case(rng, 4000)
    columns[:, :, 2] *= rounding
    measured = columns @ [1.0, 0.2, 0.0, 0.5] + rng.normal(size=measured.shape) * (0.1, 2.0)
    found = fit_layout(linear(columns, measured), layout(), np.ones(4000), alike=np.arange(2))
    assert found.fit.converged and found.fit.x[2] == pytest.approx(0.0, abs=1e-9)
    assert found.fit.covariance[2, 2] == pytest.approx(2.0**2)
    np.testing.assert_allclose(found.fit.x[[0, 1, 3]], [1.0, 0.2, 0.5], atol=0.1)


def test_rows_without_weight_have_no_say():
    columns, measured = case(np.random.default_rng(3))
    weight = np.where(np.arange(60) < 40, 1.0, 0.0)
    spoilt = measured + (1.0 - weight)[:, None] * 1e6
    with_them = fit_layout(linear(columns, spoilt), layout(), weight, alike=np.arange(2))
    without = fit_layout(linear(columns[:40], measured[:40]), layout(), np.ones(40), alike=np.arange(2))
    assert np.array_equal(with_them.fit.x, without.fit.x) and with_them.fit.freedom == without.fit.freedom


def test_what_a_bound_holds_is_said_and_has_no_interval():
    columns, measured = case(np.random.default_rng(4), truth=(1.0, 0.2, -2.0, -0.5))
    found = fit_layout(linear(columns, measured), layout((0.0, 0.0, 0.0, 1.0)), np.ones(60),
                       alike=np.arange(2))
    assert found.fit.at_bound.tolist() == [False, False, False, True] and found.layout.values[3] == 0.0
    assert found.fit.covariance[3, 3] == 0.0


@pytest.mark.slow
def test_intervals_hold_the_truth_in_19_of_20_repeats():
    """300 data sets of 3 parameters (the one with a prior drawn from it): 95 % within 3 standard errors."""
    rng, inside = np.random.default_rng(5), []
    for _ in range(300):
        truth = np.array([1.0, rng.normal(0.0, PRIOR), -2.0, 5.0])
        columns, measured = case(rng, 25, truth=truth)
        low, high = fit_layout(linear(columns, measured), layout(), np.ones(25),
                               alike=np.arange(2)).fit.interval().T
        inside.append((low < truth) & (truth < high))
    assert abs(np.mean(inside) - 0.95) < 3.0 * np.sqrt(0.95 * 0.05 / 300 / 4)


def test_noise_that_does_not_settle_is_no_convergence(monkeypatch):
    monkeypatch.setattr(layout_fit, "_ROUNDS", 1)
    found = fit_layout(linear(*case(np.random.default_rng(6))), layout(), np.ones(60), np.full(2, 1e3),
                       alike=np.arange(2))
    assert not found.fit.converged and "did not settle" in found.fit.reason


def test_the_same_arguments_give_the_same_bits():
    columns, measured = case(np.random.default_rng(7))
    predict = linear(columns, measured)
    first = fit_layout(predict, layout(), np.ones(60), alike=np.arange(2))
    fit_layout(predict, replace(layout(), free=(np.array([True, False, False, False]),)), np.ones(60),
               alike=np.arange(2))
    again = fit_layout(predict, layout(), np.ones(60), alike=np.arange(2))
    assert np.array_equal(first.fit.x, again.fit.x) and np.array_equal(first.sigma, again.sigma)


@pytest.mark.parametrize("repeated", [False, True])
def test_what_the_rows_have_paid_is_their_leverage(repeated):
    """Of one variance: by the parameters' covariance, the same as by the product of all columns."""
    rng = np.random.default_rng(5)
    columns, measured = case(rng, components=3, sigma=(0.2, 0.2, 0.2))
    if repeated:
        columns[:, :, 2] = columns[:, :, 0]
    weight, alike, sigma = np.ones(60), np.zeros(3, int), np.full(3, 0.2)
    fit = fit_layout(linear(columns, measured), layout(), weight, alike=alike).fit
    pull, _ = layout_fit.pulls_of(layout())
    assert np.any(pull)
    again = least_squares(
        lambda x, _: Evaluation(np.append(measured - columns @ x, pull @ -x),
                                np.append(columns.reshape(-1, 4), pull, 0)),
        fit.x, weights=np.append(np.full(180, 1 / 0.2), 1.0), bounds=(fit.bounds[0], fit.bounds[1]))
    last = layout_fit._Point(None, columns.reshape(-1, 4), weight, alike, pull)
    spent = layout_fit._spent(last, sigma, again)
    free = ~again.at_bound
    rows = np.append(columns.reshape(-1, 4) / 0.2, pull, 0)[:, free]
    leverage = np.trace((rows @ np.linalg.pinv(rows))[:180, :180])
    assert spent == pytest.approx(np.full(3, leverage / 3), rel=1e-9)


def test_normal_equations_follow_from_the_parts_of_each_variance():
    rng = np.random.default_rng(6)
    columns, weight, alike = rng.normal(size=(60, 3, 4)), rng.uniform(0.5, 1.0, 60), np.array([0, 1, 0])
    sigma, pull = np.array([0.2, 3e-5, 0.2]), np.diag([0.0, 2.0, 0.0, 0.1])[[1, 3]]
    point = layout_fit._Point(None, np.append(columns.reshape(-1, 4), pull, 0), weight, alike, pull)
    rows = np.append((weight[:, None, None] * columns / sigma[:, None]).reshape(-1, 4), pull, 0)
    assert point.normal(sigma) == pytest.approx(rows.T @ rows, rel=1e-12)
