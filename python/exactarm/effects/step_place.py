"""Where a step may lie in rows that were measured one after another: places to try, and the likeliest nearby.

Rows are given in their order, with x (R,) of a slow driver (time, row): a place is a value between two rows.

    jump_k = sum over patterns p of (S_k - T_k / T S)^2 / (T_k (T - T_k) / T)

S_k, T_k: sums of p'r and p'p over the rows 1 to k; S, T over all. It is the square sum that two sizes of the
patterns p, before and after, take from the residual r over one size.
"""

from __future__ import annotations

import numpy as np

LEAST_ROWS = 5  # on either side
_EVENLY, _PEAKS = 20, 8  # places to try: evenly spread, and where the residual seems to jump
_BESIDE = 2  # rows to either side of such a place
_WINDOW = 0.03  # of the rows: so far the place may move at once


def places(x: np.ndarray, residual: np.ndarray, patterns: np.ndarray) -> tuple[float, ...]:
    """Values of x after which there may be a step, none where rows are few; residual (R, c), patterns
    (R, c, p)."""
    count = len(x)
    if count < 4 * LEAST_ROWS:
        return ()
    along = np.cumsum(np.einsum("rcp,rc->rp", patterns, residual), axis=0)
    square = np.cumsum(np.einsum("rcp,rcp->rp", patterns, patterns), axis=0)
    part = square[:-1] / square[-1]
    left = np.maximum(square[:-1] * (1.0 - part), 1e-9 * square[-1])
    jump = np.sum((along[:-1] - part * along[-1]) ** 2 / left, axis=1)
    k = np.arange(1, count)
    inside = slice(LEAST_ROWS - 1, count - LEAST_ROWS)
    peaks = k[inside][np.argsort(-jump[inside])[:_PEAKS]]
    beside = (peaks[:, None] + np.arange(-_BESIDE, _BESIDE + 1)).ravel()
    evenly = np.linspace(LEAST_ROWS, count - LEAST_ROWS, _EVENLY + 2).astype(int)[1:-1]
    chosen = np.unique(np.clip(np.concatenate([beside, evenly]), LEAST_ROWS, count - LEAST_ROWS))
    return tuple(0.5 * (x[i - 1] + x[i]) for i in chosen if x[i] > x[i - 1])


def likelier_place(x: np.ndarray, left: np.ndarray, step: np.ndarray, place: float) -> float:
    """The likeliest place near `place`: left (R, c) the residual without the step, step (R, c) what a row
    shows once it has happened. Residuals have Student's law, so that a wild row decides nothing."""
    if len(x) < 2 * LEAST_ROWS:
        return place
    now, reach = int(np.searchsorted(x, place, side="right")), max(1, int(_WINDOW * len(x)))
    after = np.sum((left - step) ** 2, axis=1)
    before = np.sum(left**2, axis=1)
    square = np.median(np.where(np.arange(len(x)) < now, before, after))
    square = max(square, 1e-12 * float(np.max(before + after)), 1e-300)
    likely = np.cumsum((np.log1p(before / square) - np.log1p(after / square))[::-1])[::-1]
    low, high = max(now - reach, LEAST_ROWS), min(now + reach + 1, len(x) - LEAST_ROWS)
    near = [k for k in range(low, high) if x[k] > x[k - 1]]
    if not near:
        return place
    best = max(near, key=lambda k: likely[k])
    return 0.5 * (x[best - 1] + x[best])
