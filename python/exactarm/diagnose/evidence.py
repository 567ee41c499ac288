"""Evidence: marginal likelihood of sets of causes in the linear picture around a fit, noise variance
integrated out.

r (R,) whitened residual and C (R, p) whitened columns of the vocabulary, both cleared of what the declared
parameters D can absorb: C~ = C - Q Q'C, r~ = r - Q Q'r. With B the columns of a set M times their prior
sizes, V = I + B B':

    log p(r | M) = -1/2 log|V| - n/2 log(r' V^-1 r) + const,      n = independent numbers - rank(D)
    adding a block g:  H = S C_g' V^-1 C_g S,  y = S C_g' V^-1 r:
        log|V| += log|I + s^2 H|,   r' V^-1 r -= y' s^2 (I + s^2 H)^-1 y

All blocks of one width are scored at once, at every s by one H of three diagonals. A coefficient that cannot
be negative multiplies by P(b > 0 | r) / P(b > 0).
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg, special

from exactarm import _core
from exactarm.diagnose.cross_validation import CrossValidation
from exactarm.diagnose.decisions import ABSORBED, INVISIBLE
from exactarm.diagnose.vocabulary import SCALE_WEIGHTS, SCALES, Vocabulary
from exactarm.numerics.factors import cholesky
from exactarm.numerics.orthonormal import orthonormal

WEAKEST = 1e-7  # direction of the declared parameters beside the strongest, below which it absorbs nothing

_MOST_PRODUCTS = 40  # of a block's columns with all others, kept: a few hundred MB at most
_FAINT = 1e-9  # of the noise's variance: what varies by less changes no product by more than this share
_IN_CACHE = 64  # columns that are whitened at once


@dataclass(frozen=True)
class Additions:
    """For each block g: log weight (G,) of the set with it, less that of the set, summed over scales; best
    scale (G,) index."""

    log_weight: np.ndarray
    scale: np.ndarray


@dataclass(frozen=True)
class Members:
    """Blocks in a set with their scales, and the factor of V: `basis` (R, K) with B = basis, `inverse` = (I +
    B'B)^-1."""

    blocks: tuple[int, ...]
    scales: tuple[int, ...]


@dataclass(frozen=True)
class Absorbed:
    """What the declared parameters absorb under one noise: `basis` (R, d) of their whitened columns, and the
    residual (R,) without it.

    noise: `whiten`, `numbers` and `held_share`; measured: so many rows are data, then those of a prior;
    count: independent numbers that are left; spent (m,): those that the declared parameters take of each
    component of the measurement.
    """

    basis: np.ndarray
    residual: np.ndarray
    noise: object
    measured: int
    count: float
    spent: np.ndarray

    @staticmethod
    def of(residual: np.ndarray, declared: np.ndarray, noise,
           prior: tuple[np.ndarray, np.ndarray] | None = None) -> Absorbed:
        """residual (N, m), declared (N, m, P): columns that are free under a flat prior, or that of these
        pseudo-observations (q, P) and what they lack (q,)."""
        root = np.sqrt(noise.held_share)
        r = root * noise.whiten(residual[:, :, None])[:, 0]
        d = noise.whiten(declared)
        measured = len(r)
        if prior is not None:
            d, r = np.concatenate([root * d, prior[0]]), np.concatenate([r, prior[1]])
        basis = orthonormal(d, WEAKEST)
        # less what the prior pays for
        spent = np.sum(basis[:measured].reshape(len(residual), -1, basis.shape[1]) ** 2, axis=(0, 2))
        count = max(noise.numbers - float(spent.sum()), 1.0)
        return Absorbed(basis, r - basis @ (basis.T @ r), noise, measured, count, spent)

    def picture(self, vocabulary: Vocabulary, known: int = 0) -> Picture:
        """Of the columns of a vocabulary beside the declared ones and `known` causes."""
        c = np.empty((self.measured, vocabulary.width), order="F")  # read column by column
        for where, responses in vocabulary.strips(_IN_CACHE):
            c[:, where] = self.noise.whiten(responses)
        c *= np.sqrt(self.noise.held_share)
        absorbed, before = (c.T @ self.basis[: self.measured]).T, np.einsum("ij,ij->j", c, c)
        hidden = before - np.einsum("ij,ij->j", absorbed, absorbed) < ABSORBED * before
        c[:, hidden], absorbed[:, hidden] = 0.0, 0.0
        return Picture(vocabulary, self, absorbed, c, self.residual[: self.measured],
                       (absorbed, np.zeros(len(absorbed))), known)

    def parted(self, folds: np.ndarray) -> CrossValidation:
        """For the cross-validation of sets by folds (N,) of the rows of the data."""
        return CrossValidation(self.basis, self.residual, self.measured, folds)


class Picture:
    """The linear picture of one fit: columns, residual and count of independent numbers. Immutable by use.

    known: so many causes are in the fit or in the noise already;
    taken: (K, p) of the columns and (K,) of the residual, what the declared parameters absorb and what sets
    explain that have become part of the noise: all products are C'V^-1 C = C'C - taken'taken."""

    def __init__(self, vocabulary: Vocabulary, absorbed: Absorbed, crossed: np.ndarray, columns: np.ndarray,
                 residual: np.ndarray, taken: tuple[np.ndarray, np.ndarray], known: int = 0,
                 closed: frozenset[int] = frozenset(), before: Picture | None = None):
        self.closed, self.known = closed, known  # closed: blocks that are not to be added
        self.vocabulary, self.columns, self.residual = vocabulary, columns, residual
        self.absorbed, self.count, self.taken = absorbed, absorbed.count, taken
        self.crossed = crossed  # (d, p) Q'C
        self.before = before  # the picture without the last of these sets
        self.square = float(absorbed.residual @ absorbed.residual - taken[1] @ taken[1])
        self._product: dict[int, np.ndarray] = {}  # C_g'V^-1 C of blocks that have been members
        self._grams: dict[tuple[int, int], np.ndarray] = {}  # C_g'V^-1 C_h of two of them

    @staticmethod
    def of(vocabulary: Vocabulary, residual: np.ndarray, declared: np.ndarray, noise,
           prior: tuple[np.ndarray, np.ndarray] | None = None, known: int = 0) -> Picture:
        """As `Absorbed.of`, with the columns of a vocabulary."""
        return Absorbed.of(residual, declared, noise, prior).picture(vocabulary, known)

    def beside(self, members: Members) -> Picture:
        """The picture in which a set is part of the noise, its labels left out of the vocabulary: `taken` of
        all products."""
        blocks = self.vocabulary.blocks
        labels = {blocks[i].label for i in members.blocks if not blocks[i].repeatable}
        forms = frozenset().union(*(self.vocabulary.forms_of(i) for i in members.blocks))
        closed = frozenset(self.closed | {i for i, b in enumerate(blocks) if b.label in labels} | forms)
        cross, onto = self.factor(members)
        rows = np.asfortranarray(np.concatenate([self.taken[0], cross]))  # read column by column
        taken = rows, np.concatenate([self.taken[1], onto])
        return Picture(self.vocabulary, self.absorbed, self.crossed, self.columns, self.residual, taken,
                       self.known + len(members.blocks), closed, self)

    @cached_property
    def by_width(self) -> dict[int, np.ndarray]:
        """Width k -> indices of the blocks with k columns that may be added."""
        found = defaultdict(list)
        for index, block in enumerate(self.vocabulary.blocks):
            if index not in self.closed:
                found[block.columns].append(index)
        return {k: np.array(indices) for k, indices in sorted(found.items())}

    @cached_property
    def log_prior(self) -> np.ndarray:
        return np.array([block.log_prior for block in self.vocabulary.blocks])

    @cached_property
    def has_positive(self) -> np.ndarray:
        return np.array([bool(block.positive.any()) for block in self.vocabulary.blocks])

    @cached_property
    def onto(self) -> np.ndarray:
        """(p,) C'V^-1 r."""
        return self.columns.T @ self.residual - self.taken[0].T @ self.taken[1]

    @cached_property
    def lengths(self) -> np.ndarray:
        """(p,) square roots of the diagonal of C'V^-1 C."""
        square = sum(sign * np.einsum("ij,ij->j", each, each)
                     for sign, each in ((1.0, self.columns), (-1.0, self.taken[0])))
        return np.sqrt(np.maximum(square, 0.0))

    @cached_property
    def stacked(self) -> dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Width k -> (columns (g, k) of the matrix, sizes (g, k), C'V^-1 C (g, k, k)) of its blocks."""
        found = {}
        for k, indices in self.by_width.items():
            if self.before is not None:
                kept = np.isin(self.before.by_width[k], indices)
                which, size, gram = (part[kept] for part in self.before.stacked[k])
                part = self.taken[0][len(self.before.taken[0]) :, which.ravel()].reshape(-1, *which.shape)
                gram = gram - np.einsum("agi,agj->gij", part, part, optimize=True)
                found[k] = (which, size, gram)
                continue
            blocks = [self.vocabulary.blocks[i] for i in indices]
            which = np.array([np.arange(b.where.start, b.where.stop) for b in blocks])
            starts = {}
            for b in blocks:  # functions of several lengths share their columns
                if b.where.start not in starts:
                    starts[b.where.start] = self.between(b.where, b.where)
            gram = np.stack([starts[b.where.start] for b in blocks])
            found[k] = (which, np.stack([b.size for b in blocks]), gram)
        return found

    def sizes(self, members: Members) -> np.ndarray:
        """(K,) standard deviations of the coefficients of a set."""
        blocks = self.vocabulary.blocks
        parts = [SCALES[scale] * blocks[i].size for i, scale in zip(members.blocks, members.scales)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def factor(self, members: Members) -> tuple[np.ndarray, np.ndarray]:
        """F'C (k, p) and F'r (k,), F F' = B (I + B'B)^-1 B': what V^-1 takes off. Along the k eigenvectors of
        B'B with a variance beyond `_FAINT` of the noise's: waves of a smooth function say much the same."""
        if not members.blocks:
            return np.zeros((0, self.columns.shape[1])), np.zeros(0)
        product, where, scale = self._products(members)
        values, vectors = np.linalg.eigh(scale[:, None] * product[:, where] * scale)
        seen = values > _FAINT
        turned = (vectors[:, seen] / np.sqrt(1.0 + values[seen])).T * scale
        return turned @ product, turned @ self.onto[where]

    def _products(self, members: Members) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """C_B'V^-1 C (K, p), and of every column of B its place (K,) in C and its scale (K,)."""
        parts, where, scale = [], [], []
        for index, size in zip(members.blocks, members.scales):
            block = self.vocabulary.blocks[index]
            start = block.where.start
            if start not in self._product:
                if len(self._product) >= _MOST_PRODUCTS:
                    self._product.pop(next(iter(self._product)))
                self._product[start] = self.between(block.where, slice(None))
            parts.append(self._product[start])
            where.append(np.arange(block.where.start, block.where.stop))
            scale.append(SCALES[size] * block.size)
        return np.concatenate(parts), np.concatenate(where), np.concatenate(scale)

    def quadratic(self, members: Members) -> tuple[float, float]:
        """log|V| and r' V^-1 r of a set."""
        if not members.blocks:
            return 0.0, self.square
        gram, right = self._system(members)
        lower = cholesky(gram)
        onto = linalg.solve_triangular(lower, right, lower=True, check_finite=False)
        return 2.0 * float(np.sum(np.log(np.diag(lower)))), self.square - float(onto @ onto)

    def _system(self, members: Members) -> tuple[np.ndarray, np.ndarray]:
        """I + B'V^-1 B (K, K) and B'V^-1 r (K,) of a set."""
        blocks, size = [self.vocabulary.blocks[i] for i in members.blocks], self.sizes(members)
        gram = np.concatenate([np.concatenate([self._gram(one.where, other.where) for other in blocks],
                                              axis=1) for one in blocks])
        right = size * np.concatenate([self.onto[block.where] for block in blocks])
        return np.eye(len(size)) + size[:, None] * gram * size, right

    def between(self, one: slice, other: slice | np.ndarray) -> np.ndarray:
        """C_g'V^-1 C_h of two parts of the columns."""
        taken = self.taken[0]
        return self.columns[:, one].T @ self.columns[:, other] - taken[:, one].T @ taken[:, other]

    def _gram(self, one: slice, other: slice) -> np.ndarray:
        """C_g'V^-1 C_h of two blocks, kept."""
        key = (one.start, other.start)
        if key not in self._grams:
            self._grams[key] = self.between(one, other)
            self._grams[key[::-1]] = self._grams[key].T
        return self._grams[key]

    def log_likelihood(self, members: Members) -> float:
        """log p(r | M) less that of the empty set."""
        log_det, left = self.quadratic(members)
        return -0.5 * log_det - 0.5 * self.count * np.log(max(left, 1e-12 * self.square) / self.square)

    def coefficients(self, members: Members) -> list[np.ndarray]:
        """Posterior mean of the coefficients of every member, in units of the parameters."""
        if not members.blocks:
            return []
        values = np.linalg.solve(*self._system(members)) * self.sizes(members)
        return np.split(values, np.cumsum([self.vocabulary.blocks[i].columns for i in members.blocks])[:-1])

    def response(self, members: Members) -> np.ndarray | float:
        """(N, m) what a set adds to the measurement; 0 without members."""
        parts = (self.vocabulary.response(self.vocabulary.blocks[i].where) for i in members.blocks)
        return sum((part @ value for part, value in zip(parts, self.coefficients(members))), 0.0)

    def held_out(self, members: Members, parted: CrossValidation) -> float:
        """Square sum of the whitened residual of every fold, predicted from the others with a set."""
        return float(parted.squares(self._rows_of(members), np.ones(len(self.sizes(members)))).sum())

    def _rows_of(self, members: Members) -> np.ndarray:
        """(R, K) rows of the columns of a set times their standard deviations, those of a prior too: B."""
        columns, blocks = self.columns, self.vocabulary.blocks
        where = [np.arange(blocks[i].where.start, blocks[i].where.stop) for i in members.blocks]
        found = np.zeros((len(self.absorbed.residual), sum(map(len, where))))
        if where:
            found[: len(columns)] = columns[:, np.concatenate(where)] * self.sizes(members)
        return found

    def additions(self, members: Members) -> Additions:
        """Every block of the vocabulary beside the set, as if it were added next (its own prior included)."""
        cross, onto_r = self.factor(members)
        left = self.square - float(onto_r @ onto_r)
        y_all = self.onto - cross.T @ onto_r
        shape = len(SCALES), len(self.vocabulary.blocks)
        gains, price, sided = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        unseen = np.zeros(shape[1], bool)
        for k, indices in self.by_width.items():
            which, size, gram = self.stacked[k]
            part = cross[:, which.ravel()].reshape(len(cross), len(indices), k)
            h = gram - np.matmul(part.transpose(1, 2, 0), part.transpose(1, 0, 2)) if len(cross) else gram
            h = h * size[:, :, None] * size[:, None, :]
            y = y_all[which] * size
            gains[:, indices], price[:, indices] = _core.gains_by_scale(h, y, SCALES**2)
            for place in np.flatnonzero(self.has_positive[indices]):
                index = indices[place]
                sided[:, index] = self._one_sided(index, h[place], y[place], left - gains[:, index])
            unseen[indices] = np.einsum("gii->g", h) < INVISIBLE**2
        most = max(left, 1e-300)  # of exact data nothing is left
        ratio = np.log(np.maximum(1.0 - np.minimum(gains, most) / most, 1e-12))
        log_bf = sided - price - 0.5 * self.count * ratio + np.log(SCALE_WEIGHTS)[:, None]
        best = np.argmax(log_bf, axis=0)
        weight = special.logsumexp(log_bf, axis=0) + self.log_prior
        weight[unseen] = -np.inf
        weight[list(self.closed)] = -np.inf
        return Additions(weight, best)

    def _one_sided(self, index: int, h: np.ndarray, y: np.ndarray, left: np.ndarray) -> np.ndarray:
        """(s,) log of P(b > 0 | r) / P(b > 0), summed over the coefficients that cannot be negative."""
        values, vectors = np.linalg.eigh(h)
        square = SCALES[:, None] ** 2
        shrink, turned = square / (1.0 + square * np.maximum(values, 0.0)), y @ vectors
        rows = vectors[self.vocabulary.blocks[index].positive]
        mean = (shrink * turned) @ rows.T
        variance = shrink @ (rows**2).T * left[:, None] / self.count
        return np.sum(special.log_ndtr(mean / np.sqrt(np.maximum(variance, 1e-300))) + np.log(2.0), axis=1)
