"""One step of a trust-region method for least squares, inside bounds.

    minimise  g'p + p'B p / 2   over  |p| <= radius,  low <= p <= high,      B = J'J

in scaled variables, where the columns of J have length one or less. The radius is met by the shift mu of
(B + mu I) p = -g (Moré and Sorensen 1983), from the eigenvalues of B; where those are too small to be seen in
J'J, from the singular values of J itself. A bound that the step would cross is met, and the others are solved
again. Units: none. Directions whose singular value lies below rounding get no step.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np
from scipy import linalg
from scipy.linalg import lapack

from exactarm.numerics.factors import svd

_SQUARED = 1e-10  # eigenvalue beside the largest, below which J'J leaves less than six digits of it
_ROUNDING = 1e-14  # singular value beside the largest, below which it is rounding
_SURE = 1e-3  # smallest of a Cholesky factor's diagonal beside the largest: no direction near rounding
_FEW = 0.2  # share of columns nearly dependent on the others, where parting them costs a third of a QR of all
# singular value of what is left of columns beside others, to the largest: known to a percent, and rounding
_SEEN, _LOST = 1e-12, 1e-14
_SHIFT_ROUNDS = 60
_RADIUS_MET = 0.05  # relative


class Model:
    """The quadratic model at a point: J = weight (R,) times the rows of `jacobian` (R, P), residual (R,) as
    weight times predicted minus measured; its variables are x * unit (P,).

    normal (P, P) = J'J, worked out here where it is not known, and downhill (P,) = J'r, not scaled; gram and
    gradient are those of J / unit.
    """

    def __init__(self, jacobian: np.ndarray, residual: np.ndarray, unit: np.ndarray | None = None, *,
                 weight: np.ndarray | None = None, normal: np.ndarray | None = None):
        self.jacobian, self.residual = jacobian, residual
        self.weight = np.ones(len(residual)) if weight is None else weight
        if normal is None:
            rows = self.weight[:, None] * jacobian
            normal = rows.T @ rows
        self.normal, self.downhill = normal, self.across(residual)
        self._scale(np.ones(jacobian.shape[1]) if unit is None else unit)

    def _columns(self, which: np.ndarray) -> np.ndarray:
        """(R, k) some columns of J / unit, by their numbers."""
        columns = np.take(self.jacobian, which, axis=1)  # ten times as fast as an index
        columns *= self.weight[:, None]
        columns /= self.unit[which]
        return columns

    def across(self, values: np.ndarray) -> np.ndarray:
        """(P,) J'v of values v (R,)."""
        return self.jacobian.T @ (self.weight * values)

    def _scale(self, unit: np.ndarray) -> None:
        self.unit = unit
        self.gram, self.gradient = self.normal / unit / unit[:, None], self.downhill / unit
        self._spectra: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def scaled(self, unit: np.ndarray) -> Model:
        """The same model in other variables."""
        if np.array_equal(unit, self.unit):
            return self
        other = copy(self)
        other._scale(unit)
        return other

    def ahead(self, step: np.ndarray) -> np.ndarray:
        """(R,) the change of the prediction along `step`."""
        return self.weight * (self.jacobian @ (step / self.unit))

    def fall(self, step: np.ndarray) -> float:
        """How far the half square sum falls along `step`."""
        ahead = self.ahead(step)  # not by J'J: a long step along a weak direction would drown in rounding
        return -float(ahead @ (self.residual + 0.5 * ahead))

    def lowest(self, free: np.ndarray, gradient: np.ndarray) -> np.ndarray | None:
        """(f,) the minimum of the quadratic form over the free variables; None where it has directions so
        weak that the spectrum has to say which of them are seen."""
        gram = self.gram[np.ix_(free, free)]
        try:
            factor = linalg.cho_factor(gram, check_finite=False)
        except linalg.LinAlgError:
            return self._lowest_in_two(gram, free, gradient)
        sizes = np.diag(factor[0])
        if not sizes.min(initial=np.inf) > _SURE * sizes.max(initial=0.0):
            return self._lowest_in_two(gram, free, gradient)
        return -linalg.cho_solve(factor, gradient, check_finite=False)

    def _lowest_in_two(self, gram: np.ndarray, free: np.ndarray, gradient: np.ndarray) -> np.ndarray | None:
        """The same where few columns are nearly dependent on the others: what is left of these beside the
        others is taken from J itself, for J'J holds too few digits of it. Of all minima the shortest, where
        directions are lost in rounding; None where columns are many, or a direction is neither lost nor
        seen."""
        lower, order, _, _ = lapack.dpstrf(gram, lower=1)
        sizes, order = np.diag(lower), order - 1
        strong = int(np.argmin(np.append(sizes, -np.inf) > _SURE * sizes[0]))  # the first that is not
        if len(sizes) - strong > _FEW * len(sizes):
            return None
        factor = (lower[:strong, :strong], True)
        one, other = order[:strong], order[strong:]
        if strong == len(sizes):  # pivoting has shown that none depends on the others
            return -linalg.cho_solve(factor, gradient[one], check_finite=False)[np.argsort(one)]
        columns = self._columns(np.flatnonzero(free)[order])
        part = linalg.cho_solve(factor, gram[np.ix_(one, other)], check_finite=False)
        left = columns[:, strong:] - columns[:, :strong] @ part
        again = linalg.cho_solve(factor, columns[:, :strong].T @ left, check_finite=False)
        part, left = part + again, left - columns[:, :strong] @ again
        singular, rows = svd(linalg.qr(left, mode="r", check_finite=False)[0][: left.shape[1]])[1:]
        seen, lost = singular > _SEEN * sizes[0], singular < _LOST * sizes[0]
        if not np.all(seen | lost):
            return None
        onto = rows @ (gradient[other] - part.T @ gradient[one])
        step, unseen = np.empty(len(order)), np.empty((len(order), int(lost.sum())))
        step[other] = -rows[seen].T @ (onto[seen] / singular[seen] ** 2)
        step[one] = -linalg.cho_solve(factor, gradient[one], check_finite=False) - part @ step[other]
        unseen[other], unseen[one] = rows[lost].T, -part @ rows[lost].T
        return step - unseen @ linalg.solve(unseen.T @ unseen, unseen.T @ step) if lost.any() else step

    def spectrum(self, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Eigenvalues (f,) and vectors (f, f) of B on the free variables, rounding as zero."""
        key = free.tobytes()
        if key not in self._spectra:
            self._spectra[key] = self._spectrum(free)
        return self._spectra[key]

    def _spectrum(self, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, vectors = linalg.eigh(self.gram[np.ix_(free, free)], check_finite=False)
        if values.size and values[0] < _SQUARED * values[-1]:
            columns = self._columns(np.flatnonzero(free))
            upper = linalg.qr(columns, mode="r", check_finite=False)[0][: values.size]
            singular, rows = svd(upper, full_matrices=False)[1:]
            rows = rows if len(rows) == values.size else svd(upper)[2]
            values, vectors = np.zeros(values.size), rows.T
            values[: singular.size] = np.where(singular > _ROUNDING * singular[0], singular, 0.0) ** 2
        return values, vectors


@dataclass(frozen=True)
class Step:
    """step (P,); shift: mu, 0 where the radius does not bind; free (P,) bool: not held by a bound."""

    step: np.ndarray
    shift: float
    free: np.ndarray


def bounded_step(model: Model, low: np.ndarray, high: np.ndarray, radius: float) -> Step:
    """The best step inside radius and bounds (low <= 0 <= high), one bound after the other.

    A variable on its bound that the gradient pushes outwards is held; one that would cross its bound is set
    on it.
    """
    gradient = model.gradient
    free = ~(((low >= 0.0) & (gradient > 0.0)) | ((high <= 0.0) & (gradient < 0.0)))
    step, shift = np.zeros(len(gradient)), 0.0
    while free.any():
        right = gradient[free] + model.gram[np.ix_(free, ~free)] @ step[~free]
        left = np.sqrt(max(radius**2 - float(step[~free] @ step[~free]), 0.0))
        whole = model.lowest(free, right) if radius == np.inf else None
        step[free], shift = _inside(*model.spectrum(free), right, left) if whole is None else (whole, 0.0)
        out = free & ((step < low) | (step > high))
        if not out.any():
            break
        step[out] = np.clip(step[out], low[out], high[out])
        free = free & ~out
    if model.fall(step) <= 0.0 and not free.all():
        step, shift, free = _one_by_one(model, low, high, radius)
    return Step(step, shift, free)


def _one_by_one(model: Model, low: np.ndarray, high: np.ndarray, radius: float):
    """Holds what stands on a bound that the step would cross, and goes to the first bound met: always a
    fall."""
    gradient = model.gradient
    free = ~(((low >= 0.0) & (gradient > 0.0)) | ((high <= 0.0) & (gradient < 0.0)))
    while free.any():
        step = np.zeros(len(gradient))
        step[free], shift = _inside(*model.spectrum(free), gradient[free], radius)
        stuck = free & (((low >= 0.0) & (step < 0.0)) | ((high <= 0.0) & (step > 0.0)))
        if not stuck.any():
            with np.errstate(divide="ignore", invalid="ignore"):
                reach = np.where(step > 0.0, high / step, np.where(step < 0.0, low / step, np.inf))
            return min(1.0, float(reach.min())) * step, shift, free
        free = free & ~stuck
    return np.zeros(len(gradient)), 0.0, free


def _inside(values, vectors, gradient, radius: float) -> tuple[np.ndarray, float]:
    """(step, shift): the minimum of the quadratic form with these eigenvalues and vectors inside the
    radius."""
    onto = vectors.T @ gradient
    seen = values > _ROUNDING**2 * values.max(initial=0.0)
    step = np.zeros(len(values))
    step[seen] = -onto[seen] / values[seen]
    if np.linalg.norm(step) <= radius:
        return vectors @ step, 0.0
    if radius <= 0.0:
        return np.zeros(len(values)), 0.0
    least, most = 0.0, float(np.linalg.norm(onto[seen])) / radius
    shift = 1e-3 * most
    for _ in range(_SHIFT_ROUNDS):
        step[seen] = -onto[seen] / (values[seen] + shift)
        length = float(np.linalg.norm(step))
        if abs(length / radius - 1.0) < _RADIUS_MET:
            break
        least, most = (shift, most) if length > radius else (least, shift)
        slope = float(np.sum(onto[seen] ** 2 / (values[seen] + shift) ** 3)) / length
        newton = shift + (length - radius) / radius * length / slope
        shift = newton if least < newton < most else max(np.sqrt(least * most), 1e-3 * most)
    return vectors @ step, shift
