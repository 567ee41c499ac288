"""Held-out error by cross-validation over whole poses or runs, in closed form.

In the linear picture around a fitted state, each fold f is predicted from the others' normal equations. Q:
orthonormal basis of the free parameters, r: whitened residual:

    Q'Q - Q_f'Q_f = L_f L_f',    P_f = Q_f L_f^-T,    e_f = r_f - P_f L_f^-1 (Q'r - Q_f'r_f)

is what the others predict wrongly. Beside further columns C, cleared of Q, with priors, W = -L_f^-1 Q_f'C_f:

    D = C_f - P_f W,    S = C'C - C_f'C_f + prior - W'W,
    e_f - D S^-1 (C'r - C_f'r_f - W' L_f^-1 (Q'r - Q_f'r_f))

so that the fit is parted once, whatever is tried beside it. A square of 1 is noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from exactarm.diagnose.decisions import RIDGE
from exactarm.diagnose.fitted import Fitted

_FOLDS = 10


def folds_of(groups: np.ndarray, seed: int) -> np.ndarray:
    """(N,) fold number from 0; a group stays whole."""
    names, inverse = np.unique(groups, return_inverse=True)
    order = np.random.default_rng(seed).permutation(len(names))
    return (order % min(_FOLDS, len(names)))[inverse]


@dataclass(frozen=True)
class _Fold:
    """rows (n,) of the design; Q_f (n, d), L_f (d, d), P_f (n, d), L_f^-1 (Q'r - Q_f'r_f) (d,), e_f (n,)."""

    rows: np.ndarray
    own: np.ndarray
    lower: np.ndarray
    others: np.ndarray
    right: np.ndarray
    error: np.ndarray


class CrossValidation:
    """basis (R, d) and residual (R,): those of the data first, row by row of `folds` (N,), then those of
    priors, which are in every fold's others."""

    def __init__(self, basis: np.ndarray, residual: np.ndarray, numbers: int, folds: np.ndarray):
        """numbers: so many of R are data."""
        self.basis, self.residual, self.numbers, self.folds = basis, residual, numbers, folds

    @staticmethod
    def of(fitted: Fitted, folds: np.ndarray) -> CrossValidation:
        """Of the free parameters of a fit."""
        return CrossValidation(fitted.basis, fitted.whitened, fitted.data_numbers, folds)

    @cached_property
    def _parts(self) -> list[_Fold]:
        order = np.argsort(np.repeat(self.folds, self.numbers // len(self.folds)), kind="stable")
        ends = np.cumsum(np.bincount(self.folds) * (self.numbers // len(self.folds)))
        whole, onto = self.basis.T @ self.basis, self.basis.T @ self.residual
        whole[np.diag_indices_from(whole)] += RIDGE
        found = []
        for rows in np.split(order, ends[:-1]):
            own, answer = self.basis[rows], self.residual[rows]
            lower = linalg.cholesky(whole - own.T @ own, lower=True, check_finite=False)
            others = _solved(lower, own.T).T
            right = _solved(lower, onto - own.T @ answer)
            found.append(_Fold(rows, own, lower, others, right, answer - others @ right))
        return found

    def _each(self, columns: np.ndarray | None,
              prior: np.ndarray | None) -> Iterator[tuple[_Fold, np.ndarray, np.ndarray]]:
        """Each fold with its error (n,) and D L_S^-T (n, k), S = L_S L_S': the uncertainty that the columns
        add to that of the others' prediction."""
        if columns is None or not columns.shape[1]:
            yield from ((part, part.error, part.own[:, :0]) for part in self._parts)
            return
        whole = np.linalg.norm(columns, axis=0)
        columns = columns - self.basis @ (self.basis.T @ columns)
        norm = np.linalg.norm(columns, axis=0)
        norm[norm < whole * np.sqrt(np.finfo(float).eps)] = 0.0  # rounding: the free parameters explain it
        penalty = np.zeros(len(norm)) if prior is None else 1.0 / prior**2
        size = np.sqrt(norm**2 + penalty)[norm > 0]  # a column of rounding is its prior
        columns, penalty = columns[:, norm > 0] / size, penalty[norm > 0] / size**2
        onto, normal = columns.T @ self.residual, columns.T @ columns + np.diag(penalty + RIDGE)
        for part in self._parts:
            own, answer = columns[part.rows], self.residual[part.rows]
            within = _solved(part.lower, -part.own.T @ own)
            lower = linalg.cholesky(normal - own.T @ own - within.T @ within, lower=True, check_finite=False)
            beyond = _solved(lower, (own - part.others @ within).T).T
            values = _solved(lower, onto - own.T @ answer - within.T @ part.right)
            yield part, part.error - beyond @ values, beyond

    def told_by_others(self, columns: np.ndarray) -> np.ndarray:
        """(folds,) share of what orthonormal columns (R, k), cleared of the basis, tell that they still tell
        where a fold is left out: trace S / k."""
        found = []
        for part in self._parts:
            own = columns[part.rows]
            within = _solved(part.lower, -part.own.T @ own)
            found.append(1.0 - (np.sum(own**2) + np.sum(within**2)) / max(columns.shape[1], 1))
        return np.array(found)

    def squares(self, columns: np.ndarray | None = None, prior: np.ndarray | None = None) -> np.ndarray:
        """(folds,) square sum of the held-out residual with the free parameters and `columns` (R, k), if any,
        refitted.

        prior (k,): standard deviations of the priors of the columns' coefficients, inf = none.
        """
        return np.bincount(self.folds, weights=np.sum(self.numbers_squared(columns, prior), axis=1))

    def numbers_squared(self, columns: np.ndarray | None = None,
                        prior: np.ndarray | None = None) -> np.ndarray:
        """(N, m) squares of the held-out residual, number by number."""
        squares = np.empty(self.numbers)
        for part, error, _ in self._each(columns, prior):
            squares[part.rows] = error**2
        return squares.reshape(len(self.folds), -1)

    def deviances(self, columns: np.ndarray | None = None, prior: np.ndarray | None = None) -> np.ndarray:
        """(folds,) -2 log density, up to a constant, of each fold as the others predict it, with the
        uncertainty of their prediction:

            e' V^-1 e + log det V,    V = I + X C X',    C: covariance of the coefficients without the fold

        by Woodbury's identity. Where a fold lies far from the others, what they cannot know of it is no error
        of the model.
        """
        found = []
        for part, error, beyond in self._each(columns, prior):
            spread = np.concatenate([part.others, beyond], axis=1)
            lower = linalg.cholesky(np.eye(spread.shape[1]) + spread.T @ spread, lower=True)
            shared = _solved(lower, spread.T @ error)
            found.append(float(error @ error - shared @ shared + 2.0 * np.sum(np.log(np.diag(lower)))))
        return np.array(found)

    def unknown(self, columns: np.ndarray | None = None, prior: np.ndarray | None = None) -> np.ndarray:
        """(folds,) what `squares` by folds are expected to hold beside the noise, if the model is right:
        trace of X C X', for what the others do not know of the coefficients."""
        return np.array([np.sum(part.others**2) + np.sum(beyond**2)
                         for part, _, beyond in self._each(columns, prior)])


def _solved(lower: np.ndarray, right: np.ndarray) -> np.ndarray:
    return linalg.solve_triangular(lower, right, lower=True, check_finite=False)
