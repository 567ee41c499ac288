"""What an experiment would tell about which cause it is, in bits, before it is made.

A hypothesis i (one cause in a place, or none) has a probability p_i and, after the data so far, a normal law
of all parameters, N(m_i, S_i), where parameters of other causes are zero. Rows with whitened sensitivity G
(r, P) are then N(G m_i, V_i), V_i = I + G S_i G'. Their information on the cause is at least (Kolchinsky and
Tracey 2017)

    - sum_i p_i log sum_j p_j exp(-C_ij),
    C_ij = 1/8 d' V^-1 d + 1/2 log(|V| / sqrt(|V_i| |V_j|)),   d = G (m_i - m_j),  V = (V_i + V_j) / 2
    (Bhattacharyya)

(a choice is made by it, and the bits that are said are simulated). All of it lies in the space of the rows:
few of them tell about many parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from exactarm.diagnose.decisions import DRAWS

_FOLLOWED = 60  # candidates that are worth a second look after the first choice


@dataclass(frozen=True)
class Hypothesis:
    """probability; mean (P,) and covariance (P, P) of all parameters if it is true, in units in which columns
    are comparable."""

    probability: float
    mean: np.ndarray
    covariance: np.ndarray


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

    def seen_in(self, rows: np.ndarray) -> Seen:
        """What rows (R, P) would read under every hypothesis."""
        h = self.hypotheses
        return Seen(np.array([each.probability for each in h]), np.stack([rows @ each.mean for each in h]),
                    np.stack([rows @ each.covariance @ rows.T for each in h]))

    def simulated_bits(self, rows: np.ndarray, rng: np.random.Generator, draws: int = DRAWS) -> float:
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
                np.mean(np.sum(posterior * np.log2(np.maximum(posterior, 1e-300)), axis=0)))
        return max(self.entropy - left, 0.0)


@dataclass(frozen=True)
class Seen:
    """Rows under each of h hypotheses: probability (h,), mean (h, R), covariance (h, R, R) without the
    noise."""

    probability: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray

    def bits(self, which: np.ndarray) -> np.ndarray:
        """(C,) lower bound of the information on the cause, of the rows which (C, r); a row may be taken
        twice."""
        count, number = len(self.probability), which.shape[1]
        mean = self.mean[:, which]
        law = self.covariance[:, which[:, :, None], which[:, None, :]] + np.eye(number)
        single = np.linalg.slogdet(law)[1]
        overlap = np.ones((count, count, len(which)))
        for i in range(count):
            for j in range(i):
                both, apart = 0.5 * (law[i] + law[j]), (mean[i] - mean[j])[:, :, None]
                distance = np.sum(apart * np.linalg.solve(both, apart), axis=(1, 2))
                log_det = np.linalg.slogdet(both)[1]
                c = 0.125 * np.maximum(distance, 0.0) + 0.5 * (log_det - 0.5 * (single[i] + single[j]))
                overlap[i, j] = overlap[j, i] = np.exp(-np.maximum(c, 0.0))
        inside = np.log2(np.einsum("j,ijc->ic", self.probability, overlap))
        return -np.einsum("i,ic->c", self.probability, inside)


def chosen_for(fields: list[Field], blocks: list[np.ndarray], most: int, enough: float,
               least: float = 0.0) -> tuple[list[int], list[float]]:
    """Greedy choice among C experiments, again and again from the same: indices, and bits after each of them.

    blocks: for each field (C, r, P), the rows of every experiment in its parameters. Ends at `most` choices,
    when `enough` of all that is not known yet would be known, or when one more tells less than `least` of it.
    """
    unknown = sum(field.entropy for field in fields)
    seen = [field.seen_in(each.reshape(-1, each.shape[2])) for field, each in zip(fields, blocks)]
    rows = np.arange(blocks[0].shape[0] * blocks[0].shape[1]).reshape(blocks[0].shape[:2])
    at, taken = np.arange(len(rows)), np.zeros(0, int)
    chosen, bits = [], []
    while len(chosen) < most and (not bits or bits[-1] < enough * unknown):
        if len(bits) > 1 and bits[-1] - bits[-2] < least * unknown:
            break
        which = np.concatenate([np.tile(taken, (len(at), 1)), rows[at]], axis=1)
        worth = sum(each.bits(which) for each in seen)
        best = int(np.argmax(worth))
        chosen.append(int(at[best]))
        bits.append(float(worth[best]))
        taken = np.concatenate([taken, rows[chosen[-1]]])
        if len(chosen) == 1:
            at = at[np.sort(np.argsort(-worth, kind="stable")[:_FOLLOWED])]
    return chosen, bits


def _log_density(outcome: np.ndarray, mean: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """(D,) log density of outcomes (D, r), less a constant."""
    white = linalg.solve_triangular(factor, (outcome - mean).T, lower=True)
    return -0.5 * np.sum(white**2, axis=0) - np.sum(np.log(np.diag(factor)))
