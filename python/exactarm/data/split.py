"""Rows to identify with and rows to judge by, never from the same pose or run.

`pose_split`: whole poses: rows of one visit or with the same joint angles stay together; each session gives
its share, and of each sort of measurement in it (a contact, a sensor, the tracker) there is something on
either side. `run_split`: whole runs; in gear runs, runs that move the same axes the same way share, in
tracked motions those of one session; where there is only one of a sort, its first part is taken and its last
part left. Both -> (N,) bool, True = identification.
"""

import numpy as np
import scipy  # what is asked of it here takes 0.1 s to import, and is at its first use

from exactarm.data.kinds import kind_of
from exactarm.data.rows import Rows

# of an axis' range (about 1e-4 rad): an arm sent to one pose twice reports no more than this
SAME_POSE = 3e-5
DEFAULT_SEED = 1  # of every random choice, in Python and on the command line alike


def pose_groups(dataset: Rows) -> np.ndarray:
    """(N,) int from 0: rows with the same number were measured at the same pose of the arm."""
    angles = np.hstack([np.nan_to_num(dataset.joints[name]) for name in ("theta", "q")
                        if name in dataset.joints])
    span = np.ptp(angles, axis=0)
    distinct, groups = np.unique(angles / np.where(span > 0.0, span, 1.0), axis=0, return_inverse=True)
    near = scipy.spatial.cKDTree(distinct).query_pairs(SAME_POSE, p=np.inf, output_type="ndarray")
    pairs = [near]
    count = len(distinct)
    if dataset.visit is not None:
        _, visits = np.unique(dataset.visit, return_inverse=True)
        pairs.append(np.stack([groups.ravel(), count + visits.ravel()], axis=1))
        count += visits.max() + 1
    if "pair" in dataset.contacts:  # the same pose of the target: the rows of a pair judge each other
        rows = np.flatnonzero(dataset.contacts["pair"] >= 0)
        _, numbers = np.unique(np.stack([dataset.session[rows], dataset.contacts["pair"][rows]], 1), axis=0,
                               return_inverse=True)
        pairs.append(np.stack([groups.ravel()[rows], count + numbers.ravel()], axis=1))
        count += numbers.max(initial=-1) + 1
    links = np.concatenate(pairs)
    joined = np.ones(len(links), dtype=bool)
    graph = scipy.sparse.coo_array((joined, (links[:, 0], links[:, 1])), shape=(count, count))
    _, labels = scipy.sparse.csgraph.connected_components(graph, directed=False)
    return np.unique(labels[groups.ravel()], return_inverse=True)[1]


def pose_split(dataset: Rows, random: np.random.Generator, fraction: float) -> np.ndarray:
    groups = pose_groups(dataset)
    _, first = np.unique(groups, return_index=True)
    chosen = np.zeros(len(first), dtype=bool)
    home = dataset.session[first]
    for session in np.unique(home):
        members = random.permutation(np.flatnonzero(home == session))
        chosen[members[: _share(len(members), fraction)]] = True
        for measured in _sorts(dataset):
            of_sort = members[measured[first[members]]]
            if len(of_sort) > 1 and chosen[of_sort].all() == chosen[of_sort].any():
                chosen[of_sort] = np.arange(len(of_sort)) < _share(len(of_sort), fraction)
    return chosen[groups]


def _sorts(dataset: Rows) -> list[np.ndarray]:
    """(N,) bool of each sort of measurement: which rows have it; none where all are poses."""
    sorts = [numbers >= 0 for numbers in dataset.contacts.values()]
    if sorts and dataset.position is not None:
        sorts.append(~np.isnan(dataset.position).any(axis=1))
    return sorts


def run_split(dataset: Rows, random: np.random.Generator, fraction: float) -> np.ndarray:
    mask = np.zeros(len(dataset), dtype=bool)
    for runs in kind_of(dataset.kind).alike(dataset):
        if len(runs) == 1:
            rows = np.flatnonzero(dataset.run == runs[0])
            rows = rows[np.argsort(dataset.time[rows], kind="stable")]
            mask[rows[: _share(len(rows), fraction)]] = True
        else:
            mask |= np.isin(dataset.run, random.permutation(runs)[: _share(len(runs), fraction)])
    return mask


def split_rule(dataset: Rows, fraction: float) -> str:
    """How the rows are chosen, as one sentence for a report."""
    percent = f"{100 * fraction:.0f} %"
    if dataset.identification is not None:
        return "Identification and validation rows are those that the column `set` names."
    if kind_of(dataset.kind).at_rest:
        return f"{percent} of the poses of each session, chosen at random, identify; the others validate."
    counts = [len(runs) for runs in kind_of(dataset.kind).alike(dataset)]
    cut = f"the first {percent} of the run identify, the rest, later in time, validate"
    if max(counts) == 1:
        return f"There is {'one run' if len(counts) == 1 else 'one run of each sort'}: {cut}."
    whole = f"{percent} of the runs, chosen at random, identify; the others validate"
    return f"{whole}; of a sort measured only once, {cut}." if min(counts) == 1 else f"{whole}."


def _share(count: int, fraction: float) -> int:
    """How many of `count` identify: neither none nor all, where there is a choice."""
    return count if count < 2 else int(np.clip(round(fraction * count), 1, count - 1))
