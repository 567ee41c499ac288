"""Fits a layout to closures: heavy-tailed noise, one standard deviation for each sort of contact, known
lengths as data.

    minimise  sum_rows rho(|r_i / sigma_class|^2) + sum_known ((L - f) / sigma_L)^2 + sum_geometry ((x - x0) /
              tau)^2

rho: Student's t with TAIL_FREEDOM degrees of freedom (Lange, Little, Taylor 1989), by iteratively reweighted
least squares: a ball that has slipped counts for little. sigma of each class from its share of the redundancy
(Förstner 1979), with a wide log-normal prior: a sort whose few numbers the parameters can meet exactly says
nothing of its noise, and would be taken for exact. tau: plausible size of a deviation from the drawing,
`Parameter.plausible`: directions that the contacts do not show stay at the drawing. Covariance of the
M-estimator (Huber 1981, 6.5) beside the prior: (s^2/v J'J + P'P)^{-1} with v = K^2 sum psi^2 / freedom,
s = mean psi', K = 1 + P / N var(psi') / s^2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy  # scipy.optimize is imported at its first use
from scipy import linalg

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import Fixture
from exactarm.data.split import pose_groups
from exactarm.identify.layout_fit import pulls_of
from exactarm.identify.repeats import worth_of_rows
from exactarm.measurement.closures import PAIR, ClosurePrediction, noise_classes, predict_closures
from exactarm.measurement.contacts import CAMERA
from exactarm.measurement.known_lengths import known_lengths
from exactarm.numerics.quadratic import variances
from exactarm.numerics.regression import Evaluation, Fit, beyond_bounds, least_squares
from exactarm.robot.robot import Robot

TAIL_FREEDOM = 4.0  # a slip of 10 sigma counts 7 %; normal noise is used to 95 %
_FIRST_SIGMA = (1e-3, 2e-3)  # m, rad
_LEAST_SIGMA, _LARGEST_SIGMA = 1e-9, 1e3
_EXACT = 1e-30  # of the noise: rows that their own unknowns explain to the last digit
# of every sort before any data, m or rad: from 0.014 to 0.7 mm (95 %), as seats, styli and trackers are
_USUAL_SIGMA, _USUAL_SPREAD = 1e-4, 1.0  # median, standard deviation of the logarithm
# relative change of the scales that ends the rounds, and far below it the one at fixed residuals, which is
# cheap
_ROUNDS, _SETTLED, _ALIKE = 60, 2e-4, 1e-5
_INNER_STEPS = 12
# of the weighted square sum: a further step would gain less, a tenth of a standard deviation
_DECREMENT = 1e-2


@dataclass(frozen=True)
class Noise:
    """Standard deviations by class (device, "position" or "orientation"), m and rad."""

    by_class: dict[tuple[str, str], float]

    def of(self, data: Dataset, used: np.ndarray) -> np.ndarray:
        """(N, m) standard deviation of every number."""
        device = noise_classes(data)
        out = np.ones(used.shape)
        for k, part in enumerate(_parts(used)):
            for name in np.unique(device):
                sigma = self.by_class.get((name, part))
                if sigma is not None:
                    out[device == name, 3 * k : 3 * k + 3] = sigma
        return out


@dataclass(frozen=True)
class ClosureFit:
    """The layout at its estimate; `weight` (N,): square roots of the rows' robust weights; worth (N,):
    independent readings that each row is worth (exactarm.identify.repeats)."""

    robot: Robot
    layout: Layout
    fit: Fit
    noise: Noise
    prediction: ClosurePrediction
    sigma: np.ndarray
    weight: np.ndarray
    worth: np.ndarray

    @property
    def sigma_position(self) -> float:
        """m: RMS over the rows that give a place."""
        used = self.prediction.used[:, :3]
        return float(np.sqrt(np.mean(self.sigma[:, :3][used] ** 2)))

    @property
    def sigma_orientation(self) -> float | None:
        """rad: the same over the rows that give an orientation; None where there are none."""
        used = self.prediction.used[:, 3:]
        return float(np.sqrt(np.mean(self.sigma[:, 3:][used] ** 2))) if used.any() else None

    @property
    def log_likelihood(self) -> float:
        """Of the rows, up to a constant: what different models of one data set are compared by."""
        square, count = _squares(self.prediction.residual / self.sigma, self.prediction.used)
        tails = 0.5 * (TAIL_FREEDOM + count) * np.log1p(square / TAIL_FREEDOM)
        scales = np.where(self.prediction.used, np.log(self.sigma), 0.0).sum(axis=1)
        return -float(self.worth @ (tails + scales))

    @property
    def numbers(self) -> float:
        """Independent numbers of the rows, those that the means of pairs have taken excepted."""
        return float(self.worth @ self.prediction.used.sum(axis=1)) - self.prediction.projected(self.worth)

    def told(self, data: Dataset) -> np.ndarray:
        """(N,) what each row is worth by this fit: readings of one contact at the same angles share what the
        arm misses it by. Corners of a picture have parted what they share from the rest already."""
        angles = pose_groups(replace(data, contacts={n: v for n, v in data.contacts.items() if n != PAIR}))
        devices, used, out = noise_classes(data), self.prediction.used, np.ones(len(data))
        white = self.weight[:, None] * self.prediction.residual / self.sigma
        for name in set(devices) - set(CAMERA):
            rows = np.flatnonzero((devices == name) & (self.weight > 0))
            if not len(rows):
                continue
            seen = used[rows[0]]
            same = np.stack([angles, data.session, *data.contacts.values()], axis=1)[rows]
            poses = np.unique(same, axis=0, return_inverse=True)[1].ravel()
            share = self.fit.x.size * len(rows) * seen.sum() / max(int(used.sum()), 1)
            out[rows] = worth_of_rows(white[rows][:, seen], poses, share)
        return out


@dataclass(frozen=True)
class Pulls:
    """What is known beside the rows: lengths of the fixture, and `drawing`: name of a parameter -> (value,
    standard deviation of its deviation)."""

    fixture: Fixture = Fixture()
    drawing: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @staticmethod
    def of(layout: Layout, fixture: Fixture) -> Pulls:
        """Around the values of `layout`, with the plausible sizes of its parameters."""
        drawn = zip(layout.names, layout.values, layout.parameters)
        return Pulls(fixture, {name: (float(value), p.plausible) for name, value, p in drawn})

    def rows(self, layout: Layout) -> tuple[np.ndarray, np.ndarray]:
        """Whitened rows (r, P) and residuals (r,) at the layout's values."""
        held = [(j, *self.drawing[name]) for j, name in enumerate(layout.names) if name in self.drawing]
        rows = np.zeros((len(held), layout.size))
        values = layout.values
        for place, (j, _, spread) in enumerate(held):
            rows[place, j] = 1.0 / spread
        rest = [(value - values[j]) / spread for j, value, spread in held]
        own, _ = pulls_of(layout)
        known = known_lengths(layout, self.fixture)
        lengths = np.array([k.row / k.sigma for k in known]).reshape(len(known), layout.size)
        return (np.concatenate([rows, own, lengths]),
                np.concatenate([rest, -own @ values, [k.residual / k.sigma for k in known]]))


