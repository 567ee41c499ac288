"""What an experiment would tell about which cause it is, in bits, before it is made.

A hypothesis i (one cause in a place, or none) has a probability p_i and, after the data so far, a normal law
of all parameters, N(m_i, S_i), where parameters of other causes are zero. Rows with whitened sensitivity G
(r, P) are then N(G m_i, V_i), V_i = I + G S_i G'. Their information on the cause is at least (Kolchinsky and
Tracey 2017)

    - sum_i p_i log sum_j p_j exp(-C_ij),
    C_ij = 1/8 d' V^-1 d + 1/2 log(|V| / sqrt(|V_i| |V_j|)),   d = G (m_i - m_j),  V = (V_i + V_j) / 2
    (Bhattacharyya)

(a choice is made by it, and the bits that are said are simulated), and depends on the rows through W = G'G
alone (P, P): |V_i| = |I + L'W L| with S_i = L L', and so on. W of several rows is a sum.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

_JITTER = 1e-12  # of the largest variance: parameters that a hypothesis does not have vary by nothing
_DRAWS = 400  # outcomes of each hypothesis: two digits of a bit
_FOLLOWED = 60  # candidates that are worth a second look after the first choice


@dataclass(frozen=True)
class Hypothesis:
    """probability; mean (P,) and covariance (P, P) of all parameters if it is true, in units in which columns
    are comparable."""

    probability: float
    mean: np.ndarray
    covariance: np.ndarray

    @cached_property
    def factor(self) -> np.ndarray:
        return _factor(self.covariance)


@dataclass(frozen=True)
class Field:
    """The hypotheses of one place; their probabilities sum to one."""

    hypotheses: tuple[Hypothesis, ...]

    @property
    def entropy(self) -> float:
        """Bits that are not known yet."""
        p = np.array([h.probability for h in self.hypotheses])
        p = p[p > 0.0]
        return float(-np.sum(p * np.log2(p)))

    @cached_property
    def pairs(self) -> dict[tuple[int, int], np.ndarray]:
        """(i, j) -> factor of the mean covariance."""
        h = self.hypotheses
        return {(i, j): _factor(0.5 * (h[i].covariance + h[j].covariance)) for i in range(len(h))
                for j in range(i)}

    def bits(self, information: np.ndarray) -> np.ndarray:
        """(C,) lower bound of the information on the cause, of rows with W (C, P, P)."""
        h, count = self.hypotheses, len(information)
        single = [_log_det(information, each.factor) for each in h]
        overlap = np.ones((len(h), len(h), count))
        for (i, j), factor in self.pairs.items():
            difference = h[i].mean - h[j].mean
            seen = information @ difference  # (C, P)
            inner, log_det = _inner(information, factor)
            across = seen @ factor
            distance = seen @ difference - np.einsum("ck,ck->c", across,
                                                     np.linalg.solve(inner, across[:, :, None])[:, :, 0])
            c = 0.125 * np.maximum(distance, 0.0) + 0.5 * (log_det - 0.5 * (single[i] + single[j]))
            overlap[i, j] = overlap[j, i] = np.exp(-np.maximum(c, 0.0))
        p = np.array([each.probability for each in h])
        return -np.einsum("i,ic->c", p, np.log2(np.einsum("j,ijc->ic", p, overlap)))


    def simulated_bits(self, rows: np.ndarray, rng: np.random.Generator, draws: int = _DRAWS) -> float:
        """The information on the cause itself, of rows G (r, P): mean over simulated outcomes."""
        laws = [(rows @ h.mean, linalg.cholesky(np.eye(len(rows)) + rows @ h.covariance @ rows.T, lower=True))
                for h in self.hypotheses]
        p = np.array([h.probability for h in self.hypotheses])
        left = 0.0
        for probability, (mean, factor) in zip(p, laws):
            outcome = mean + rng.normal(size=(draws, len(rows))) @ factor.T
            log = np.stack([_log_density(outcome, *law)
                            for law in laws]) + np.log(np.maximum(p, 1e-300))[:, None]
            posterior = np.exp(log - np.logaddexp.reduce(log, axis=0))
            left -= probability * float(
                np.mean(np.sum(posterior * np.log2(np.maximum(posterior, 1e-300)), axis=0))
            )
        return max(self.entropy - left, 0.0)


def chosen_for(fields: list[Field], blocks: list[np.ndarray], most: int, enough: float,
               least: float = 0.0) -> tuple[list[int], list[float]]:
    """Greedy choice among C experiments, again and again from the same: indices, and bits after each of them.

    blocks: for each field (C, r, P), the rows of every experiment in its parameters. Ends at `most` choices,
    when `enough` of all that is not known yet would be known, or when one more tells less than `least` of it.
    """
    unknown = sum(field.entropy for field in fields)
    squares = [np.einsum("cri,crj->cij", each, each) for each in blocks]
    at, total = np.arange(len(blocks[0])), [np.zeros(square.shape[1:]) for square in squares]
    chosen, bits = [], []
    while len(chosen) < most and (not bits or bits[-1] < enough * unknown):
        if len(bits) > 1 and bits[-1] - bits[-2] < least * unknown:
            break
        worth = sum(field.bits(so_far + square[at]) for field, so_far, square in zip(fields, total, squares))
        best = int(np.argmax(worth))
        chosen.append(int(at[best]))
        bits.append(float(worth[best]))
        total = [so_far + square[chosen[-1]] for so_far, square in zip(total, squares)]
        if len(chosen) == 1:
            at = at[np.sort(np.argsort(-worth, kind="stable")[:_FOLLOWED])]
    return chosen, bits


def _factor(covariance: np.ndarray) -> np.ndarray:
    jitter = _JITTER * np.max(np.diag(covariance)) * np.eye(len(covariance))
    return linalg.cholesky(covariance + jitter, lower=True)


def _inner(information: np.ndarray, factor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    inner = factor.T @ information @ factor + np.eye(len(factor))
    return inner, np.linalg.slogdet(inner)[1]


def _log_det(information: np.ndarray, factor: np.ndarray) -> np.ndarray:
    return _inner(information, factor)[1]


def _log_density(outcome: np.ndarray, mean: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """(D,) log density of outcomes (D, r), less a constant."""
    white = linalg.solve_triangular(factor, (outcome - mean).T, lower=True)
    return -0.5 * np.sum(white**2, axis=0) - np.sum(np.log(np.diag(factor)))
