"""Estimates the noise of independent rows from the residuals of a fit.

Families, by their likelihood (each further parameter pays half the logarithm of the number of rows):

    gauss    one normal law
    student  multivariate t with 30, 10, 5 or 3 degrees of freedom (Lange, Little and Taylor 1989)
    gross    either of them, and a few rows (at most a fifth) from a law 5 to 100,000 times as wide,
             which is estimated: broken beams, exchanged rows, another unit

each with one scale for all components of a kind (positions, orientations), or one for every component. A row
of the last family is wrong by itself where that is more than 99 % probable; its weight is zero. That there
are such rows at all is as probable as all families with them beside all without.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import special

from exactarm.noise.jumps import jumps_of
from exactarm.noise.model import NoiseModel
from exactarm.noise.rounding import evened
from exactarm.noise.wandering import gain_of, wandering_of
from exactarm.numerics.together import lie_together

FREEDOMS = (30.0, 10.0, 5.0, 3.0)
# width of wrong rows, times the noise: below the least a Student law of 3 degrees of freedom has such rows by
# itself; the most is a hundred metres beside a millimetre; the estimate begins with the last
_LEAST_GROSS, _MOST_GROSS, _FIRST_GROSS = 5.0, 1e5, 100.0
_MOST_WRONG = 0.2
_SURELY_WRONG = 0.99
_PASSES = 60
# rows beyond the first of their pose, below which nothing is said of what visits share
_LEAST_ROWS_A_VISIT = 10
# variance within visits, of all of a row: visits that agree better (copied rows, whose difference is exactly
# nothing) say the same thing once, and rows may be divided by this noise without losing their digits
_LEAST_WITHIN = 1e-6
_LEAST_SIGMA = 1e-9  # m, rad: no instrument that follows an arm resolves less; exact data's rounding is below


def estimate_noise(
    residual: np.ndarray, lost: float | np.ndarray = 0.0, visits: np.ndarray | None = None,
    order: np.ndarray | None = None, place: np.ndarray | None = None, rounding: np.ndarray | None = None,
    declared: np.ndarray | None = None,
) -> NoiseModel:
    """The best family for residuals (N, m); lost: parameters that were fitted to them, in all or to each
    component (m,), the precise ones having the most; visits (N,): numbers of poses; order (N,): places of the
    rows in the order in which they were measured; place (N, d): where they were measured. Rows that lie
    together there are not wrong by themselves. rounding, declared: as `normal_noise` takes them."""
    rows, m = residual.shape
    if rounding is not None:
        normal = normal_noise(residual, lost, visits, rounding, declared)
        visits, rounding = normal.visits, normal.rounding
    e = _without_rounding(_blown(residual, lost), rounding)
    lost = float(np.sum(lost))
    found, further = [], []  # parameters beyond those of one normal law
    for kinds in (_kinds(residual), np.ones(m, int)):
        for nu in (np.inf, *FREEDOMS):
            found += [_student(e, kinds, nu), _gross(e, kinds, nu)]
            scales = len(kinds) - len(_kinds(residual)) + np.isfinite(nu)
            further += [scales, scales + 2.0]  # share and width of the gross rows
    price = 0.5 * np.log(rows) * np.array(further)
    values = np.array([model.log_likelihood for model in found]) - price
    seem = found[1].wrong  # beside a normal law: a structure makes heavy tails, too
    in_space, in_time = (at is not None and lie_together(residual, seem, at) for at in (place, order))
    if in_space or in_time:
        values[1::2] = -np.inf
    together = int(seem.sum()) if in_space else 0
    wrong = special.expit(special.logsumexp(values[1::2]) - special.logsumexp(values[::2]))
    found = [replace(model, wrong_probability=float(wrong)) for model in found]
    best = _with_visits(found[int(np.argmax(values))], residual, lost, visits, rounding)
    if order is None:
        return replace(best, together=together)
    # Jumps of an instrument look like heavy tails as long as nothing is known of them: a normal law is tried
    # beside the best.
    normal = max((k for k, model in enumerate(found) if model.family == "gauss"), key=lambda k: values[k])
    tried = {int(np.argmax(values)): best} | {
        normal: _with_visits(found[normal], residual, lost, visits, rounding)}
    wandering = {k: _wandering(model, e, order) for k, model in tried.items()}
    gain = {k: values[k] + (model.wandering.gain if model.wandering is not None else 0.0)
            for k, model in wandering.items()}
    best = wandering[max(gain, key=lambda k: gain[k])]
    if best.wandering is None:
        return replace(best, together=together)
    white = lambda columns: columns * (np.sqrt(best.weight)[:, None] / best.sigma)[:, :, None]
    jumps = jumps_of(white(e[:, :, None])[:, :, 0], best.weight, order,
                     None if declared is None else white(declared), best.wandering)
    return replace(best, jumps=jumps)


def _with_visits(noise: NoiseModel, residual: np.ndarray, lost: float, visits: np.ndarray | None,
                 rounding: np.ndarray | None) -> NoiseModel:
    """With what visits of one pose share, by the residuals (N, m) as the fit has left them."""
    if visits is None:
        return noise
    numbers = np.unique(visits, return_inverse=True)[1]
    known, alike = None, numbers
    if rounding is not None:
        known = np.sum((rounding / noise.sigma[:, None]) ** 2, axis=2)
        # seen from elsewhere, the same error points another way
        key = np.round(rounding / np.max(np.abs(rounding)), 6).reshape(len(rounding), -1)
        alike = np.unique(np.column_stack([numbers, key]), axis=0, return_inverse=True)[1].ravel()
    shared, within = _shared(residual / noise.sigma, noise.weight, alike, lost, known)
    return replace(noise, sigma=noise.sigma * np.sqrt(within), visits=numbers, shared=shared,
                   rounding=rounding)


def _wandering(noise: NoiseModel, e: np.ndarray, order: np.ndarray) -> NoiseModel:
    """With what neighbours in the order of the rows share, where they share anything."""
    found = wandering_of(_white(noise, e), order, noise.seen)
    if found is None:
        return noise
    return replace(noise, sigma=noise.sigma * np.sqrt(found.scale), wandering=found, order=order)


def _white(noise: NoiseModel, e: np.ndarray) -> np.ndarray:
    return noise.whiten(e[:, :, None]).reshape(e.shape)


def normal_noise(residual: np.ndarray, lost: float | np.ndarray = 0.0, visits: np.ndarray | None = None,
                 rounding: np.ndarray | None = None, declared: np.ndarray | None = None) -> NoiseModel:
    """One normal law for residuals (N, m), every row of full weight.

    rounding (N, m, n): what the rounding of each axis does to the rows, if they are rounded: commanded angles
    may lie on a grid, too. The likelier of the two is taken, what visits share beside it paying half the
    logarithm of the number of rows; declared (N, m, b): a basis of what was fitted, which takes more from
    some rows than from others."""
    if rounding is None:
        return _with_visits(_student(residual, _kinds(residual), np.inf), residual, float(np.sum(lost)),
                            visits, None)
    e, visits = _blown(residual, lost), np.arange(len(residual)) if visits is None else visits
    found = [_with_visits(_student(_without_rounding(e, known), _kinds(e), np.inf), residual,
                          float(np.sum(lost)), visits, known) for known in (None, rounding)]
    price = lambda noise: 0.5 * np.log(len(residual)) if noise.shared > 0.0 else 0.0
    return max(found, key=lambda noise: noise.log_density(residual, declared) - price(noise))


def _blown(residual: np.ndarray, lost: float | np.ndarray) -> np.ndarray:
    """A fit leaves less than the noise."""
    rows, m = residual.shape
    each = np.broadcast_to(np.asarray(lost) / (m if np.ndim(lost) == 0 else 1), m)
    return residual * np.sqrt(rows / np.maximum(rows - each, 1.0))


def _without_rounding(residual: np.ndarray, rounding: np.ndarray | None) -> np.ndarray:
    return residual if rounding is None else evened(residual, rounding, _kinds(residual))


def _kinds(residual: np.ndarray) -> np.ndarray:
    """How many components are alike: positions, orientations."""
    return np.array([3, 3]) if residual.shape[1] == 6 else np.array([residual.shape[1]])


def log_likelihood_under(model: NoiseModel, residual: np.ndarray) -> float:
    """Of other residuals (N, m) under the family of a model, its scales refitted; what rows share in time as
    it is there."""
    alone = _log_likelihood_alone(model, _without_rounding(residual, model.rounding))
    if model.wandering is None:
        return alone
    base = replace(model, wandering=None)
    return alone + gain_of(_white(base, residual), model.order, base.seen, model.wandering.ratio,
                           model.wandering.memory)


def _log_likelihood_alone(model: NoiseModel, residual: np.ndarray) -> float:
    kinds = _kinds(residual)
    if np.ptp(model.sigma[:3]) > 0.0:
        kinds = np.ones(residual.shape[1], int)
    if model.family == "gross":
        return _gross(residual, kinds, model.freedom).log_likelihood
    return _student(residual, kinds, model.freedom).log_likelihood


def _squares(e: np.ndarray, kinds: np.ndarray) -> np.ndarray:
    """(N, K) square sum of every row over each kind of component."""
    return np.add.reduceat(e**2, np.cumsum(kinds) - kinds, axis=1)


def _scales(squares: np.ndarray, weight: np.ndarray, kinds: np.ndarray) -> np.ndarray:
    """(K,) root mean weighted square of each kind of component (positions alike, orientations alike)."""
    return np.maximum(np.sqrt(weight @ squares / (len(squares) * kinds)), _LEAST_SIGMA)


def _student(e: np.ndarray, kinds: np.ndarray, nu: float) -> NoiseModel:
    (rows, m), squares = e.shape, _squares(e, kinds)
    sigma = _robust(squares, kinds) if np.isfinite(nu) else _scales(squares, np.ones(rows), kinds)
    for _ in range(_PASSES if np.isfinite(nu) else 0):
        new = _scales(squares, _row_weight(squares @ sigma**-2.0, m, nu), kinds)
        done = np.all(np.abs(new / sigma - 1.0) < 1e-6)
        sigma = new
        if done:
            break
    square = squares @ sigma**-2.0
    value = float(np.sum(_log_density(square, m, nu)) - rows * (kinds @ np.log(sigma)))
    family = "student" if np.isfinite(nu) else "gauss"
    return NoiseModel(np.repeat(sigma, kinds), _row_weight(square, m, nu), family, nu, value)


def _robust(squares: np.ndarray, kinds: np.ndarray) -> np.ndarray:
    """(K,) scale from the median of the squares."""
    usual = 2.0 * special.gammaincinv(0.5 * kinds, 0.5)
    return np.maximum(np.sqrt(np.median(squares, axis=0) / usual), _LEAST_SIGMA)


def _gross(e: np.ndarray, kinds: np.ndarray, nu: float) -> NoiseModel:
    """A share of the rows from a normal law of its own width, the others normal or Student with nu degrees of
    freedom; share and width by expectation and maximisation (Dempster, Laird and Rubin 1977)."""
    (rows, m), squares = e.shape, _squares(e, kinds)
    sigma, share, width = _robust(squares, kinds), 0.02, _FIRST_GROSS
    for _ in range(_PASSES):
        square = squares @ sigma**-2.0
        good = np.log1p(-share) + _log_density(square, m, nu)
        bad = np.log(share) + _log_density(square / width**2, m, np.inf) - m * np.log(width)
        wrong = special.expit(bad - good)
        weight = _row_weight(square, m, nu)
        new = _scales(squares, (1.0 - wrong) * weight + wrong / width**2, kinds)
        share_new = float(np.clip(wrong.mean(), 0.5 / rows, _MOST_WRONG))
        width_new = np.sqrt((wrong @ square) / (m * max(float(wrong.sum()), 0.5)))
        width_new = float(np.clip(width_new, _LEAST_GROSS, _MOST_GROSS))
        settled = abs(share_new - share) < 1e-6 and abs(width_new / width - 1.0) < 1e-3
        done = settled and np.all(np.abs(new / sigma - 1.0) < 1e-6)
        sigma, share, width = new, share_new, width_new
        if done:
            break
    value = float(np.sum(np.logaddexp(good, bad)) - rows * (kinds @ np.log(sigma)))
    weight = np.where(wrong > _SURELY_WRONG, 0.0, weight)
    return NoiseModel(np.repeat(sigma, kinds), weight, "gross", nu, value)


def _log_density(square: np.ndarray, m: int, nu: float) -> np.ndarray:
    """(N,) log density of m components of unit scale, from their square sums; nu degrees of freedom,
    infinite: normal."""
    if not np.isfinite(nu):
        return -0.5 * m * np.log(2.0 * np.pi) - 0.5 * square
    constant = special.gammaln(0.5 * (nu + m)) - special.gammaln(0.5 * nu) - 0.5 * m * np.log(nu * np.pi)
    return constant - 0.5 * (nu + m) * np.log1p(square / nu)


def _row_weight(square: np.ndarray, m: int, nu: float) -> np.ndarray:
    return (nu + m) / (nu + square) if np.isfinite(nu) else np.ones(len(square))


def _shared(white: np.ndarray, weight: np.ndarray, visits: np.ndarray, lost: float,
            known: np.ndarray | None = None) -> tuple[float, np.ndarray | float]:
    """Variance that the visits of a pose share, in units of that within, and that within (analysis of
    variance, by moments). A fit takes its share of what the poses have in common, next to nothing of what
    visits differ by: all `lost` parameters are those of the means.

    known (N, m): variance of what visits share that is known. It is no longer in proportion to the noise, so
    that orientations have a scale of their own (m,), and the one within is the better measure of it."""
    counts = np.bincount(visits, weights=(weight > 0.0).astype(float))
    within_freedom = float(np.sum(np.maximum(counts - 1.0, 0.0)))
    if within_freedom < _LEAST_ROWS_A_VISIT:
        return 0.0, 1.0
    m = white.shape[1]
    total = np.bincount(visits, weights=weight)
    sums = [np.bincount(visits, weights=weight * white[:, k]) for k in range(m)]
    means = np.stack(sums, axis=1) / np.maximum(total, 1e-300)[:, None]
    inside = np.sum(weight[:, None] * (white - means[visits]) ** 2, axis=0)
    alike = np.array([m]) if known is None else _kinds(white)
    within = np.add.reduceat(inside, np.cumsum(alike) - alike) / (within_freedom * alike)
    within = np.repeat(np.maximum(within, _LEAST_WITHIN), alike)
    used = total > 0.0
    freedom = max(used.sum() * m - lost, 1.0)
    between = float(np.sum(total[used, None] * means[used] ** 2 / within)) / freedom
    if known is not None:
        between -= float(np.sum(weight[:, None] * known / within)) / (used.sum() * m)
    shared = (between - 1.0) / float(np.mean(total[used]))
    if shared <= 0.0:
        return 0.0, (1.0 if known is None else within)
    return shared, within
