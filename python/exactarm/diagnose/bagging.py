"""Bagged probabilities: of models that may all be wrong, how often each would be the likeliest on data like
these.

Models m with log evidence E_m and square sums S_mb over pieces b of the record, each longer than the noise
remembers. A draw takes as many pieces with repetition, w_b times each:

    E_m(w) = E_m - n/2 log(sum_b w_b S_mb / sum_b S_mb)
    p_m    = mean over draws of exp(E_m(w)) / sum_k exp(E_k(w))

n: independent numbers. Where one of the models is right, little changes above ten nats; where all of them
imitate something else, a lead that hangs on few pieces of the path is no certainty (Huggins and Miller 2023:
bagged posteriors). Fits are not repeated: a draw reweighs what they leave.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from exactarm.diagnose.decisions import CERTAIN, RIDGE
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.scan import linear_columns, prior_of
from exactarm.diagnose.vocabulary import emptied
from exactarm.effects.base import Effect

HOPELESS = 2.0 * CERTAIN  # nats behind the likeliest, which no draw of pieces makes up for
_DRAWS = 500  # a probability of one half is known to 2 %


def bagged(evidence: np.ndarray, squares: np.ndarray, kept: np.ndarray, count: float,
           seed: int = 0) -> np.ndarray:
    """(M,) probabilities of models with log evidence (M,), square sums (M, B) by piece, and (M,) those that
    belong to no piece; count: n."""
    pieces = squares.shape[1]
    drawn = np.random.default_rng(seed).multinomial(pieces, np.full(pieces, 1.0 / pieces), size=_DRAWS)
    least = np.finfo(float).tiny
    whole, part = squares.sum(axis=1) + kept + least, drawn @ squares.T + kept + least
    return special.softmax(evidence - 0.5 * count * np.log(part / whole), axis=1).mean(axis=0)


def squares_by_piece(residual: np.ndarray, numbers: int, pieces: np.ndarray) -> tuple[np.ndarray, float]:
    """(B,) square sums of a residual (R,) over the pieces (N,) from 0 of the rows that its first `numbers`
    are of, and that of what is left: priors."""
    by_row = np.sum(residual[:numbers].reshape(len(pieces), -1) ** 2, axis=1)
    return np.bincount(pieces, weights=by_row), float(np.sum(residual[numbers:] ** 2))


def bagged_contest(without: Fitted, own: tuple[Effect, float], rivals: list[tuple[Effect, float]],
                   count: float, pieces: np.ndarray) -> float:
    """Probability of an effect beside rivals in its place, and beside none; each with its log evidence over
    the fit without it. pieces (N,): of the rows."""
    rivals = [rival for rival in rivals if rival[1] > own[1] - HOPELESS]
    if not rivals and own[1] > HOPELESS:
        return 1.0
    left, evidence = [without.free_residual], [0.0]
    for effect, each in (own, *rivals):
        columns = without.cleared(linear_columns(without, emptied(effect)))
        normal = columns.T @ columns
        normal += np.diag(1.0 / prior_of(effect) ** 2 + RIDGE * np.diag(normal) + np.finfo(float).tiny)
        left.append(left[0] - columns @ np.linalg.solve(normal, columns.T @ left[0]))
        evidence.append(each)
    squares, kept = zip(*(squares_by_piece(one, without.data_numbers, pieces) for one in left))
    return float(bagged(np.array(evidence), np.array(squares), np.array(kept), count)[1])
