"""A layout at its estimate, and its linear picture: what the free parameters explain, and what candidates
would.

Q (R, b): orthonormal basis of the whitened columns of the free parameters; C (R, k): those of a candidate.
All that a scan asks of C are its products with itself, with Q and with the residual. Without an effect of the
fit, the directions U = Q h of Q are no longer free:

    C'C - C'Q Q'C + (h'Q'C)'(h'Q'C),    residual + U U'w,  w the whitened residual without the effect

so that every place of a fit is contested with the products of one scan.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import linalg

from exactarm.chain import Layout, View
from exactarm.data.dataset import Dataset
from exactarm.effects.base import Effect, Parameter
from exactarm.identify.layout_fit import Drawing, pulls_of
from exactarm.numerics.orthonormal import extended, narrowed, orthonormal
from exactarm.numerics.quadratic import variances
from exactarm.numerics.regression import Fit
from exactarm.robot.robot import Robot

_BLOCK_COLUMNS = 192  # of candidates, at once in memory


@dataclass(frozen=True)
class Products:
    """Of a candidate's columns C (R, k) with a fit: square (k,) length of each, absorbed (b, k) Q'C, normal
    (k, k) of what is left of them, onto (k,) C'r, r what the free parameters leave."""

    square: np.ndarray
    absorbed: np.ndarray
    normal: np.ndarray
    onto: np.ndarray

    @staticmethod
    def of(gram: np.ndarray, absorbed: np.ndarray, onto: np.ndarray) -> Products:
        """gram (k, k) = C'C."""
        return Products(np.diag(gram), absorbed, gram - absorbed.T @ absorbed, onto)

    def without(self, turn: np.ndarray, back: np.ndarray) -> Products:
        """Where the directions turn (b, g) of the basis are no longer free, along which the residual has back
        (g,)."""
        shared = turn.T @ self.absorbed
        return Products(self.square, self.absorbed, self.normal + shared.T @ shared,
                        self.onto + shared.T @ back)


