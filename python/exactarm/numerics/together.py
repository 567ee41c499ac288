"""Whether wrong rows lie together: near each other, in space or in time, and wrong the same way. That is a
structure; rows that are wrong by themselves are so here and there, each in its own way.

    T = sum over pairs of wrong rows of cos(e_i, e_j) (1 - F(d_ij))^3,

e: their errors, d: their distance, F: share of all pairs of rows that are nearer (the power lets pairs count
that are nearer than most). What chance makes of it is
drawn: the same errors at other rows (a permutation test). A fit that a wrong row pulls leaves its neighbours
wrong the other way, which lowers T.
"""

from __future__ import annotations

import numpy as np

BY_CHANCE = 0.005  # in space and in time: of sets whose wrong rows are so by themselves, one in a hundred
# (tests/python/test_together.py)
_DRAWS = 2000  # ten of them are above the limit
_MOST = 20  # wrong rows, the largest ones
_SEED = 1


def lie_together(residual: np.ndarray, wrong: np.ndarray, place: np.ndarray) -> bool:
    """Residuals (N, 3) or wider, their position first; wrong (N,) bool; place (N,) or (N, d), in any unit."""
    error = residual[:, :3]
    norm = np.linalg.norm(error, axis=1)
    worst = np.flatnonzero(wrong)[np.argsort(-norm[wrong], kind="stable")][:_MOST]
    if len(worst) < 2:
        return False
    place = place.reshape(len(place), -1)
    random = np.random.default_rng(_SEED)
    one, other = random.integers(len(place), size=(2, _DRAWS))
    usual = np.sort(np.linalg.norm(place[one] - place[other], axis=1)[one != other])
    toward = error[worst] / np.maximum(norm[worst], 1e-300)[:, None]
    i, j = np.triu_indices(len(worst), 1)
    cosine = np.sum(toward[i] * toward[j], axis=1)
    apart = lambda rows: np.linalg.norm(place[rows[..., i]] - place[rows[..., j]], axis=-1)
    measure = lambda rows: (1.0 - np.searchsorted(usual, apart(rows)) / len(usual)) ** 3 @ cosine
    drawn = measure(random.integers(len(place), size=(_DRAWS, len(worst))))
    return bool(np.mean(drawn >= measure(worst)) < BY_CHANCE)
