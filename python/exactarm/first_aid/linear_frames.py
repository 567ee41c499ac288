"""Base and tool frames by linear least squares: what the usual mistakes of poses are tried on.

    R_base' (p_measured - p_base) = p_flange + R_flange p_tool

with R_base' replaced by any matrix M (15 unknowns), then with the rotation nearest to M (6 unknowns). What M
leaves is the least that any frames can leave; what the second fit leaves is an upper bound for the best ones.
Stacks (S, N, ...) of such fits are solved together: M and p_base stand at the 4 columns that the three
coordinates share, and without them 3 unknowns are left.
"""

import numpy as np

from exactarm.numerics.factors import lstsq
from exactarm.numerics.rotation import nearest

_WELL_POSED = 1e-6  # on the diagonal of R, of columns with an RMS of one: below it the least norm is taken


def linear_frames(points: np.ndarray, rotations: np.ndarray, measured: np.ndarray,
                  most: float = np.inf) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Rotation of the base frame, offset of the points and tool (6,), what is left of every row (N, 3), and
    the size of the device's points beside the arm's. Where no matrix in place of the rotation leaves less
    than `most` (RMS, m), what that one leaves, and no frames."""
    columns, scale, found = _free(points, rotations, measured)
    bound = points - columns @ found
    if np.sum(bound**2) > most**2 * len(points):
        return np.eye(3), np.zeros(6), bound, 1.0
    centred = measured - measured.mean(axis=0)
    base = nearest(found[:9].reshape(3, 3) / scale).T
    turned, goal = columns[:, :, 9:], points - centred @ base
    target = points + rotations @ found[12:]  # a spread, not a determinant: points may lie on a line
    arm = float(np.sqrt(np.mean((target - target.mean(axis=0)) ** 2)))
    offset = solved(turned, goal)
    return base, offset, goal - turned @ offset, float(np.clip(scale / max(arm, 1e-300), 1e-9, 1e9))


def _free(points: np.ndarray, rotations: np.ndarray,
          measured: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """Columns of the linear fit, the size that it takes for one, and its unknowns (15,)."""
    centred = measured - measured.mean(axis=0)
    scale = max(float(np.sqrt(np.mean(centred**2))), 1e-300)
    columns = np.zeros((len(points), 3, 15))
    for k in range(3):
        columns[:, k, 3 * k : 3 * k + 3] = centred / scale
        columns[:, k, 9 + k] = 1.0
    columns[:, :, 12:] = -rotations
    return columns, scale, solved(columns, points)


def free_frames(points: np.ndarray, rotations: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(3, 3) the matrix in place of the base's rotation that fits best; its columns belong to x, y, z."""
    _, scale, found = _free(points, rotations, measured)
    return found[:9].reshape(3, 3) / scale


def linear_tool(points: np.ndarray, rotations: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(3,) the tool point that the linear fit of all frames finds, m."""
    return _free(points, rotations, measured)[2][12:]


def solved(columns: np.ndarray, goal: np.ndarray) -> np.ndarray:
    rows = columns.reshape(-1, columns.shape[2])
    return lstsq(rows, goal.ravel(), rcond=1e-9)[0]


def least_left(points: np.ndarray, rotations: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(S,) square sum in m^2 below which no frames go, of S sets of rows; a row of zeros in all three (and in
    `measured` a fourth coordinate, 1 elsewhere) is none."""
    if measured.shape[2] == 3:
        measured = np.concatenate([measured, np.ones((*measured.shape[:2], 1))], axis=2)
    return _without(measured, points, rotations)[2][:, 3, 3] ** 2


def frames_of_stack(points: np.ndarray, rotations: np.ndarray,
                    measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`linear_frames` of S sets of rows: rotations of the base frame (S, 3, 3) and offsets (S, 6)."""
    centred, ones = measured - measured.mean(axis=1, keepdims=True), np.ones((*points.shape[:2], 1))
    scale = np.maximum(np.sqrt(np.mean(centred**2, axis=(1, 2), keepdims=True)), 1e-300)
    shared, onto, tool = _without(np.concatenate([centred / scale, ones], axis=2), points, rotations)
    base, offset = np.zeros((len(points), 3, 3)), np.zeros((len(points), 6))
    rows = points.shape[1]
    well = np.flatnonzero(_well_posed(shared, rows) & _well_posed(tool[:, :3, :3], rows))
    free = np.linalg.solve(shared[well], _with_tool(onto[well], -_solution(tool[well])))
    base[well] = np.swapaxes(nearest(np.swapaxes(free[:, :3], 1, 2) / scale[well]), 1, 2)
    goal = points[well] - centred[well] @ base[well]
    shared, onto, tool = _without(ones[well], goal, rotations[well])
    turns = _well_posed(tool[:, :3, :3], rows)
    tool[~turns] = np.eye(4)
    offset[well, 3:] = -_solution(tool)
    offset[well, :3] = _with_tool(onto, offset[well, 3:])[:, 0] / shared[:, 0]
    for k in sorted(set(range(len(points))) - set(well[turns].tolist())):
        base[k], offset[k], *_ = linear_frames(points[k], rotations[k], measured[k])
    return base, offset


def _without(shared: np.ndarray, points: np.ndarray,
             rotations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """R (S, c, c) of the columns `shared` (S, N, c), what of rotations and points stands in them
    (S, c, 3, 4), and R (S, 4, 4) of what does not."""
    size, rows = points.shape[:2]
    columns = np.concatenate([rotations, points[..., None]], axis=3).reshape(size, rows, 12)
    own, triangle = np.linalg.qr(shared)
    onto = np.swapaxes(own, 1, 2) @ columns
    rest = (columns - own @ onto).reshape(size, 3 * rows, 4)
    return triangle, onto.reshape(size, shared.shape[2], 3, 4), np.linalg.qr(rest, mode="r")


def _well_posed(triangle: np.ndarray, rows: int) -> np.ndarray:
    diagonal = np.abs(np.diagonal(triangle, axis1=1, axis2=2))
    return diagonal.min(axis=1) > _WELL_POSED * np.sqrt(rows)


def _solution(triangle: np.ndarray) -> np.ndarray:
    return np.linalg.solve(triangle[:, :3, :3], triangle[:, :3, 3:])[..., 0]


def _with_tool(onto: np.ndarray, tool: np.ndarray) -> np.ndarray:
    return onto[..., 3] + np.einsum("scij,sj->sci", onto[..., :3], tool)
