"""Weighted least squares: against closed forms, and intervals that hold the truth as often as they say."""

import numpy as np
import pytest
from scipy import optimize, stats

from exactarm.chain import predict_poses
from exactarm.data.dataset import read_dataset
from exactarm.files.examples import example
from exactarm.identify.calibrate import identifiable_layout
from exactarm.identify.declared import frames_layout, geometry_layout
from exactarm.numerics.regression import HUBER, Evaluation, bounded_interval, least_squares
from exactarm.robot_file import load_robot


def linear(columns, measured):
    """The problem y = columns x in the form that the search asks for."""
    return lambda x, with_jacobian: Evaluation(measured - columns @ x, columns if with_jacobian else None)


def exponential(time, measured):
    """y = x0 exp(-x1 t)."""

    def evaluate(x, with_jacobian):
        decay = np.exp(-x[1] * time)
        jacobian = np.stack([decay, -x[0] * time * decay], axis=1)
        return Evaluation(measured - x[0] * decay, jacobian if with_jacobian else None)

    return evaluate


def test_weighted_linear_fit_is_the_closed_form():
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(60, 4)) * [1.0, 1e-4, 1e5, 1.0]
    weights = rng.uniform(0.2, 5.0, 60)
    measured = columns @ [2.0, -3e3, 4e-5, 0.5] + rng.normal(size=60) / weights
    fit = least_squares(linear(columns, measured), np.zeros(4), weights=weights)
    weighted = weights[:, None] * columns
    scale = 1.0 / np.linalg.norm(weighted, axis=0)
    expected, square, *_ = np.linalg.lstsq(weighted * scale, weights * measured, rcond=None)
    assert fit.converged and fit.freedom == 56 and not fit.at_bound.any()
    np.testing.assert_allclose(fit.x, expected * scale, rtol=1e-9)
    np.testing.assert_allclose(fit.sigma**2, square[0] / 56, rtol=1e-9)
    np.testing.assert_allclose(fit.cost, 0.5 * square[0], rtol=1e-9)
    inverse = np.linalg.inv((weighted * scale).T @ (weighted * scale)) * np.outer(scale, scale)
    np.testing.assert_allclose(fit.covariance, fit.sigma**2 * inverse, rtol=1e-8)


def test_zero_weight_leaves_a_row_out():
    rng = np.random.default_rng(2)
    columns, weights = rng.normal(size=(30, 2)), np.ones(30)
    measured = columns @ [1.0, 2.0] + 0.01 * rng.normal(size=30)
    measured[7], weights[7] = 1e6, 0.0
    fit = least_squares(linear(columns, measured), np.zeros(2), weights=weights)
    rest = np.arange(30) != 7
    np.testing.assert_allclose(fit.x, np.linalg.lstsq(columns[rest], measured[rest], rcond=None)[0],
                               rtol=1e-9)
    assert fit.freedom == 27


def test_curved_problem_converges_from_afar():
    time = np.linspace(0.0, 4.0, 40)
    fit = least_squares(exponential(time, 3.0 * np.exp(-1.7 * time)), np.array([1.0, 0.1]))
    assert fit.converged
    np.testing.assert_allclose(fit.x, [3.0, 1.7], rtol=1e-8)