@dataclass(frozen=True)
class Fitted:
    """A layout at its estimate on the identification rows.

    residual (N, m) measured minus predicted; jacobian (N, m, P) of the prediction; sigma (m,) standard
    deviation of each component; weight (N,) 0 for rows that are left out, 1 otherwise; noise: what else is
    known of the noise, in the terms of the problem, for the next fit to begin with; drawing: declared
    parameters that the fit draws to their declared values.
    """

    robot: Robot
    layout: Layout
    fit: Fit
    residual: np.ndarray
    jacobian: np.ndarray
    sigma: np.ndarray
    weight: np.ndarray
    view: View
    noise: object = field(default=None, kw_only=True)
    drawing: Drawing = field(default_factory=dict, kw_only=True)
    # the fit that this one is a part of, and (P,) bool: its parameters that are not of this one
    _taken_from: tuple[Fitted, np.ndarray] | None = field(default=None, init=False, repr=False, compare=False)
    # of candidates that contests have asked for
    _products: dict[Effect, Products] = field(default_factory=dict, init=False, repr=False, compare=False)

    @cached_property
    def scale(self) -> np.ndarray:
        """(N, m) what a residual is multiplied with to have unit variance."""
        return self.weight[:, None] / self.sigma

    @cached_property
    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """Pseudo-observations (r, P) of the regularised parameters, and what they lack (r,)."""
        rows, centre = pulls_of(self.layout, self.drawing)
        return rows, rows @ (centre - self.layout.values)

    @property
    def prior_rows(self) -> np.ndarray:
        """(r, P) pseudo-observations of the regularised parameters."""
        return self.prior[0]

    @cached_property
    def whitened(self) -> np.ndarray:
        """(N m + r,) the residual with unit variance, then the pseudo-residuals of the priors."""
        return np.concatenate([self.standard(self.residual[:, :, None]).ravel(), self.prior[1]])

    @property
    def design(self) -> np.ndarray:
        """(N m + r, P) whitened columns of the free parameters, then the rows of the priors."""
        return np.concatenate([self.standard(self.jacobian), self.prior_rows])

    @cached_property
    def free_residual(self) -> np.ndarray:
        """The whitened residual without what the free parameters could still explain."""
        if self._part is not None:
            return (self._part.whole.free_residual + self._part.directions @ self._part.back)[self._part.rows]
        return self.cleared(self.whitened)

    def cleared(self, columns: np.ndarray) -> np.ndarray:
        """(N m + r, ...) of columns, what the free parameters cannot explain."""
        if self._part is None:
            return columns - self.basis @ (self.basis.T @ columns)
        whole = np.zeros((len(self._part.rows), *columns.shape[1:]))
        whole[self._part.rows] = columns
        back = self._part.directions @ (self._part.directions.T @ whole)
        return (self._part.whole.cleared(whole) + back)[self._part.rows]

    def without(self, index: int) -> Fitted:
        """The linear picture of the fit without the effect at `index` of the layout."""
        where = self.layout.slices[index]
        keep = np.ones(self.layout.size, bool)
        keep[where] = False
        layout = self.layout.only(k for k in range(len(self.layout.effects)) if k != index)
        # A non-linear parameter (an order) is no part of what the effect has moved: its linear ones have
        # moved it all.
        linear = np.array([not p.search for p in self.layout.parameters[where]], bool)
        residual = self.residual + self.jacobian[:, :,
                                                 where] @ np.where(linear, self.layout.values[where], 0.0)
        narrower = replace(self, layout=layout, residual=residual, view=self.view.leaving(residual),
                           jacobian=np.take(self.jacobian, np.flatnonzero(keep), axis=2))
        vars(narrower)["_taken_from"] = self, ~keep
        return narrower

    @property
    def taken(self) -> tuple[list[Parameter], np.ndarray, np.ndarray]:
        """Of a fit without an effect: the linear parameters of that effect that were free, their values (k,)
        and whitened columns (N m + r, k), as in the fit with it."""
        whole, gone = self._taken_from
        linear = np.array([not p.search for p in whole.layout.parameters], bool) & gone
        named = [p for p, keep in zip(whole.layout.parameters, linear) if keep]
        return named, whole.layout.values[linear], self.whiten(whole.jacobian[:, :, linear])

    def variance_of(self, jacobian: np.ndarray) -> np.ndarray:
        """(K, m) of predictions with a Jacobian (K, m, P), by what the fit leaves unknown."""
        return variances(jacobian, self.fit.covariance)

    @property
    def data_numbers(self) -> int:
        """N m: so many entries of `whitened` are data."""
        return self.residual.size

    def decorrelated(self, values: np.ndarray) -> np.ndarray:
        """(N, m, ...) behind the filter that makes the noise of neighbouring rows independent; here there is
        none."""
        return values

    def standard(self, values: np.ndarray) -> np.ndarray:
        """(N, m, k) of the measurement as (N m, k) in units of its noise."""
        return (self.decorrelated(values) * self.scale[:, :, None]).reshape(self.data_numbers, -1)

    def square(self, like: Fitted) -> float:
        """Square sum of the residual in the noise of `like`, so that different fits can be compared."""
        return float(np.sum((self.weight[:, None] * like.decorrelated(self.residual) / like.sigma) ** 2))

    @cached_property
    def basis(self) -> np.ndarray:
        """(N m + r, b) orthonormal basis of what the free parameters can explain."""
        if self._part is None:
            return orthonormal(self.design)
        whole, gone = self._taken_from
        return narrowed(whole.basis, whole.coordinates, gone)[self._part.rows]

    @cached_property
    def _part(self) -> _Part | None:
        """How the basis of the fit that this one is taken from narrows; None where there is none, or its
        columns are dependent."""
        if self._taken_from is None or self._taken_from[0].coordinates is None:
            return None
        return _Part.of(self, *self._taken_from)

    @cached_property
    def coordinates(self) -> np.ndarray | None:
        """(P, P) inverse of the columns' coordinates in the basis; None where they are dependent, or it holds
        others."""
        if self.basis.shape[1] != self.layout.size:
            return None
        return linalg.inv(self.basis.T @ self.design, check_finite=False)

    @cached_property
    def spent(self) -> float:
        """Numbers of the data that the free parameters have used up: their count, less what priors pay
        for."""
        if self._part is not None:
            gone = self._part.directions[: self.data_numbers].ravel(order="K")
            return self._part.whole.spent - float(gone @ gone)
        data = self.basis[: self.data_numbers].ravel(order="K")
        return float(data @ data)

    @cached_property
    def determined(self) -> np.ndarray:
        """(N m, d) orthonormal basis of what the free parameters explain, without what their priors determine
        more than the data do."""
        data = self.basis[: self.data_numbers]
        if not len(self.prior_rows):
            return data
        share, vectors = linalg.eigh(data.T @ data)
        return data @ (vectors[:, share > 0.5] / np.sqrt(share[share > 0.5]))

    def beside(self, columns: np.ndarray) -> Fitted:
        """The same fit, in whose linear picture further whitened columns (N m + r, k) are free too."""
        wider = replace(self)
        vars(wider)["basis"] = extended(self.basis, columns)  # in the place of the cached one
        return wider

    def columns(self, effect: Effect) -> np.ndarray:
        """(N m + r, k) whitened response to the parameters of an effect that is not in the layout."""
        return self.whiten(self.responses_of([effect])[0])

    def responses_of(self, effects: list[Effect]) -> list[np.ndarray]:
        """(N, m, k) of each effect that is not in the layout: the measurement's response to its
        parameters."""
        return [self.view.response(effect)[:, : self.residual.shape[1]] for effect in effects]

    def products_of(self, effects: list[Effect], masks: list[np.ndarray]) -> list[Products]:
        """Of the linear parameters (k,) bool of each effect that is not in the layout."""
        if self._part is None:
            return self._scanned(effects, masks)
        whole, kept = self._part.whole, self._part.whole._products
        new = [place for place, effect in enumerate(effects) if effect not in kept]
        found = whole.products_of([effects[k] for k in new], [masks[k] for k in new])
        kept |= zip((effects[k] for k in new), found)
        return [kept[effect].without(self._part.turn, self._part.back) for effect in effects]

    def along(self, pattern: np.ndarray) -> Callable[[np.ndarray], Products]:
        """Values (N, k) -> products of the columns that move the measurement along `pattern` (N, m) by
        them."""
        return lambda values: self._products_of(self.standard(pattern[:, :, None] * values[:, None]))

    def _products_of(self, columns: np.ndarray) -> Products:
        """Of columns (N m, k)."""
        seen = np.flatnonzero(columns.any(axis=1))
        columns = columns[seen]
        return Products.of(columns.T @ columns, self.basis[seen].T @ columns,
                           columns.T @ self.free_residual[seen])

    def _scanned(self, effects: list[Effect], masks: list[np.ndarray]) -> list[Products]:
        """By blocks of columns, for one product with the basis is far faster than many."""
        found, block, width = [], [], 0
        for place, (effect, mask) in enumerate(zip(effects, masks)):
            block.append((effect, mask))
            width += int(mask.sum())
            if width >= _BLOCK_COLUMNS or place == len(effects) - 1:
                found += self._scanned_together(block)
                block, width = [], 0
        return found

    def _scanned_together(self, block: list[tuple[Effect, np.ndarray]]) -> list[Products]:
        responses = self.responses_of([effect for effect, _ in block])
        free = [each[:, :, mask] for each, (_, mask) in zip(responses, block)]
        stacked = self.whiten(np.concatenate(free, axis=2))
        absorbed, onto = self.basis.T @ stacked, self.free_residual @ stacked  # r is clear of the basis
        found, at = [], 0
        for width in (each.shape[2] for each in free):
            where = slice(at, at := at + width)
            part = stacked[:, where]
            found.append(Products.of(part.T @ part, absorbed[:, where], onto[where]))
        return found

    def whiten(self, response: np.ndarray) -> np.ndarray:
        """(N m + r, k) of a response (N, m, k), in units of the noise, with nothing in the rows of the
        priors."""
        white = np.zeros((self.data_numbers + len(self.prior_rows), response.shape[2]))
        data = white[: self.data_numbers].reshape(response.shape)
        np.multiply(self.decorrelated(response), self.scale[:, :, None], out=data)
        return white


