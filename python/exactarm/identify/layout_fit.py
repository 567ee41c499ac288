"""One fit for every kind of data: a layout's free parameters by weighted least squares, with its noise.

    minimise  sum_ia (w_i e_ia(x) / sigma_a)^2 + sum_p ((x_p - c_p) / s_p)^2     over the parameters' bounds

e (N, m): measured minus predicted; w (N,): square root of the information of a row, 0 leaves it out; sigma
(m,) of the components, estimated from the residuals until both agree (iterative variance components, Förstner
1979; iterated weighted least squares, Swevers, Ganseman, Tukel, De Schutter and Van Brussel 1997); c, s:
Gaussian priors, those of many terms that regularise each other. The result depends on the arguments alone.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from exactarm.chain import Layout
from exactarm.numerics.regression import Evaluation, Fit, gram_inverse, least_squares

Predict = Callable[[Layout, bool], tuple[np.ndarray, np.ndarray | None]]
Drawing = Mapping[str, tuple[float, float]]  # name of a parameter: declared value, plausible deviation

_ROUNDS = 12
_SLOW, _SLOWEST = 0.5, 0.9  # ratio of two steps from which a series is summed, up to ten times its last one
_SETTLED = 0.01  # relative change of a standard deviation
_ALONG = 1e-3  # share of the square sum still to fall: a twentieth of `_SETTLED` in a standard deviation
_ROUNDING = 1e-12  # of the residual
_LEAST_FREE_SHARE = 0.1  # of the numbers that is left for the noise, however many parameters there are


@dataclass(frozen=True)
class LayoutFit:
    """The layout at its estimate, the fit, the standard deviation (m,) of an independent row's numbers."""

    layout: Layout
    fit: Fit
    sigma: np.ndarray


@dataclass(frozen=True)
class _Point:
    """An evaluation, residual (R,) and Jacobian (R, P), of rows with a weight (n,) and of priors `pull`
    (q, P); alike (m,): number of each component's variance."""

    residual: np.ndarray
    jacobian: np.ndarray
    weight: np.ndarray
    alike: np.ndarray
    pull: np.ndarray

    @cached_property
    def grams(self) -> list[np.ndarray]:
        """(P, P) J'J of the weighted rows of every variance, in units of the measurement."""
        size = self.jacobian.shape[1]
        data = self.jacobian[: len(self.weight) * len(self.alike)].reshape(len(self.weight), -1, size)
        found = []
        for number in range(int(self.alike.max()) + 1):
            mine = data if not self.alike.any() else data[:, self.alike == number]
            if np.any(self.weight != 1.0):
                mine = self.weight[:, None, None] * mine
            mine = mine.reshape(-1, size)
            found.append(mine.T @ mine)
        return found

    def normal(self, sigma: np.ndarray) -> np.ndarray:
        """(P, P) J'WJ with standard deviations sigma (m,) of the components; each prior pulls at one
        parameter."""
        variances = sigma[np.unique(self.alike, return_index=True)[1]] ** 2
        found = sum(gram / variance for gram, variance in zip(self.grams, variances))
        found[np.diag_indices_from(found)] += np.sum(self.pull**2, axis=0)
        return found


def fit_layout(predict: Predict, layout: Layout, weight: np.ndarray, sigma: np.ndarray | None = None, *,
               alike: np.ndarray, floor: np.ndarray | float = 1e-12, robust: bool = False,
               tolerance: float = 1e-10, drawing: Drawing | None = None,
               worth: np.ndarray | None = None) -> LayoutFit:
    """Estimates the free parameters of `layout`.

    predict(layout, with_jacobian): residual (N, m) and Jacobian (N, m, P) of the prediction (if asked), of
    noise that is independent from row to row. sigma (m,): first guess, None = from the residual at the start;
    alike (m,): number of the variance that a component has, from 0; floor (m,): no sigma is smaller. robust:
    Huber's loss on whole rows. drawing: parameters that are drawn to their declared values. worth (N,): how
    many independent rows a row is worth whose noise others share, 1 at most; None = 1.
    """
    share = np.ones(len(weight)) if worth is None else worth
    weight = weight * np.sqrt(share)
    parameters, rows = layout.parameters, np.flatnonzero(weight > 0.0)
    bounds = np.array([p.lower for p in parameters]), np.array([p.upper for p in parameters])
    pull, centre = pulls_of(layout, drawing)

    latest: dict[bytes, _Point] = {}  # the last, where the next round mostly begins

    def evaluate(x: np.ndarray, with_jacobian: bool) -> Evaluation:
        if with_jacobian and x.tobytes() in latest:
            return latest[x.tobytes()]
        residual, jacobian = predict(layout.at(x), with_jacobian)
        value = np.concatenate([residual[rows].ravel(), pull @ (centre - x)])
        if not with_jacobian:
            return Evaluation(value, None)
        columns = np.empty((value.size, layout.size))
        columns[value.size - len(pull) :] = pull
        data = columns[: value.size - len(pull)].reshape(rows.size, residual.shape[1], layout.size)
        np.take(jacobian, rows, axis=0, out=data, mode="clip")  # in place
        latest.clear()
        latest[x.tobytes()] = _Point(value, columns, weight[rows], alike, pull)
        return latest[x.tobytes()]

    x, components = layout.values, len(alike)
    unseen = _unseen(evaluate(x, True), parameters)
    if unseen.any():  # it stays where it is, as well known as its plausible size
        latest.clear()
        pull = np.concatenate([pull, (np.eye(x.size) / [p.plausible for p in parameters])[unseen]])
        centre = np.where(unseen, x, centre)
    if sigma is None:
        start = evaluate(x, False).residual[: rows.size * components].reshape(-1, components)
        sigma = np.maximum(_spread(start, np.zeros(components), alike, share[rows]), floor)
    one_scale = not len(pull) and np.unique(alike).size == 1  # which no estimate hangs on
    numbers = float(np.sum(np.minimum(weight[rows] ** 2, share[rows]))) * components + len(pull)
    moved = np.zeros(components)
    exact = one_scale  # the noise is sought along the way: only its last round is brought to the end
    for _ in range(_ROUNDS):
        each = (weight[rows, None] / sigma).ravel()
        fit = least_squares(
            evaluate, x, weights=np.concatenate([each, np.ones(len(pull))]), bounds=bounds, robust=robust,
            group=int(np.bincount(alike).min()),  # what shares one variance shares a robust weight
            data_rows=each.size, numbers=numbers, tolerance=tolerance if exact else max(tolerance, _ALONG),
            normal=None if robust else partial(_Point.normal, sigma=sigma))
        last = evaluate(fit.x, True)  # the latest may be of a step that was not taken
        spent = _spent(last, sigma, fit)
        left = fit.clipped[: each.size].reshape(-1, components)
        new = np.maximum(_spread(left, spent, alike, share[rows]), floor)
        near = one_scale or bool(np.all(np.abs(new / sigma - 1.0) < _SETTLED))
        settled, exact = near and exact, near or exact
        moved, before = np.log(new / sigma), moved
        x, sigma = fit.x, new
        if settled:
            break
        slow = float(moved @ before) / max(float(before @ before), 1e-300)
        if slow > _SLOW:  # an error that one component can take from another: Aitken's step along the series
            sigma = np.maximum(new * np.exp(moved / (1.0 / min(slow, _SLOWEST) - 1.0)), floor)
    if fit.freedom > 0 and fit.sigma > 0.0 and not one_scale:
        # sigma is what the data alone have left: the pulls of priors are no measure of it
        covariance = fit.covariance / fit.sigma**2 if len(pull) or worth is not None else fit.covariance
        fit = fit.known_by(covariance, _freedom(spent, alike, float(share[rows].sum())))
    elif one_scale and worth is not None:
        freedom = max(round(numbers) - int(np.sum(~fit.at_bound)), 1)
        fit = fit.known_by(fit.covariance * (max(fit.freedom, 1) / freedom), freedom)
    if not settled and fit.converged:
        fit = replace(fit, reason=f"noise and parameters did not settle on each other in {_ROUNDS} rounds")
    return LayoutFit(layout.at(x), fit, sigma)