def fit_closures(robot: Robot, layout: Layout, data: Dataset, pulls: Pulls, *, keep: np.ndarray | None = None,
                 worth: np.ndarray | None = None, threads: int = 1, tolerance: float = 1e-9) -> ClosureFit:
    """Estimates the free parameters of `layout` from all rows of `data` (one device a row). keep (N,): rows
    to use; worth (N,): independent readings that each is worth, absent: one."""
    keep = np.ones(len(data)) if keep is None else np.asarray(keep, float)
    worth = np.ones(len(data)) if worth is None else worth
    root = np.sqrt(worth)
    lower = np.array([p.lower for p in layout.parameters])
    upper = np.array([p.upper for p in layout.parameters])
    prediction = predict_closures(robot, layout, data, threads=threads)
    noise = _first_noise(data, prediction)
    sigma, weight, settled, fit = noise.of(data, prediction.used), keep, False, None

    def finished() -> tuple[np.ndarray, Fit]:
        last = keep * _tail_weights(prediction.residual / sigma, prediction.used)
        return last, _finished(fit, prediction, sigma, keep, worth, last, *pulls.rows(layout), settled)

    for _ in range(_ROUNDS):
        weight = keep * _tail_weights(prediction.residual / sigma, prediction.used)
        fit, there = _inner(robot, layout, data, pulls, prediction, (root * weight)[:, None] / sigma,
                            (lower, upper), threads, tolerance)
        layout, held = layout.at(fit.x), there.pictures.groups
        prediction = predict_closures(robot, layout, data, threads=threads) if held else there
        new = _estimated_noise(data, prediction, sigma, keep, worth, pulls.rows(layout)[0])
        change = max(abs(value / noise.by_class.get(key, np.inf) - 1.0)
                     for key, value in new.by_class.items())
        settled = change < _SETTLED and fit.converged
        if settled:
            weight, done = finished()
            if done.converged:  # weights that still follow the residual may leave a way to go
                break
        noise, sigma = new, new.of(data, prediction.used)
    else:
        weight, done = finished()
    return ClosureFit(robot, layout, done, noise, prediction, sigma, weight, worth)


