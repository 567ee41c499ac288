"""Lens: from a point in the camera's axes to pixels.

    x = X / Z, y = Y / Z, s = x^2 + y^2, g = 1 + k1 s + k2 s^2 + k3 s^3
    x' = x g + 2 p1 x y + p2 (s + 2 x^2)        u = fx x' + cx
    y' = y g + p1 (s + 2 y^2) + 2 p2 x y        v = fy y' + cy

Points (N, 3) m: Z along the view, X to the right of the picture, Y down it. lens (9,): fx, fy, cx, cy in
pixels, k1, k2, p1, p2, k3, as OpenCV counts them. Source: Brown, Photogrammetric Engineering 32(3), 1966.
Limits: no fisheye, nothing behind the camera.
"""

from __future__ import annotations

import numpy as np

LENS = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3")
_NEAREST_M = 1e-6  # what lies nearer or behind is taken there: a search may pass by
_PASSES = 30  # of Newton's method for the inverse: a handful do
_THERE = 1e-14  # of the same: one step more is rounding
_CLOSE = 1e-9  # of the inverse, times the distance from the axis or 1


def project(points: np.ndarray, lens: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixels (N, 2), by the point (N, 2, 3), by the lens (N, 2, 9)."""
    fx, fy, cx, cy = lens[:4]
    depth = np.maximum(points[:, 2], _NEAREST_M)
    flat = points[:, :2] / depth[:, None]
    bent, by_flat, by_bend = _bent(flat, lens[4:])
    focal = np.array([fx, fy])
    pixels = focal * bent + np.array([cx, cy])
    flat_by_point = np.zeros((len(points), 2, 3))
    flat_by_point[:, [0, 1], [0, 1]] = (1.0 / depth)[:, None]
    flat_by_point[:, :, 2] = -flat / depth[:, None]
    by_lens = np.zeros((len(points), 2, len(LENS)))
    by_lens[:, [0, 1], [0, 1]] = bent
    by_lens[:, [0, 1], [2, 3]] = 1.0
    by_lens[:, :, 4:] = focal[:, None] * by_bend
    return pixels, focal[:, None] * (by_flat @ flat_by_point), by_lens


def undistorted(pixels: np.ndarray, lens: np.ndarray) -> np.ndarray:
    """(N, 2): x, y of the rays that the pixels show, by Newton's method; NaN where no ray is found."""
    goal = (pixels - lens[2:4]) / lens[:2]
    flat = goal
    with np.errstate(all="ignore"):  # where the lens folds the picture, a step leads anywhere
        for _ in range(_PASSES):
            bent, slope, _ = _bent(flat, lens[4:])
            away = bent - goal
            if not np.any(np.abs(away) > _THERE * (1.0 + np.abs(goal))):  # what is no number stays none
                break
            (a, b), (c, d) = slope[:, 0].T, slope[:, 1].T
            step = np.stack([d * away[:, 0] - b * away[:, 1], a * away[:, 1] - c * away[:, 0]], axis=1)
            flat = flat - step / (a * d - b * c)[:, None]
        bent, slope, _ = _bent(flat, lens[4:])
        good = np.abs(bent - goal).max(axis=1) <= _CLOSE * (1.0 + np.abs(goal).max(axis=1))
        good &= np.linalg.det(slope) > 0.0  # else beyond the fold, or, below, on the other side of the axis
        good &= np.sum(flat * goal, axis=1) >= -_CLOSE
    return np.where(good[:, None], flat, np.nan)


def _bent(flat: np.ndarray, bend: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x', y' (N, 2), by x, y (N, 2, 2), by k1, k2, p1, p2, k3 (N, 2, 5)."""
    k1, k2, p1, p2, k3 = bend
    x, y = flat.T
    s = x**2 + y**2
    g, slope = 1.0 + s * (k1 + s * (k2 + s * k3)), k1 + s * (2.0 * k2 + 3.0 * s * k3)
    bent = np.stack([x * g + 2.0 * p1 * x * y + p2 * (s + 2.0 * x**2),
                     y * g + p1 * (s + 2.0 * y**2) + 2.0 * p2 * x * y], axis=1)
    across = 2.0 * (x * y * slope + p1 * x + p2 * y)
    by_flat = np.stack([
        np.stack([g + 2.0 * x**2 * slope + 2.0 * p1 * y + 6.0 * p2 * x, across], axis=1),
        np.stack([across, g + 2.0 * y**2 * slope + 6.0 * p1 * y + 2.0 * p2 * x], axis=1),
    ], axis=1)
    by_bend = np.stack([
        np.stack([x * s, x * s**2, 2.0 * x * y, s + 2.0 * x**2, x * s**3], axis=1),
        np.stack([y * s, y * s**2, s + 2.0 * y**2, 2.0 * x * y, y * s**3], axis=1),
    ], axis=1)
    return bent, by_flat, by_bend