def _unseen(start: _Point, parameters) -> np.ndarray:
    """(P,) parameters that change the rows by rounding only: a plausible size of them by less than 1e-12 of
    what is left at the start. One that changes nothing yet, like the order of a wave without a size, may
    later."""
    change = np.linalg.norm(start.jacobian, axis=0) * [p.plausible for p in parameters]
    return (change > 0.0) & (change < _ROUNDING * np.linalg.norm(start.residual))


def _freedom(spent: np.ndarray, alike: np.ndarray, rows: float) -> int:
    """Degrees of freedom of the variances together, by what each has paid for parameters (Satterthwaite
    1946): what one component tells is as uncertain as its own variance is."""
    paid = np.bincount(alike, weights=spent)
    left = np.maximum(rows * np.bincount(alike) - paid, 1.0)
    return max(round(float(paid.sum() ** 2 / np.sum(paid**2 / left))), 1) if paid.any() else round(rows)


def _spread(residual: np.ndarray, spent: np.ndarray, alike: np.ndarray, share: np.ndarray) -> np.ndarray:
    """(m,) standard deviations of the components of (n, m); spent (m,): parameters that each has paid for;
    share (n,): independent rows that each is worth."""
    square = np.bincount(alike, weights=np.sum(share[:, None] * residual**2, axis=0))
    numbers = float(share.sum()) * np.bincount(alike)
    left = np.maximum(numbers - np.bincount(alike, weights=spent), _LEAST_FREE_SHARE * numbers)
    return np.sqrt(square / np.maximum(left, 1e-300))[alike]


def _spent(last: _Point, sigma: np.ndarray, fit: Fit) -> np.ndarray:
    """(m,) leverage of each component's weighted rows: what is measured best pays for most parameters."""
    if fit.sigma > 0.0:
        inverse = fit.covariance / fit.sigma**2
    else:
        free, inverse = ~fit.at_bound, np.zeros(last.grams[0].shape)
        scaled, scale = gram_inverse(last.normal(sigma)[np.ix_(free, free)])
        inverse[np.ix_(free, free)] = scaled / np.outer(scale, scale)
    paid = np.array([np.sum(inverse * gram) for gram in last.grams])[last.alike]
    return paid / sigma**2 / np.bincount(last.alike)[last.alike]


def pulls_of(layout: Layout, drawing: Drawing | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Priors as observations of unit variance: rows (r, P), and the values (P,) that they draw to."""
    centre, spread = priors_of(layout, drawing)
    drawn = np.flatnonzero(np.isfinite(spread))
    return np.eye(layout.size)[drawn] / spread[drawn, None], centre


def priors_of(layout: Layout, drawing: Drawing | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Centre and standard deviation (P,) of each free parameter's prior: zero with the spread that it asks
    for, or the declared value with its plausible spread where the effect is drawn to it, or `drawing` says
    so; infinite for the others."""
    centre, spread = np.zeros(layout.size), np.array(layout.prior, float)
    for effect, mask, where in zip(layout.effects, layout.free, layout.slices):
        if effect.drawn_to_declared:
            centre[where] = np.array(effect.values)[mask]
            spread[where] = np.array([p.plausible for p in effect.parameters()])[mask]
    for place, name in enumerate(layout.names if drawing else ()):
        if name in drawing:
            centre[place], spread[place] = drawing[name]
    return centre, spread