def _inner(robot, layout, data, pulls, prediction, scale, bounds, threads,
           tolerance) -> tuple[Fit, ClosurePrediction]:
    """Weighted least squares from the `prediction` of the layout, at fixed weights and variances, and fixed
    axes of the pictures: as these turn, the square sum has no slope that the Jacobian tells. With the
    prediction at the end, in the same axes."""
    numbers = prediction.residual.size
    latest = {layout.values.tobytes(): prediction}  # with its Jacobian: two at once are a lot of memory

    def evaluate(x: np.ndarray, with_jacobian: bool) -> Evaluation:
        at, now = layout.at(x), latest.get(x.tobytes())
        if now is None:
            now = predict_closures(robot, at, data, tangents=with_jacobian, threads=threads,
                                   pictures=prediction.pictures)
            if with_jacobian:
                latest.clear()
                latest[x.tobytes()] = now
        pull, tail = pulls.rows(at)
        residual = np.concatenate([now.residual.ravel(), tail])
        if not with_jacobian:
            return Evaluation(residual, None)
        return Evaluation(residual, np.concatenate([now.jacobian.reshape(numbers, layout.size), pull]))

    rows = len(pulls.rows(layout)[1])
    weights = np.concatenate([(scale * prediction.used).ravel(), np.ones(rows)])
    fit = least_squares(evaluate, layout.values, weights=weights, bounds=bounds, tolerance=tolerance,
                        most_iterations=_INNER_STEPS)
    evaluate(fit.x, True)  # the last may have been a step that was not taken
    return fit, latest[fit.x.tobytes()]


def _squares(white: np.ndarray, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) square sum of each row's numbers, and how many there are."""
    return np.sum(np.where(used, white, 0.0) ** 2, axis=1), used.sum(axis=1)


def _tail_weights(white: np.ndarray, used: np.ndarray) -> np.ndarray:
    """(N,) square roots of the weights of Student's t."""
    square, count = _squares(white, used)
    return np.sqrt((TAIL_FREEDOM + count) / (TAIL_FREEDOM + square))


