"""Line of sight: whether a tracker at a station sees the target of a pose.

The beam must stay clear of the arm's body (identify/self_collision.py has the skeleton), and must meet the
reflector within its acceptance angle about the axis to which it opens. What else stands in the cell is not
known here.
"""

from dataclasses import dataclass

import numpy as np

from exactarm.design.self_collision import skeleton

# half-angle of a spherically mounted retroreflector of 1.5 in, as its makers state
ACCEPTANCE_RAD = np.radians(30.0)


@dataclass(frozen=True)
class Station:
    """position (3,) of the tracker in the controller's base frame, m; opening (3,): where the reflector opens
    to, in its flange frame, None: to all sides; acceptance: half-angle in rad."""

    position: np.ndarray
    opening: np.ndarray | None = None
    acceptance: float = ACCEPTANCE_RAD

    def sees(self, robot, q: np.ndarray, target: np.ndarray, flange: np.ndarray,
             clearance: float) -> np.ndarray:
        """(N,) bool for joint angles q (N, n), target (N, 3) and flange orientation (N, 3, 3), all in the
        controller's base frame."""
        back = self.position - target
        seen = np.linalg.norm(back, axis=1) > clearance
        if self.opening is not None:
            axis = flange @ (self.opening / np.linalg.norm(self.opening))
            cosine = np.sum(axis * back, axis=1) / np.linalg.norm(back, axis=1)
            seen &= cosine >= np.cos(self.acceptance)
        for start, end in skeleton(robot, q) if clearance > 0.0 else ():
            seen &= segment_distance(target, np.broadcast_to(self.position, target.shape), start,
                                     end) >= clearance
        return seen


def segment_distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """(N,) least distance of the segments a - b and c - d, ends (N, 3). It is
    that between inner points of both, or at an end of one."""
    u, v, w = b - a, d - c, a - c
    uu, uv, vv, uw, vw = (np.sum(x * y, axis=1) for x, y in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    tiny = np.finfo(float).tiny
    across = uu * vv - uv**2
    best = np.full(len(a), np.inf)
    ends = [(s, np.clip((vw + s * uv) / np.maximum(vv, tiny), 0.0, 1.0)) for s in (0.0, 1.0)]
    ends += [(np.clip((t * uv - uw) / np.maximum(uu, tiny), 0.0, 1.0), t) for t in (0.0, 1.0)]
    inside_s = np.clip((uv * vw - vv * uw) / np.maximum(across, tiny), 0.0, 1.0)
    ends.append((inside_s, np.clip((vw + inside_s * uv) / np.maximum(vv, tiny), 0.0, 1.0)))
    for s, t in ends:
        gap = w + np.reshape(s, (-1, 1)) * u - np.reshape(t, (-1, 1)) * v
        best = np.minimum(best, np.linalg.norm(gap, axis=1))
    return best
