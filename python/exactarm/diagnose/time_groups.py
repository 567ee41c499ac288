"""Pieces of runs that a cross-validation leaves out whole: numbers 0 ... pieces - 1 in every run, in the
order of time.

So each part takes stretches of every run, at the slow and at the fast end of it.

What one group only tells (the memory of a drive, in the one run that reverses; a mount that slipped before
the last run) is learnt nowhere else: for such an effect that group is cut into stretches, each with as much
of the effect's response as the next.
"""

from __future__ import annotations

import numpy as np

from exactarm.diagnose.decisions import ENOUGH_GROUPS

_PIECES = 20
# of what is told, lost without one group: what the others tell is ten times less sure than the effect there
_SEEN_ONCE = 0.9
_LEAST_STRETCHES, _ROWS_OF_NOISE = 4, 2.0  # a stretch lasts as long as noise remembers, twice


def run_groups(run: np.ndarray) -> np.ndarray:
    """(N,) whole runs where there are several, else pieces of each."""
    return run if np.unique(run).size >= ENOUGH_GROUPS else time_groups(run)


def time_groups(run: np.ndarray, pieces: int = _PIECES) -> np.ndarray:
    """(N,) number of the piece of its run in which a row lies; the rows of a run are in the order of time."""
    groups = np.empty(run.size, int)
    for number in np.unique(run):
        rows = np.flatnonzero(run == number)
        groups[rows] = np.arange(rows.size) * pieces // rows.size
    return groups


def stretches_of_response(groups: np.ndarray, response: np.ndarray, lost: np.ndarray,
                          memory_rows: float) -> np.ndarray:
    """`groups` (N,), those of an effect that one of them alone tells cut into stretches of equal response.

    response (N,): square of what the effect does in each row; lost (N,): share of what is told of it that
    goes with the row's group; memory_rows: so many rows are worth one independent one.
    """
    names, inverse = np.unique(groups, return_inverse=True)
    shares = np.bincount(inverse, weights=response)
    total = shares.sum()
    rows = np.flatnonzero(inverse == shares.argmax())
    if total <= 0.0 or lost[rows].max(initial=0.0) < _SEEN_ONCE:
        return groups
    part = response[rows]
    count = int(min(part.sum() ** 2 / np.sum(part**2) / (_ROWS_OF_NOISE * memory_rows), _PIECES))
    if count < _LEAST_STRETCHES:
        return groups
    middle = np.cumsum(part) - 0.5 * part
    cut = groups.copy()
    cut[rows] = names.max() + 1 + np.minimum((middle / part.sum() * count).astype(int), count - 1)
    return cut