@pytest.mark.parametrize(("series", "half_m", "most"), [
    ("C", 0.15, 25), pytest.param("B", 0.4, 40, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_real_poses_of_a_narrow_cube_converge_in_tens_of_iterations(series, half_m, most):
    """Lengths and frames trade against each other there along a curved valley: plain Gauss-Newton with
    damping took 245 iterations for the first and 1,776 for the second; scipy's `lm` takes 103 and 144
    evaluations for the same square sum."""
    robot = load_robot("ur10")
    data = read_dataset([example(f"ur10/series_{series}")], robot)
    data = data.select(data.session == data.session[0])
    near = [np.all(np.abs(data.position - point) < half_m, axis=1) for point in data.position]
    data = data.select(near[int(np.argmax([mask.sum() for mask in near]))])
    layout = frames_layout(robot, data, orientation=False)[0].joined(geometry_layout(robot))
    layout = identifiable_layout(robot, layout, data, False)[0]

    def evaluate(x, with_jacobian):
        prediction = predict_poses(robot, layout.at(x), data, tangents=with_jacobian)
        residual = prediction.residual().ravel()
        return Evaluation(residual, prediction.jacobian[:, :3].reshape(residual.size, -1)
                          if with_jacobian else None)

    fit = least_squares(evaluate, layout.values)
    assert fit.converged and fit.iterations <= most and fit.offset < 1e-9
    peer = optimize.least_squares(
        lambda x: evaluate(x, False).residual, fit.x, lambda x: -evaluate(x, True).jacobian, x_scale="jac",
        method="lm"
    )
    assert fit.cost <= peer.cost * (1.0 + 1e-8)


def test_bounded_fits_are_as_good_as_those_of_scipy():
    """Twenty curved problems with a bound on each parameter, some of which bind."""
    rng, bound = np.random.default_rng(11), 0
    time = np.linspace(0.0, 4.0, 40)
    for _ in range(20):
        truth, start = rng.uniform(0.5, 3.0, 2), rng.uniform(0.5, 3.0, 2)
        evaluate = exponential(time, truth[0] * np.exp(-truth[1] * time) + 0.01 * rng.normal(size=40))
        lower, upper = np.array([0.0, 0.0]), rng.uniform(1.0, 3.0, 2)
        start = np.minimum(start, upper)
        fit = least_squares(evaluate, start, bounds=(lower, upper))
        peer = optimize.least_squares(
            lambda x: evaluate(x, False).residual, 0.99 * start, lambda x: -evaluate(x, True).jacobian,
            bounds=(lower, upper), xtol=1e-12, ftol=1e-12, gtol=1e-12,
        )
        assert fit.converged and fit.cost <= peer.cost * (1.0 + 1e-6)
        assert np.all((lower <= fit.x) & (fit.x <= upper))
        bound += int(fit.at_bound.any())
    assert bound >= 5


def test_wrong_derivatives_are_not_called_converged():
    time = np.linspace(0.0, 4.0, 40)
    right = exponential(time, 3.0 * np.exp(-1.7 * time) + 0.01 * np.sin(9.0 * time))

    def wrong(x, with_jacobian):
        residual, jacobian = right(x, with_jacobian)
        return Evaluation(residual, None if jacobian is None else -jacobian)

    fit = least_squares(wrong, np.array([1.0, 0.5]))
    assert not fit.converged and fit.reason == "no step lowers the square sum"


def test_a_valley_is_followed_with_derivatives_good_to_a_percent():
    """Its curvature is taken from values alone: from these derivatives it came out twenty times as wrong as
    they are, and the search gave up at a square sum half as large again."""
    def valley(error):
        def evaluate(x, with_jacobian):
            values = np.array([1e3 * (x[1] - np.sin(0.3 * x[0])), 0.1 * x[0]])
            jacobian = np.array([[-3e2 * np.cos(0.3 * x[0]) * (1.0 + error), 1e3], [0.0, 0.1]])
            return Evaluation(np.array([0.0, 3.0]) - values, jacobian if with_jacobian else None)

        return least_squares(evaluate, np.zeros(2))

    assert valley(0.01).cost < 1.1 * valley(0.0).cost


def kinked(height):
    """200 data of a line in x_1, and one of 1 + |x_0 - x_1|: no gradient vanishes at the minimum."""
    along, noise = np.linspace(-1.0, 1.0, 200), np.random.default_rng(7).normal(size=200)

    def evaluate(x, with_jacobian):
        apart = x[0] - x[1]
        residual = np.concatenate([noise - along * x[1], [-height * (1.0 + abs(apart) + 0.1 * apart)]])
        slope = height * (np.sign(apart) + 0.1)
        jacobian = np.concatenate([np.column_stack([0.0 * along, along]), [[slope, -slope]]])
        return Evaluation(residual, jacobian if with_jacobian else None)

    return evaluate


@pytest.mark.parametrize("height, numbers, arrives", [(0.3, None, 1), (0.6, None, 0), (0.6, 40.0, 1)])
def test_a_minimum_at_a_kink_is_found_in_few_steps(height, numbers, arrives):
    """There the linear model still promises height^2: convergence where that is worth less than half
    a standard deviation, which is more where the data are worth fewer numbers."""
    fit = least_squares(kinked(height), np.array([0.3, 0.2]), numbers=numbers)
    assert fit.iterations < 60 and fit.converged == arrives
    assert abs(fit.x[0] - fit.x[1]) < 1e-2


def test_a_step_that_is_taken_is_evaluated_once():
    """With its Jacobian at once; a step that is not taken costs no Jacobian but the first in a row."""
    time, seen = np.linspace(0.0, 4.0, 40), []

    def counted(x, with_jacobian):
        seen.append((x.tobytes(), with_jacobian))
        return exponential(time, 3.0 * np.exp(-1.7 * time))(x, with_jacobian)

    fit = least_squares(counted, np.array([2.5, 1.5]))
    assert fit.converged and fit.iterations > 2
    assert len(seen) == len(set(seen)) == fit.iterations and all(slopes for _, slopes in seen)
    seen.clear()
    fit = least_squares(counted, np.array([1.0, 40.0]), most_iterations=2)  # far off: the radius shrinks
    assert len(seen) > 4 and sum(slopes for _, slopes in seen) <= 1 + 2 * fit.iterations


def test_the_limit_of_iterations_is_said():
    time = np.linspace(0.0, 4.0, 40)
    fit = least_squares(exponential(time, 3.0 * np.exp(-1.7 * time)), np.array([1.0, 0.1]), most_iterations=2)
    assert not fit.converged and fit.reason == "stopped at the limit of 2 iterations" and fit.offset > 1e-3


def test_bound_is_held_and_the_others_are_refitted():
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(80, 3))
    measured = columns @ [1.0, 2.0, -1.0] + 0.1 * rng.normal(size=80)
    lower, upper = np.array([-np.inf, -np.inf, -0.4]), np.array([np.inf, 1.5, np.inf])
    fit = least_squares(linear(columns, measured), np.zeros(3), bounds=(lower, upper))
    alone = np.linalg.lstsq(columns[:, :1], measured - columns[:, 1:] @ [1.5, -0.4], rcond=None)[0]
    assert fit.at_bound.tolist() == [False, True, True] and fit.freedom == 79
    np.testing.assert_allclose(fit.x, [alone[0], 1.5, -0.4], rtol=1e-9)
    assert np.all(fit.covariance[1:] == 0.0)


def test_bound_is_left_again_when_the_data_ask_for_it():
    columns = np.random.default_rng(4).normal(size=(20, 2))
    bounds = (np.zeros(2), np.array([5.0, 5.0]))
    fit = least_squares(linear(columns, columns @ [1.0, 2.0]), np.array([0.0, 5.0]), bounds=bounds)
    np.testing.assert_allclose(fit.x, [1.0, 2.0], rtol=1e-9)
    assert not fit.at_bound.any()


def test_huber_solves_its_own_estimating_equation():
    """sum_i psi(r_i / s) x_i = 0 with psi clipped at HUBER, s from the median of |r|."""
    rng = np.random.default_rng(5)
    columns = rng.normal(size=(200, 3))
    measured = columns @ [1.0, -1.0, 0.5] + 0.02 * rng.normal(size=200)
    measured[::10] += 6.0 * np.sign(columns[::10, 0])
    fit = least_squares(linear(columns, measured), np.zeros(3), robust=True)
    plain = least_squares(linear(columns, measured), np.zeros(3))
    scale = np.median(np.abs(fit.residual)) / 0.6744897501960817
    score = np.clip(fit.residual / scale, -HUBER, HUBER)
    size = np.linalg.norm(columns, axis=0) * np.sqrt(np.mean(score**2))
    assert fit.converged and np.all(np.abs(columns.T @ score) < 1e-2 * size)
    truth = np.array([1.0, -1.0, 0.5])
    assert np.max(np.abs(fit.x - truth)) < 0.03 < 0.3 < np.max(np.abs(plain.x - truth))


def test_robust_weight_is_shared_by_a_group_and_spares_the_prior():
    rng = np.random.default_rng(6)
    columns = np.concatenate([rng.normal(size=(90, 2)), 0.1 * np.eye(2)])
    measured = np.concatenate([columns[:90] @ [1.0, 2.0] + 0.01 * rng.normal(size=90), [10.0, 10.0]])
    measured[4] += 5.0
    fit = least_squares(linear(columns, measured), np.zeros(2), robust=True, group=3, data_rows=90)
    assert fit.weights[3] == fit.weights[4] == fit.weights[5] < 0.2
    assert np.all(fit.weights[90:] == 1.0)


def test_prior_rows_are_ridge_regression():
    rng = np.random.default_rng(7)
    columns, deviation = rng.normal(size=(25, 3)), np.array([0.1, 1.0, 10.0])
    measured = columns @ [0.5, 0.5, 0.5] + rng.normal(size=25)
    rows = np.concatenate([columns, np.diag(1.0 / deviation)])
    fit = least_squares(linear(rows, np.concatenate([measured, np.zeros(3)])), np.ones(3), data_rows=25)
    closed = np.linalg.solve(columns.T @ columns + np.diag(deviation**-2.0), columns.T @ measured)
    np.testing.assert_allclose(fit.x, closed, rtol=1e-9)


def test_dependent_columns_give_a_finite_best_fit():
    rng = np.random.default_rng(8)
    one = rng.normal(size=(40, 2))
    columns = np.column_stack([one, one[:, 0] + one[:, 1]])
    measured = one @ [1.0, 2.0]
    fit = least_squares(linear(columns, measured), np.zeros(3))
    np.testing.assert_allclose(columns @ fit.x, measured, atol=1e-9)
    assert np.all(np.isfinite(fit.covariance))


@pytest.mark.parametrize("count", [8, 40])
@pytest.mark.slow
def test_intervals_hold_the_truth_in_19_of_20_repeats(count):
    """Few and many degrees of freedom; 400 repeats of 2 parameters: 95 % within 3 standard errors."""
    rng = np.random.default_rng(9)
    time = np.linspace(0.0, 2.0, count)
    truth = np.array([2.0, 0.8])
    inside = []
    for _ in range(400):
        measured = truth[0] * np.exp(-truth[1] * time) + rng.normal(0.0, 0.01, count)
        low, high = least_squares(exponential(time, measured), truth).interval().T
        inside.append((low < truth) & (truth < high))
    assert abs(np.mean(inside) - 0.95) < 3.0 * np.sqrt(0.95 * 0.05 / 400)


@pytest.mark.parametrize("gross", [0.0, 0.1])
@pytest.mark.slow
def test_robust_intervals_hold_the_truth_beside_gross_errors(gross):
    """Neither widened by a tenth of wrong rows nor too narrow on clean ones; groups of 3 as for positions."""
    rng = np.random.default_rng(10)
    truth, inside, sigmas = np.array([1.0, -2.0, 0.5]), [], []
    for _ in range(300):
        columns = rng.normal(size=(150, 3))
        measured = columns @ truth + 0.01 * rng.normal(size=150)
        wrong = np.repeat(rng.random(50) < gross, 3)
        measured[wrong] += rng.normal(0.0, 5.0, wrong.sum())
        fit = least_squares(linear(columns, measured), truth, robust=True, group=3)
        low, high = fit.interval().T
        inside.append((low < truth) & (truth < high))
        sigmas.append(fit.sigma)
    assert 0.92 < np.mean(inside) < 0.98
    assert 0.009 < np.mean(sigmas) < 0.013


@pytest.mark.slow
@pytest.mark.parametrize("standards", [0.0, 0.5, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("count", [12, 60])
def test_intervals_hold_a_size_at_or_near_its_bound(count, standards):
    """A size that cannot be negative, its truth so many standard deviations above zero, beside a free
    parameter that looks like it: no interval is empty, negative, or off zero where the estimate is there."""
    rng, inside = np.random.default_rng(12), []
    columns = rng.normal(size=(count, 2)) @ np.array([[1.0, 0.6], [0.0, 0.8]])
    sigma = np.sqrt(np.linalg.inv(columns.T @ columns)[0, 0])
    truth = np.array([standards * sigma, 1.0])
    bounds = np.array([0.0, -np.inf]), np.full(2, np.inf)
    for _ in range(600):
        measured = columns @ truth + rng.normal(size=count)
        fit = least_squares(linear(columns, measured), np.ones(2), bounds=bounds)
        low, high = fit.interval()[0]
        assert 0.0 <= low <= fit.x[0] < high and (low == 0.0 or not fit.at_bound[0])
        inside.append(low <= truth[0] <= high)
    assert np.mean(inside) > 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / 600)
    assert standards > 0.0 or np.mean(inside) < 0.995


def test_an_interval_beyond_a_bound_is_that_of_the_truncated_normal():
    """Its end holds 95 % of what the bound leaves, and it meets the common one at the bound."""
    far = stats.truncnorm(1.5, np.inf, loc=-3.0, scale=2.0)
    bounds = np.array([[0.0], [np.inf]])
    found = bounded_interval(np.array([-3.0]), np.array([2.0]), bounds, 1e9)
    np.testing.assert_allclose(found, [[0.0, far.ppf(0.95)]], rtol=1e-6)
    mirrored = bounded_interval(np.array([3.0]), np.array([2.0]), -bounds[::-1], 1e9)
    np.testing.assert_allclose(mirrored, -found[:, ::-1])
    either = [bounded_interval(np.array([at]), np.ones(1), bounds, 20.0)[0, 1] for at in (-1e-9, 1e-9)]
    np.testing.assert_allclose(either[0], either[1], rtol=1e-6)


def test_a_parameter_at_its_bound_that_nothing_shows_has_no_end():
    columns = np.random.default_rng(13).normal(size=(30, 1))
    columns = np.column_stack([columns, columns])
    bounds = np.array([-np.inf, 0.0]), np.full(2, np.inf)
    fit = least_squares(linear(columns, columns[:, 0]), np.array([1.0, 0.0]), bounds=bounds)
    assert fit.at_bound[1] and fit.interval()[1].tolist() == [0.0, np.inf]


@pytest.mark.parametrize("seed", range(20))
def test_a_bound_that_a_step_meets_is_met_to_the_last_digit(seed):
    """Whatever the scale of its column."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(40, 3)) * rng.uniform(0.1, 10.0, 3)
    lower = np.array([-np.inf, rng.uniform(0.1, 1.0), -np.inf])
    problem = linear(columns, columns @ [1.0, -2.0, 3.0])
    fit = least_squares(problem, np.full(3, 2.0), bounds=(lower, np.full(3, 9.0)))
    assert fit.at_bound.tolist() == [False, True, False] and fit.x[1] == lower[1]
