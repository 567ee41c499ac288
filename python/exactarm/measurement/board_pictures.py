"""Board pictures: where a camera stood before a flat board, picture by picture, from corners alone; and how
two unknown frames follow from many such pictures.

    s (x, y, 1)' = H (X, Y, 1)'          H (3, 3): from the board's plane to the picture; direct linear
    H ~ K [r1 r2 t]                      transformation, then pose; focal length from r1'r2 = 0, |r1| = |r2|
    T_i M = W C_i                        T_i: target, C_i: the pose that the picture shows; M, W: unknown

Good to some pixels: a start, not an estimate. Lengths in m. Source: Zhang, IEEE PAMI 22(11), 2000 (H, focal
length); Shah, J. Mechanisms Robotics 5(3), 2013 (M and W).
"""

from __future__ import annotations

import numpy as np

from exactarm.numerics.factors import lstsq, svd
from exactarm.numerics.rotation import log, nearest

Pose = tuple[np.ndarray, np.ndarray]  # rotation (..., 3, 3), position (..., 3) m
LEAST_CORNERS = 6  # of a picture: a plane's four with something to spare
_GROSS = 10.0  # times the median: a corner that was not found where it is, not a noisy one
_CUBIC = 10  # terms of a polynomial of third order: what a lens does to a picture
_WRONG = 4.0  # times the median turn between the two sides of T M = W C: a flipped picture, left out


def homography(board: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """(3, 3) from `board` (K, 2) to `seen` (K, 2), |H| = 1."""
    scaled, own = zip(*(_scaled(points) for points in (board, seen)))
    ones = np.column_stack([scaled[0], np.ones(len(board))])
    zero = np.zeros_like(ones)
    rows = np.concatenate([np.hstack([ones, zero, -scaled[1][:, :1] * ones]),
                           np.hstack([zero, ones, -scaled[1][:, 1:] * ones])])
    found = svd(rows)[2][-1].reshape(3, 3)
    found = np.linalg.solve(own[1], found @ own[0])
    return found / np.linalg.norm(found)


def gross_corners(board: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """(K,) bool: corners far beside where the others of the picture put them, by a plane's homography and a
    cubic for the lens."""
    gross = np.zeros(len(board), bool)
    for _ in range(len(board)):
        good = ~gross
        if good.sum() < 2 * _CUBIC:
            break
        h = homography(board[good], seen[good])
        flat = np.column_stack([board, np.ones(len(board))]) @ h.T
        rest = seen - flat[:, :2] / flat[:, 2:]
        x, y = _scaled(board)[0].T
        terms = np.stack([x**i * y**k for i in range(4) for k in range(4 - i)], axis=1)
        rest = rest - terms @ lstsq(terms[good], rest[good], rcond=None)[0]
        size = np.linalg.norm(rest, axis=1)
        worst = int(np.argmax(np.where(good, size, 0.0)))
        if size[worst] <= _GROSS * max(float(np.median(size[good])), 1e-9):
            break
        gross[worst] = True
    return gross


def _scaled(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points about their mean at unit spread, and the matrix that makes them so."""
    middle, size = points.mean(axis=0), max(float(points.std()), 1e-12)
    matrix = np.array([[1.0 / size, 0.0, -middle[0] / size], [0.0, 1.0 / size, -middle[1] / size],
                       [0.0, 0.0, 1.0]])
    return (points - middle) / size, matrix


def focal_length(homographies: list[np.ndarray]) -> float | None:
    """Of square pixels whose middle is the origin; None where no picture is tilted enough to tell."""
    rows, right = [], []
    for h in homographies:
        a, b = h[:, 0], h[:, 1]
        rows += [a[:2] @ b[:2], a[:2] @ a[:2] - b[:2] @ b[:2]]
        right += [-a[2] * b[2], b[2] ** 2 - a[2] ** 2]
    rows, right = np.array(rows), np.array(right)
    square = float(rows @ right) / max(float(rows @ rows), 1e-300)
    return float(1.0 / np.sqrt(square)) if square > 0.0 else None


def pose_of(h: np.ndarray) -> Pose:
    """The board's frame in the camera's axes, from the homography to x = X / Z, y = Y / Z."""
    size = 0.5 * (np.linalg.norm(h[:, 0]) + np.linalg.norm(h[:, 1]))
    h = h / (size if h[2, 2] > 0.0 else -size)
    rotation = nearest(np.column_stack([h[:, 0], h[:, 1], np.cross(h[:, 0], h[:, 1])]))
    return rotation, h[:, 2]


def inverse(pose: Pose) -> Pose:
    turned = np.swapaxes(pose[0], -1, -2)
    return turned, -np.einsum("...ij,...j->...i", turned, pose[1])


def two_frames(targets: Pose, shown: Pose) -> tuple[Pose, Pose, float]:
    """M and W of T_i M = W C_i by least squares, and the RMS (m) of what is left of the positions."""
    good = np.ones(len(targets[0]), bool)
    for _ in range(3):
        mount, world = _rotations(targets[0][good], shown[0][good])
        left = np.linalg.norm(log(np.swapaxes(world @ shown[0], -1, -2) @ targets[0] @ mount), axis=1)
        good = left <= _WRONG * max(float(np.median(left)), 1e-9)
    columns = np.concatenate([targets[0], np.tile(-np.eye(3), (len(good), 1, 1))], axis=2)
    goal = np.einsum("ij,kj->ki", world, shown[1]) - targets[1]
    solution = lstsq(columns[good].reshape(-1, 6), goal[good].ravel(), rcond=1e-9)[0]
    rest = (goal - columns @ solution)[good]
    rms = float(np.sqrt(np.mean(np.sum(rest**2, axis=1))))
    return (mount, solution[:3]), (world, solution[3:]), rms


def _rotations(targets: np.ndarray, shown: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R_M, R_W: the leading singular pair of sum kron(T_i, C_i) has vec(R_W) on the left, vec(R_M) on the
    right."""
    total = np.einsum("kij,kab->iajb", targets, shown).reshape(9, 9)
    left, _, right = svd(total)
    world, mount = left[:, 0].reshape(3, 3), right[0].reshape(3, 3)
    sign = np.sign(np.linalg.det(world))
    return nearest(sign * mount), nearest(sign * world)
