"""Base and tool frames from nowhere: no initial guess is asked of the user.

    p_measured = p_base + R_base (p_flange(q) + R_flange(q) p_tool)

For a given tool point the base frame follows in closed form (orthogonal Procrustes, Kabsch 1976); the tool
point, on which the problem is nearly linear, is refined by Gauss-Newton on the variable projection (Golub and
Pereyra 1973) from several seeded starts, and the best end is kept. Orientation, where measured, gives the
rotation of the tool afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.dataset import Dataset
from exactarm.errors import InputError
from exactarm.robot import Placement, Robot
from exactarm.rotation import nearest
from exactarm.split import DEFAULT_SEED

_STARTS = 12
_TOOL_REACH_M = 0.5  # spread of the random starts of the tool point
_STEPS = 40
# another end of the search that far off with such a share of the RMS is as good
_APART_M, _AS_GOOD = 0.01, 1.1


@dataclass(frozen=True)
class FoundFrames:
    """Base and tool frame of one set-up, RMS of what is left (m), and the scale of the data that fits best.

    other_tool (3,): a tool point elsewhere with which the frames fit as well, or None.
    """

    base: Placement
    tool: Placement
    rms: float
    scale: float
    other_tool: np.ndarray | None = None


def find_frames(robot: Robot, data: Dataset, layout: Layout | None = None,
                seed: int = DEFAULT_SEED) -> FoundFrames:
    """Frames of one session by the robot as declared (with the effects of `layout`, none free).

    Raises InputError with fewer than 4 different poses or when all targets lie on one line.
    """
    identity = replace(robot, base=Placement(), tool=Placement())
    flange = predict_poses(identity, layout or Layout.of(()), data, tangents=False)
    points, rotations, measured = flange.position, flange.rotation, data.position
    poses = np.column_stack([points, rotations.reshape(-1, 9)])  # a turntable's flange turns on its place
    distinct = len(np.unique(np.round(poses, 9), axis=0))
    if distinct < 4:
        raise InputError(
            f"different poses of session {data.session[0]} to find its frames by: {distinct}; expected at "
            "least 4", file=data.first_file)
    if np.linalg.svd(measured - measured.mean(0), compute_uv=False)[1] < 1e-6:
        raise InputError(
            f"measured points of session {data.session[0]} lie on one line; expected points in space, to "
            "find its frames by",
            file=data.first_file,
        )
    starts = np.random.default_rng(seed).normal(0.0, _TOOL_REACH_M, (_STARTS, 3))
    starts[0] = 0.0
    ends = [_refine(points, rotations, measured, start) for start in starts]
    tool_point, cost = min(ends, key=lambda end: end[1])
    as_good = (end for end, other in ends
               if other <= _AS_GOOD**2 * cost and np.linalg.norm(end - tool_point) > _APART_M)
    base, residual = procrustes(points + rotations @ tool_point, measured)
    tool_rotation = np.eye(3)
    if data.rotation is not None:
        tool_rotation = nearest(np.mean(np.swapaxes(base.rotation @ rotations, -1, -2) @ data.rotation,
                                        axis=0))
    rms = float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))
    scale = _scale(points + rotations @ tool_point, measured)
    return FoundFrames(base, Placement(tool_rotation, tool_point), rms, scale, next(as_good, None))


def procrustes(source: np.ndarray, target: np.ndarray) -> tuple[Placement, np.ndarray]:
    """The rigid motion that takes `source` to `target` (N, 3) best, and the residual (N, 3)."""
    source_mean, target_mean = source.mean(0), target.mean(0)
    rotation = nearest((target - target_mean).T @ (source - source_mean))
    position = target_mean - rotation @ source_mean
    return Placement(rotation, position), target - source @ rotation.T - position


def _scale(source: np.ndarray, target: np.ndarray) -> float:
    """Ratio of the spreads: about 1 where both are in the same unit."""
    spread = lambda points: np.sqrt(np.mean(np.sum((points - points.mean(0)) ** 2, axis=1)))
    return float(spread(target) / max(spread(source), 1e-300))


def _refine(points, rotations, measured, tool_point) -> tuple[np.ndarray, float]:
    """Gauss-Newton on base increment and tool point; the base is projected out anew at every step."""
    base, residual = procrustes(points + rotations @ tool_point, measured)
    cost, damping = float(np.sum(residual**2)), 1e-9
    for _ in range(_STEPS):
        turned = base.rotation @ rotations
        arm = (points + rotations @ tool_point) @ base.rotation.T
        arm -= arm.mean(0)
        jacobian = np.zeros((len(points), 3, 9))
        jacobian[:, :, :3] = np.eye(3)
        jacobian[:, 0, 4], jacobian[:, 0, 5] = arm[:, 2], -arm[:, 1]
        jacobian[:, 1, 3], jacobian[:, 1, 5] = -arm[:, 2], arm[:, 0]
        jacobian[:, 2, 3], jacobian[:, 2, 4] = arm[:, 1], -arm[:, 0]
        jacobian[:, :, 6:] = turned
        rows = jacobian.reshape(-1, 9)
        normal = rows.T @ rows
        step = np.linalg.lstsq(normal + damping * np.diag(np.diag(normal)), rows.T @ residual.ravel(),
                               rcond=1e-12)[0]
        trial_tool = tool_point + step[6:]
        trial_base, trial_residual = procrustes(points + rotations @ trial_tool, measured)
        trial_cost = float(np.sum(trial_residual**2))
        if trial_cost < cost:
            small = cost - trial_cost < 1e-12 * cost
            tool_point, base, residual, cost = trial_tool, trial_base, trial_residual, trial_cost
            damping = max(0.1 * damping, 1e-12)
            if small:
                break
        else:
            damping *= 30.0
            if damping > 1e6:
                break
    return tool_point, cost
