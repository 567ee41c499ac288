"""Set-ups of a gyroscope: runs of one axis between which the axes behind it stand elsewhere.

A gyroscope on the flange feels the moving axis in the direction that the axes between them leave it:
d = R(q_behind) z, constant within a run. Runs with another stance are another set-up, with an alignment of
its own, unless the readings say that the gyroscope sits on the link of the moving gear, where no stance
matters: then d is the same.
"""

import numpy as np

from exactarm.data.kinds.base import STANDS_STILL, rows_of_runs
from exactarm.data.rows import Rows
from exactarm.robot.robot import Robot

_SAME_STANCE_RAD = 1e-3  # an axis that was sent to the same angle again comes back to a tenth of this
_SAME_DIRECTION_RAD = 1e-3  # of 1 rad/s: as large as the noise of a good sensor


def set_ups_of_gyroscope(data: Rows, robot: Robot) -> np.ndarray:
    """(N,) session of each row; those that were parted have numbers above the file's."""
    session, theta = data.session.copy(), data.joints["theta"]
    behind: dict[tuple[int, int], list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = {}
    for rows in rows_of_runs(data):
        angle = theta[rows] / robot.ratios
        span = np.ptp(angle, axis=0)
        if not np.any(span > 0.0):
            continue
        axis = int(np.nanargmax(span))
        stands = np.nan_to_num(angle[:, axis + 1:])
        if np.any(np.ptp(stands, axis=0) > STANDS_STILL * span[axis]):
            continue  # axes that move together have no direction of their own
        rate = np.gradient(angle[:, axis], data.time[rows])
        direction = data.gyro[rows].T @ rate
        length = np.linalg.norm(direction)
        if length > 0.0:
            key = (int(session[rows[0]]), axis)
            behind.setdefault(key, []).append((rows, stands.mean(axis=0), direction / length))
    for runs in behind.values():
        groups = _by_stance(runs)
        means = [np.mean([direction for _, _, direction in group], axis=0) for group in groups]
        if all(np.linalg.norm(mean - means[0]) < _SAME_DIRECTION_RAD for mean in means):
            continue
        for group in groups[1:]:
            session[np.concatenate([rows for rows, _, _ in group])] = session.max() + 1
    return session


def _by_stance(runs: list) -> list[list]:
    groups: list[list] = []
    for run in runs:
        for group in groups:
            if np.max(np.abs(run[1] - group[0][1]), initial=0.0) < _SAME_STANCE_RAD:
                group.append(run)
                break
        else:
            groups.append([run])
    return groups


def words_of_set_ups(before: np.ndarray, after: np.ndarray, run: np.ndarray) -> tuple[str, ...]:
    """One sentence where runs were parted."""
    parted = np.unique(run[before != after])
    if parted.size == 0:
        return ()
    names = ", ".join(map(str, parted[:8])) + (" ..." if parted.size > 8 else "")
    return (f"the axes behind the moving one stand elsewhere in runs {names} than before, and the gyroscope "
            "reads it: each stance has an alignment of its own",)
