"""Pieces of runs that a cross-validation leaves out whole: numbers 0 ... pieces - 1 in every run, in the order of time.

So each part takes stretches of every run, at the slow and at the fast end of it.
"""

from __future__ import annotations

import numpy as np

_PIECES = 20
_RUNS_ENOUGH = 5


def run_groups(run: np.ndarray) -> np.ndarray:
    """(N,) whole runs where there are several, else pieces of each."""
    return run if np.unique(run).size >= _RUNS_ENOUGH else time_groups(run)


def time_groups(run: np.ndarray, pieces: int = _PIECES) -> np.ndarray:
    """(N,) number of the piece of its run in which a row lies; the rows of a run are in the order of time."""
    groups = np.empty(run.size, int)
    for number in np.unique(run):
        rows = np.flatnonzero(run == number)
        groups[rows] = np.arange(rows.size) * pieces // rows.size
    return groups
