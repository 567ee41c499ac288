"""Performance of an arm in the terms of ISO 9283, as far as the rows allow.

Of a pose that is visited n times, with attained positions p_j, their mean p, and the commanded position c:

    AP = |p - c|                       pose accuracy
    l_j = |p_j - p|,  RP = mean l + 3 S_l      pose repeatability (S_l: standard deviation of l, n - 1)
    vAP = max |p_g - p_h|              variation between directions of approach g, h
    dAP, dRP = max |AP_1 - AP_t|, max |RP_1 - RP_t|     drift over blocks in time of visits from one side
    AD = mean D_j - D_c,  RD = 3 S_D   distance accuracy and repeatability, D_j = |p_aj - p_bj| of two poses,
                                       each visited from one side

All m. c is the model's prediction at the angles that the controller reports, with base and tool frame fitted
(held_out.py): what AP means depends on it, RP does not. D_c is the model's distance at the same visits.
Orientation is in iso_orientation.py, paths are in iso_path.py. The standard asks for five poses on a plane of
a cube in the work space, 30 visits, rated load and speed: the rows say how often and where, the operator has
to say the rest. A measure that the rows do not allow is named in `missing` with the reason.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.data.split import pose_groups

STANDARD_VISITS = 30
LEAST_VISITS = 3  # of one pose from one direction: fewer give no standard deviation worth the name
DRIFT_BLOCK = 3  # visits of a block of the drift, at least
DRIFT_BLOCKS = 10  # blocks at most
DRIFT_SPAN_S = 600.0  # between the first and the last visit, at least: shorter, nothing has warmed
MOST_PAIRS = 20000  # of poses whose distance is judged; drawn by lot where there are more


@dataclass(frozen=True)
class PoseTest:
    """One pose of one session from one direction: row (first, in the judged rows), visits, AP before and
    after, RP."""

    row: int
    visits: int
    accuracy_before: float
    accuracy_after: float
    repeatability: float


@dataclass(frozen=True)
class Distances:
    """Signed errors (pairs,) before and after of the distances (pairs,) between judged poses; repeatability:
    largest RD over the `repeated` pairs of which both poses were visited often enough, or None."""

    length: np.ndarray
    before: np.ndarray
    after: np.ndarray
    repeatability: float | None
    repeated: int = 0


@dataclass(frozen=True)
class Iso9283:
    """poses: tests of visited poses. The others are None where the rows do not allow them; `missing`: measure
    -> reason."""

    poses: tuple[PoseTest, ...]
    directions: tuple[float, float, int] | None = None  # vAP before, after, poses
    drift: tuple[float, float, float, float] | None = None  # dAP before, after, dRP, hours
    distances: Distances | None = None
    missing: dict[str, str] = field(default_factory=dict)

    @property
    def visits(self) -> int:
        """The fewest visits of a tested pose."""
        return min((test.visits for test in self.poses), default=0)


def iso_9283(
    data: Dataset,
    before: np.ndarray,
    after: np.ndarray,
    predicted: np.ndarray,
    predicted_before: np.ndarray,
    seed: int,
) -> Iso9283:
    """Of the judged rows: residuals before and after (M, 3) and predicted positions (M, 3) of both models."""
    groups, sides = pose_and_session(data), direction_of_approach(data)
    each = np.unique(np.stack([groups, sides], axis=1), axis=0, return_inverse=True)[1].ravel()
    tests = _pose_tests(data, each, before, after)
    directions, drift = _directions(data, groups, before, after), _drift(data, each, before, after)
    distances = _distances(data, groups, each, predicted_before, predicted, seed)
    missing = {}
    if not tests:
        missing["pose accuracy AP and repeatability RP"] = (
            f"no judged pose was visited {LEAST_VISITS} times from one direction (the standard: "
            f"{STANDARD_VISITS} times); the error at "
            "poses visited once, below, holds accuracy and repeatability together"
        )
    if directions is None:
        missing["multi-directional pose accuracy variation vAP"] = (
            "there is no column `approach_i`"
            if "approach" not in data.joints
            else f"no pose was visited {LEAST_VISITS} times from each of two directions"
        )
    if drift is None:
        missing["drift of pose accuracy dAP and of repeatability dRP"] = (
            "there is no column `time_s`"
            if data.time is None
            else f"no pose was visited {2 * DRIFT_BLOCK} times from one direction over "
            f"{DRIFT_SPAN_S / 60.0:g} min"
        )
    if distances is None:
        missing["distance accuracy AD"] = "no session has two different judged poses"
    elif distances.repeatability is None:
        missing["distance repeatability RD"] = (
            f"no two poses were each visited {LEAST_VISITS} times from one direction"
        )
    return Iso9283(tests, directions, drift, distances, missing)


def repeatability(points: np.ndarray) -> float:
    """RP of visits (n, 3), n >= 2."""
    length = np.linalg.norm(points - points.mean(axis=0), axis=1)
    return float(length.mean() + 3.0 * length.std(ddof=1))


def pose_and_session(data: Dataset) -> np.ndarray:
    """(M,) int: the same pose of one session; poses of two sessions are seen from two places."""
    return np.unique(np.stack([data.session, pose_groups(data)], axis=1), axis=0, return_inverse=True)[
        1
    ].ravel()


def direction_of_approach(data: Dataset) -> np.ndarray:
    """(M,) int: rows of the same direction of approach; all alike where none is given."""
    if "approach" not in data.joints:
        return np.zeros(len(data), int)
    return np.unique(np.nan_to_num(data.joints["approach"]), axis=0, return_inverse=True)[1].ravel()


def members(groups: np.ndarray, least: int) -> list[np.ndarray]:
    """Rows of each group that has at least `least`, in order."""
    order = np.argsort(groups, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(groups[order])) + 1)
    return [part for part in parts if part.size >= least]


def _pose_tests(
    data: Dataset, each: np.ndarray, before: np.ndarray, after: np.ndarray
) -> tuple[PoseTest, ...]:
    """each (M,) int: the same pose from the same direction."""
    accuracy = lambda residual, rows: float(np.linalg.norm(residual[rows].mean(axis=0)))
    return tuple(
        PoseTest(
            int(rows[0]),
            rows.size,
            accuracy(before, rows),
            accuracy(after, rows),
            repeatability(data.position[rows]),
        )
        for rows in members(each, LEAST_VISITS)
    )


def _directions(
    data: Dataset, groups: np.ndarray, before: np.ndarray, after: np.ndarray
) -> tuple[float, float, int] | None:
    """vAP: largest distance between the mean errors of one pose's directions; what a model predicts of it
    counts for it."""
    direction, found = direction_of_approach(data), []
    for rows in members(groups, 2 * LEAST_VISITS):
        parts = [rows[part] for part in members(direction[rows], LEAST_VISITS)]
        if len(parts) > 1:
            found.append(
                [
                    _apart(np.array([residual[part].mean(axis=0) for part in parts]))
                    for residual in (before, after)
                ]
            )
    return None if not found else (*np.max(found, axis=0).tolist(), len(found))


def _apart(points: np.ndarray) -> float:
    return float(np.max(np.linalg.norm(points[:, None] - points[None], axis=2)))


def _drift(
    data: Dataset, each: np.ndarray, before: np.ndarray, after: np.ndarray
) -> tuple[float, float, float, float] | None:
    """Of visits from one direction: what differs between directions is no drift."""
    if data.time is None:
        return None
    found = []
    for rows in members(each, 2 * DRIFT_BLOCK):
        rows = rows[np.argsort(data.time[rows], kind="stable")]
        span = float(data.time[rows[-1]] - data.time[rows[0]])
        if span < DRIFT_SPAN_S:
            continue
        blocks = np.array_split(rows, min(rows.size // DRIFT_BLOCK, DRIFT_BLOCKS))
        measures = [
            [np.linalg.norm(residual[block].mean(axis=0)) for block in blocks] for residual in (before, after)
        ]
        measures.append([repeatability(data.position[block]) for block in blocks])
        found.append([*(float(np.max(np.abs(np.array(m) - m[0]))) for m in measures), span / 3600.0])
    return None if not found else tuple(np.max(found, axis=0).tolist())


def _distances(
    data: Dataset, groups: np.ndarray, each: np.ndarray, predicted_before: np.ndarray, predicted: np.ndarray,
    seed: int
) -> Distances | None:
    """Of pairs of poses in one session, each from one direction, visit by visit; no base frame enters, and
    what differs between directions does not scatter a distance."""
    parts = members(each, 1)
    pose, session = (np.array([of[rows[0]] for rows in parts]) for of in (groups, data.session))
    first, second = _pairs(session, np.random.default_rng(seed))
    apart = pose[first] != pose[second]
    first, second = first[apart], second[apart]
    if not first.size:
        return None
    visits = np.array([part.size for part in parts])
    common = np.minimum(visits[first], visits[second])
    lengths = np.zeros((3, first.size))  # measured, by both models: mean over the visits that both poses have
    places, spread = (data.position, predicted_before, predicted), 0.0
    for n in np.unique(common):
        pairs = np.flatnonzero(common == n)
        rows = [np.array([part[:n] if part.size >= n else np.resize(part, n) for part in parts])[ends[pairs]]
                for ends in (first, second)]
        found = [np.linalg.norm(points[rows[0]] - points[rows[1]], axis=2) for points in places]
        lengths[:, pairs] = [length.mean(axis=1) for length in found]
        if n >= LEAST_VISITS:
            spread = max(spread, 3.0 * float(found[0].std(axis=1, ddof=1).max()))
    repeated = int(np.sum(common >= LEAST_VISITS))
    errors = lengths[0] - lengths[1], lengths[0] - lengths[2]
    return Distances(lengths[0], *errors, spread if repeated else None, repeated)


def _pairs(session: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of two poses of one session, every pair once, or `MOST_PAIRS` different ones drawn by lot."""
    pairs = []
    for number in np.unique(session):
        here = np.flatnonzero(session == number)
        total = here.size * (here.size - 1) // 2
        if total <= MOST_PAIRS:
            a, b = np.triu_indices(here.size, 1)
        else:
            a = random.integers(0, here.size, 2 * MOST_PAIRS)
            b = random.integers(0, here.size, 2 * MOST_PAIRS)
            both = np.unique(np.sort(np.stack([a, b], axis=1)[a != b], axis=1), axis=0)
            a, b = random.permutation(both)[:MOST_PAIRS].T
        pairs.append(here[np.stack([a, b], axis=1)])
    chosen = np.concatenate(pairs)
    chosen = chosen if len(chosen) <= MOST_PAIRS else np.sort(random.permutation(chosen)[:MOST_PAIRS], axis=0)
    return chosen[:, 0], chosen[:, 1]