@dataclass(frozen=True)
class _Part:
    """whole: the fit that has more; rows (R,) bool of it that stay; turn (b, g): the directions of its basis
    that are no longer free, directions (R, g) as columns; back (g,): what the residual has along them."""

    whole: Fitted
    rows: np.ndarray
    turn: np.ndarray
    directions: np.ndarray
    back: np.ndarray

    @staticmethod
    def of(part: Fitted, whole: Fitted, gone: np.ndarray) -> _Part:
        pulled = np.any(whole.prior_rows[:, gone] != 0.0, axis=1)  # rows of what is gone
        rows = np.concatenate([np.ones(whole.data_numbers, bool), ~pulled])
        turn = linalg.qr(whole.coordinates[gone].T, mode="economic", check_finite=False)[0]
        directions = whole.basis @ turn
        return _Part(whole, rows, turn, directions, directions[rows].T @ part.whitened)


def rows_judged(layout: Layout, view: View, fitted: Dataset) -> np.ndarray:
    """(N,) bool: rows that every effect keeps, but for those of which the rows fitted do not say whether one
    acts there (all the same where they say it of none)."""
    undecided = rows_undecided(layout, fitted, view.data)
    return rows_kept(layout, view) & (~undecided | undecided.all())


def rows_undecided(layout: Layout, fitted: Dataset, other: Dataset) -> np.ndarray:
    """(N,) bool: rows of `other` of which those fitted do not say whether an effect acts there."""
    undecided = np.zeros(len(other), bool)
    for effect in layout.effects:
        there = effect.undecided(fitted, other)
        undecided |= False if there is None else there
    return undecided


def rows_kept(layout: Layout, view: View) -> np.ndarray:
    """(N,) bool: rows that every effect of the layout keeps."""
    keep = np.ones(view.rows, bool)
    for effect in layout.effects:
        kept = effect.keep(view)
        if kept is not None:
            keep &= kept
    return keep