def _parts(used: np.ndarray) -> tuple[str, ...]:
    return ("position", "orientation")[: used.shape[1] // 3]


def _first_noise(data: Dataset, prediction: ClosurePrediction) -> Noise:
    device, used = noise_classes(data), prediction.used
    return Noise({
        (name, part): _FIRST_SIGMA[k] for k, part in enumerate(_parts(used)) for name in np.unique(device)
        if used[device == name, 3 * k : 3 * k + 3].any()})


def _estimated_noise(data, prediction: ClosurePrediction, sigma, keep, worth, pull) -> Noise:
    """Scale of each class: weighted square sum over its redundancy (numbers less leverage). Weights and
    scales settle on each other here, at the cost of no prediction."""
    used, device = prediction.used & (keep > 0)[:, None], noise_classes(data)
    weights = lambda sigma: np.sqrt(worth) * _tail_weights(prediction.residual / sigma, prediction.used)
    leverage = _leverage(prediction, weights(sigma)[:, None] * used / sigma, pull)
    pairs = prediction.pairs
    alone = np.where(pairs >= 0,
                     1.0 - 1.0 / np.maximum(np.bincount(pairs[pairs >= 0], minlength=1)[pairs], 1), 1.0)
    numbers = (worth * alone)[:, None] - leverage
    blocks = {}
    for k, part in enumerate(_parts(used)):
        for name in np.unique(device):
            block = np.zeros_like(used)
            block[device == name, 3 * k : 3 * k + 3] = True
            if (block := block & used).any():
                blocks[name, part] = block
    found: dict[tuple[str, str], float] = {}
    for _ in range(_ROUNDS):
        squares = (weights(sigma)[:, None] * prediction.residual) ** 2
        before, sigma = found, sigma.copy()
        found = {key: _likeliest_sigma(float(squares[block].sum()), float(numbers[block].sum()))
                 for key, block in blocks.items()}
        for key, block in blocks.items():
            sigma[block] = found[key]
        if all(abs(found[key] / before.get(key, np.inf) - 1.0) < _ALIKE for key in found):
            break
    return Noise(found)


def _likeliest_sigma(square: float, redundancy: float) -> float:
    """Where redundancy ln(sigma) + square / (2 sigma^2) is least beside the prior: its slope by ln(sigma)
    rises throughout."""
    slope = lambda log: (max(redundancy, 0.0) - square * np.exp(-2.0 * log)
                         + (log - np.log(_USUAL_SIGMA)) / _USUAL_SPREAD**2)
    low, high = np.log(_LEAST_SIGMA), np.log(_LARGEST_SIGMA)
    if slope(low) >= 0.0:
        return _LEAST_SIGMA
    if slope(high) <= 0.0:  # contacts that are missed by more than any device reads
        return _LARGEST_SIGMA
    return float(np.exp(scipy.optimize.brentq(slope, low, high, xtol=1e-9)))


def _leverage(prediction: ClosurePrediction, scale: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """(N, m) how much of each number its own measurement decides."""
    rows = (scale[:, :, None] * prediction.jacobian).reshape(scale.size, pull.shape[1])
    solved = pseudo_inverse(rows.T @ rows + pull.T @ pull)
    return variances(rows, solved).reshape(scale.shape)


def pseudo_inverse(matrix: np.ndarray) -> np.ndarray:
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return linalg.pinvh(matrix / np.outer(scale, scale), rtol=1e-12) / np.outer(scale, scale)


def _finished(fit, prediction, sigma, keep, worth, weight, pull, tail, settled) -> Fit:
    """The fit with the covariance of the M-estimator and a check of convergence beside the solver's own."""
    used = prediction.used & (keep > 0)[:, None]
    square, count = _squares(prediction.residual / sigma, used)
    psi = (keep * weight**2)[:, None] * prediction.residual / sigma * used
    shares = (worth[:, None] * used).sum(axis=1)
    numbers = float(shares.sum()) - prediction.projected(worth)
    scale = np.sqrt(worth)[:, None] * used / sigma
    jacobian = prediction.jacobian.reshape(scale.size, pull.shape[1])
    rows = scale.ravel()[:, None] * jacobian
    redundancy = numbers - float(_leverage(prediction, weight[:, None] * scale, pull).sum())
    freedom = max(int(round(redundancy)), 1)
    tails = TAIL_FREEDOM + square
    slopes = (TAIL_FREEDOM + count) * (1.0 / tails - 2.0 * square / np.maximum(count, 1) / tails**2)
    slopes = slopes[keep > 0]
    each = shares[keep > 0] / max(float(shares.sum()), 1.0)
    slope = float(slopes @ each)
    # few numbers for each parameter: Huber's correction of the next order (1981, 7.6)
    few = 1.0 + (numbers - freedom) / max(numbers, 1) * float((slopes - slope) ** 2 @ each) / slope**2
    spread = few**2 * float(np.sum(worth[:, None] * psi**2)) / freedom
    information = slope**2 / max(spread, _EXACT) * rows.T @ rows
    covariance = pseudo_inverse(information + pull.T @ pull)
    gradient = rows.T @ (np.sqrt(worth)[:, None] * psi).ravel() + pull.T @ tail
    free = ~fit.at_bound
    hessian = slope * rows.T @ rows + pull.T @ pull
    inner = pseudo_inverse(hessian[np.ix_(free, free)])
    decrement = float(gradient[free] @ inner @ gradient[free]) if free.any() else 0.0
    unbounded = np.stack([fit.x, np.sqrt(np.diag(covariance))])
    unbounded = beyond_bounds(unbounded, hessian, gradient, fit.at_bound, spread / slope)
    covariance[fit.at_bound] = 0.0
    covariance[:, fit.at_bound] = 0.0
    reason = fit.reason if settled or not fit.converged else "noise and fit did not settle on each other"
    if fit.converged and settled and decrement >= _DECREMENT:
        reason = f"a step would still lower the objective by {decrement:.1e}"
    return replace(fit, covariance=covariance, freedom=freedom, sigma=1.0, reason=reason, unbounded=unbounded)
