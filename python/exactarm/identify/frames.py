"""Base and tool frames need no starting values: the user gives no initial guess.

    p_measured = p_base + R_base (p_flange(q) + R_flange(q) p_tool)

For a given tool point the base frame follows in closed form (orthogonal Procrustes, Kabsch 1976); the tool
point, on which the problem is nearly linear, is refined by Gauss-Newton on the variable projection (Golub and
Pereyra 1973) from several seeded starts, and the best end is kept. Orientation, where measured, gives the
rotation of the tool afterwards.
"""

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.numerics.factors import svd
from exactarm.numerics.rotation import nearest, skew
from exactarm.robot.robot import Placement, Robot

_STARTS = 12
_HELD_RAD = 3e-3  # by which axes that are parallel on the drawing lean in a calibrated file
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
    if svd(measured - measured.mean(0), compute_uv=False)[1] < 1e-6:
        raise InputError(
            f"measured points of session {data.session[0]} lie on one line; expected points in space, to "
            "find its frames by", file=data.first_file)
    starts = np.random.default_rng(seed).normal(0.0, _TOOL_REACH_M, (_STARTS, 3))
    starts[0] = 0.0
    ends, costs = _refine(points, rotations, measured, starts)
    best, enough = ends[np.argmin(costs)], _AS_GOOD**2 * costs.min()
    tool_point = _as_declared(best, rotations, robot.tool.position)
    base, residual = procrustes(points + rotations @ tool_point, measured)
    if np.sum(residual**2) > enough:
        tool_point = best
        base, residual = procrustes(points + rotations @ tool_point, measured)
    as_good = ends[(np.linalg.norm(ends - tool_point, axis=1) > _APART_M) & (costs <= enough)]
    tool_rotation = np.eye(3)
    if data.rotation is not None:
        tool_rotation = nearest(np.mean(np.swapaxes(base.rotation @ rotations, -1, -2) @ data.rotation,
                                        axis=0))
    rms = float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))
    scale = _scale(points + rotations @ tool_point, measured)
    return FoundFrames(base, Placement(tool_rotation, tool_point), rms, scale, next(iter(as_good), None))


def _as_declared(tool: np.ndarray, rotations: np.ndarray, declared: np.ndarray) -> np.ndarray:
    """A tool point (3,) with the declared place along directions that the flange holds in all poses, as that
    of a SCARA's quill: a shift of the tool there is one of the base, and the search ends where it began."""
    turned = (rotations - rotations.mean(axis=0)).reshape(-1, 3)
    squares, directions = np.linalg.eigh(turned.T @ turned)
    held = directions[:, squares < _HELD_RAD**2 * len(rotations)]
    return tool + (declared - tool) @ held @ held.T


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


def _refine(points, rotations, measured, tool_points) -> tuple[np.ndarray, np.ndarray]:
    """Where Gauss-Newton on base increment and tool point ends from each of the starts (S, 3), and the sums
    of squares there (S,); the base is projected out anew at every step.

    Sums over rows are all it needs, and an orthogonal transformation of the rows leaves them as they are: of
    any number of poses the 15 rows of R of a QR decomposition are left, of which all starts are refined at
    once.
    """
    columns = np.column_stack([points, rotations.reshape(-1, 9), measured])
    few = np.linalg.qr(columns - columns.mean(0), mode="r")
    points, rotations, measured = few[:, :3], few[:, 3:12].reshape(-1, 3, 3), few[:, 12:]

    def placed(tools: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        arm = points + np.einsum("kij,sj->ski", rotations, tools)
        base = nearest(measured.T @ arm)
        arm = arm @ np.swapaxes(base, -1, -2)
        return base, arm, measured - arm

    tool_points, live = tool_points.copy(), np.arange(len(tool_points))  # live: starts that have not ended
    base, arm, residual = placed(tool_points)
    cost, damping = np.sum(residual**2, axis=(1, 2)), np.full(len(tool_points), 1e-9)
    for _ in range(_STEPS):
        turned = base[live, None] @ rotations
        jacobian = np.concatenate([-skew(arm[live]), turned], axis=-1).reshape(len(live), -1, 6)
        normal = np.swapaxes(jacobian, -1, -2) @ jacobian
        damped = normal + (damping[live, None, None] * normal) * np.eye(6)
        slope = np.einsum("srk,sr->sk", jacobian, residual[live].reshape(len(live), -1))
        step = np.einsum("skl,sl->sk", np.linalg.pinv(damped, rcond=1e-12, hermitian=True), slope)
        trial = tool_points[live] + step[:, 3:]
        trial_base, trial_arm, trial_residual = placed(trial)
        trial_cost = np.sum(trial_residual**2, axis=(1, 2))
        better = trial_cost < cost[live]
        ended = (better & (cost[live] - trial_cost < 1e-12 * cost[live])) | (damping[live] > 1e6)
        damping[live] = np.where(better, np.maximum(0.1 * damping[live], 1e-12),
                                 np.minimum(30.0 * damping[live], 1e8))
        for values, new in ((tool_points, trial), (base, trial_base), (arm, trial_arm),
                            (residual, trial_residual), (cost, trial_cost)):
            values[live[better]] = new[better]
        live = live[~ended]
        if not live.size:
            break
    return tool_points, cost
