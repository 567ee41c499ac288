"""Criteria of a design: what the information M = sum B'B (m, m) of a set of experiments is worth.

    LogDeterminant        log det M; O1 = exp(value / 2m) / sqrt(K) (thesis (3.10))
    SmallestOverLargest   log O4, O4 = s_min^2 / s_max with s = sqrt(eigenvalues of M) (thesis (3.11))

Determinants are updated, not recomputed: det(M + B'B) = det(M) det(I + B M^-1 B').
Any other criterion needs only its value on a batch of information matrices.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np


class Criterion(ABC):
    """A number that grows with the information of a set; -inf for a singular one."""

    @abstractmethod
    def values(self, information: np.ndarray) -> np.ndarray:
        """(C,) values of information matrices (C, m, m)."""

    def value(self, information: np.ndarray) -> float:
        return float(self.values(information[None])[0])

    def gains(self, information: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        """(C,) change of the value when one of the blocks (C, r, m) is added."""
        return self.values(information + squared(blocks)) - self.value(information)

    def losses(self, information: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        """(C,) change of the value (negative) when one of the blocks is removed."""
        return self.values(information - squared(blocks)) - self.value(information)

    def swaps(self, information: np.ndarray, out: np.ndarray, into: np.ndarray) -> np.ndarray:
        """(C,) change of the value when the block out[c] is replaced by into[c], both (C, r, m)."""
        return self.values(information - squared(out) + squared(into)) - self.value(information)

    def least_gain(self, count: int, parameters: int) -> float:
        """What an addition to `count` experiments must gain for the set to be worth more per experiment."""
        return 0.0


@dataclass(frozen=True)
class LogDeterminant(Criterion):
    """log det M; with `nuisance` columns, of what is left of M once these are fitted too (D_s-optimality)."""

    nuisance: tuple[int, ...] = ()

    def values(self, information: np.ndarray) -> np.ndarray:
        return _log_det(information) - (_log_det(self._nuisance_of(information)) if self.nuisance else 0.0)

    def gains(self, information: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        return self._changes(information, blocks, np.ones(blocks.shape[1]))

    def losses(self, information: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        return self._changes(information, blocks, -np.ones(blocks.shape[1]))

    def swaps(self, information: np.ndarray, out: np.ndarray, into: np.ndarray) -> np.ndarray:
        signs = np.repeat([-1.0, 1.0], [out.shape[1], into.shape[1]])
        return self._changes(information, np.concatenate([out, into], axis=1), signs)

    def least_gain(self, count: int, parameters: int) -> float:
        return (parameters - len(self.nuisance)) * np.log1p(1.0 / count)

    def _changes(self, information: np.ndarray, blocks: np.ndarray, signs: np.ndarray) -> np.ndarray:
        change = log_det_change(information, blocks, signs)
        if self.nuisance:
            part = blocks[:, :, self.nuisance]
            change = change - log_det_change(self._nuisance_of(information), part, signs)
        return change

    def _nuisance_of(self, information: np.ndarray) -> np.ndarray:
        return information[..., self.nuisance, :][..., :, self.nuisance]


@dataclass(frozen=True)
class SmallestOverLargest(Criterion):
    """log O4 = log(smallest eigenvalue) - log(largest eigenvalue) / 2."""

    def values(self, information: np.ndarray) -> np.ndarray:
        eigenvalues = np.linalg.eigvalsh(information)
        smallest, largest = eigenvalues[..., 0], eigenvalues[..., -1]
        regular = smallest > 0.0
        return np.where(regular, np.log(np.where(regular, smallest, 1.0)) - 0.5 * np.log(largest), -np.inf)


def squared(blocks: np.ndarray) -> np.ndarray:
    """(C, m, m) information B'B of each block (C, r, m)."""
    return np.swapaxes(blocks, -1, -2) @ blocks


def information_of(blocks: np.ndarray) -> np.ndarray:
    """(m, m) information of a set of blocks (K, r, m)."""
    rows = blocks.reshape(-1, blocks.shape[-1])
    return rows.T @ rows


def is_regular(information: np.ndarray) -> bool:
    """Whether all parameters of M (m, m) can be identified, whatever their units: a determinant of rounding
    may have any sign."""
    size = np.sqrt(np.diag(information))
    if not np.all(size > 0.0):
        return False
    least = np.linalg.eigvalsh(information / np.outer(size, size))[0]
    return bool(least > len(size) * np.finfo(float).eps)


def log_det_change(information: np.ndarray, blocks: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """(C,) log det(M + B' S B) - log det M by the matrix determinant lemma, S = diag(signs) (r,) added or
    removed rows; -inf where the matrix turns singular."""
    whitened = whiten(information, blocks)
    return _log_det(np.eye(blocks.shape[1]) + signs[:, None] * (whitened @ np.swapaxes(whitened, -1, -2)))


def whiten(information: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    """(C, r, m) blocks B L^-T with M = L L', so that B M^-1 B' is their square. M must be regular."""
    inverse = np.linalg.inv(np.linalg.cholesky(information))
    return (blocks.reshape(-1, blocks.shape[-1]) @ inverse.T).reshape(blocks.shape)


def _log_det(matrices: np.ndarray) -> np.ndarray:
    sign, value = np.linalg.slogdet(matrices)
    return np.where(sign > 0.0, value, -np.inf)
