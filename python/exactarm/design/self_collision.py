"""Self-collision margin: keeps hand and target out of the arm's own body, as far as a skeleton can tell.

The body is the skeleton of the first links: the straight lines between successive frame origins from the base
up to frame n - 4 (the base column and the upper arm of a six-axis robot). The last four frames move the hand
itself and are left out. A pose is clear when flange and target keep at least this distance (the clearance)
from all these lines.
"""

import numpy as np

from exactarm import _core
from exactarm.robot.robot import Robot

_SHARE = 0.1  # of the stretched arm: about the half-width of column plus hand of common robots
_OWN_FRAMES = 4


def default_clearance(robot: Robot) -> float:
    """A tenth of the arm's length when all links are laid end to end, m."""
    return _SHARE * sum(abs(joint.a) + abs(joint.d) for joint in robot.joints)


def is_clear(robot: _core.Robot, q: np.ndarray, points: tuple[np.ndarray, ...],
             clearance: float) -> np.ndarray:
    """(N,) bool for joint angles q (N, n) and points (N, 3), both in the frame of the robot's base."""
    clear = np.ones(len(q), bool)
    for start, end in skeleton(robot, q) if clearance > 0.0 else ():
        for point in points:
            clear &= _distance(point, start, end) >= clearance
    return clear


def skeleton(robot: _core.Robot, q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """The body's lines, each from (N, 3) to (N, 3), for joint angles q (N, n)."""
    lines = q.shape[1] - _OWN_FRAMES
    if lines < 1:
        return []
    origins, _ = _core.frame_poses(robot, q)
    return [(origins[:, k], origins[:, k + 1]) for k in range(lines)]


def _distance(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(N,) distance of points from line segments, all (N, 3)."""
    along = end - start
    square = np.maximum(np.sum(along**2, axis=1), np.finfo(float).tiny)
    part = np.clip(np.sum((point - start) * along, axis=1) / square, 0.0, 1.0)
    return np.linalg.norm(point - start - part[:, None] * along, axis=1)
