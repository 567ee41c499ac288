"""Jumps of an instrument: what neighbouring rows share may be few jumps, which no noise makes.

    e_i = sum over jumps j of d_j [i after t_j] + sigma z_i,     d_j (m,) whatever the fit has not taken

found one after another, each where it takes most, and accepted together where they are likelier than a
wandering (wandering.py) of the same residuals; each pays half the logarithm of the number of rows for every
component, and the logarithm of the places where it may be.
"""

from __future__ import annotations

import numpy as np

from exactarm.noise.wandering import Wandering
from exactarm.numerics.orthonormal import added_to, orthonormal

MOST_JUMPS = 6
_LEAST_NATS = 3.0  # above the wandering: 1 in 20
_SEEN = 1e-6  # share of a jump that the fit leaves, below which it has taken all of it


def jumps_of(white: np.ndarray, weight: np.ndarray, order: np.ndarray, declared: np.ndarray | None,
             wandering: Wandering) -> int:
    """How many jumps residuals (N, m) of unit variance show; 0 where they wander. weight (N,): of the rows,
    by whose roots they are white; order (N,): their places; declared (N, m, b): columns that were fitted, as
    white."""
    (rows, m), by = white.shape, np.argsort(order, kind="stable")
    basis = np.zeros((rows * m, 0))
    if declared is not None:
        basis = orthonormal(declared[by].reshape(rows * m, -1))
    left, root = white[by].ravel(), np.sqrt(weight[by])
    left = left - basis @ (basis.T @ left)
    before, used = float(left @ left), np.count_nonzero(weight)
    price = 0.5 * m * np.log(used) + np.log(used - 1)
    net = []
    for jumps in range(1, MOST_JUMPS + 1):
        place = _best_place(left.reshape(rows, m), root, basis.reshape(rows, m, -1))
        jump = np.where(np.arange(rows) >= place, root, 0.0)
        more = added_to(basis, np.kron(jump[:, None], np.eye(m)))
        left = left - more @ (more.T @ left)
        basis = np.hstack([basis, more])
        square = max(float(left @ left), np.finfo(float).tiny)
        net.append(0.5 * m * used * np.log(before / square) - jumps * price)
    best = int(np.argmax(net))
    return best + 1 if net[best] > wandering.gain - np.log(used) + _LEAST_NATS else 0


def _best_place(left: np.ndarray, root: np.ndarray, basis: np.ndarray) -> int:
    """First row behind the jump that takes most of what is left (N, m) beside a basis (N, m, b) of what was
    fitted; root (N,): of the weights."""
    behind = lambda values: np.cumsum(values[::-1], axis=0)[::-1][1:]
    onto, shared = behind(root[:, None] * left), behind(root[:, None, None] * basis)
    normal = behind(root**2)[:, None, None] * np.eye(left.shape[1]) - shared @ shared.transpose(0, 2, 1)
    values, vectors = np.linalg.eigh(normal)
    along = np.einsum("nij,ni->nj", vectors, onto)
    taken = np.where(values > _SEEN * len(left), along**2 / np.maximum(values, np.finfo(float).tiny), 0.0)
    return int(np.argmax(taken.sum(axis=1))) + 1
