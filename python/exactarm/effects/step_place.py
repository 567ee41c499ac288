"""Where a step may lie in rows that were measured one after another: places to try, the likeliest nearby, and
between which rows it lies.

Rows are given in their order, with x (R,) of a slow driver (time, row): a place is a value between two rows.

    jump_k = sum over patterns p of (S_k - T_k / T S)^2 / (T_k (T - T_k) / T)
    log p(k) = sum over rows 1..k of l(before_i) + sum over the others of l(after_i) + const,
               l(e) = -(f + c) / 2 log(1 + |e|^2 / (f s^2))

S_k, T_k: sums of p'r and p'p over the rows 1 to k; S, T over all. The first is the square sum that two sizes
of the patterns p, before and after, take from the residual r over one size. before, after (R, c): residuals
as if a row were measured before the step, or after it; l is Student's law with f degrees of freedom, so that
a wild row decides nothing. Every place is as likely as the others before any data.
"""

import numpy as np
from scipy import special

LEAST_ROWS = 5  # on either side, where nothing else shows the state there
EITHER = (LEAST_ROWS, LEAST_ROWS)
_EVENLY, _PEAKS = 20, 8  # places to try: evenly spread, and where the residual seems to jump
_BESIDE = 2  # rows to either side of such a place
_WINDOW = 0.03  # of the rows: so far the place may move at once
_TAIL_FREEDOM = 4.0
_SURE = 0.95


def places(x: np.ndarray, residual: np.ndarray, patterns: np.ndarray,
           least: tuple[int, int] = EITHER) -> tuple[float, ...]:
    """Values of x after which there may be a step, none where rows are few; residual (R, c), patterns
    (R, c, p); least: rows before and after it."""
    count = len(x)
    square = np.cumsum(np.einsum("rcp,rcp->rp", patterns, patterns), axis=0)
    if count < 4 * LEAST_ROWS or count <= sum(least) or not np.any(square[-1]):
        return ()
    shown = square[-1] > 0.0
    along = np.cumsum(np.einsum("rcp,rc->rp", patterns, residual), axis=0)[:, shown]
    square = square[:, shown]
    part = square[:-1] / square[-1]
    left = np.maximum(square[:-1] * (1.0 - part), 1e-9 * square[-1])
    jump = np.sum((along[:-1] - part * along[-1]) ** 2 / left, axis=1)
    k = np.arange(1, count)
    first, last = least[0], count - least[1]
    inside = slice(first - 1, last)
    peaks = k[inside][np.argsort(-jump[inside])[:_PEAKS]]
    beside = (peaks[:, None] + np.arange(-_BESIDE, _BESIDE + 1)).ravel()
    evenly = np.linspace(first, last, _EVENLY + 2).astype(int)[1:-1]
    chosen = np.unique(np.clip(np.concatenate([beside, evenly]), first, last))
    return tuple(0.5 * (x[i - 1] + x[i]) for i in chosen if x[i] > x[i - 1])


def likelier_place(x: np.ndarray, before: np.ndarray, after: np.ndarray, place: float,
                   least: tuple[int, int] = EITHER) -> float:
    """The likeliest place near `place`, with `least` rows before and after it."""
    if len(x) < 2 * LEAST_ROWS:
        return place
    now, reach = int(np.searchsorted(x, place, side="right")), max(1, int(_WINDOW * len(x)))
    likely = _log_likelihood(before, after, now)
    low, high = max(now - reach, least[0]), min(now + reach, len(x) - least[1])
    near = [k for k in range(low, high + 1) if x[k] > x[k - 1]]
    if not near:
        return place
    best = max(near, key=lambda k: likely[k])
    return 0.5 * (x[best - 1] + x[best])


def place_between(x: np.ndarray, before: np.ndarray, after: np.ndarray, place: float) -> tuple[float, float]:
    """Two rows, by their x, between which the step lies with 95 %, its size being known."""
    count = len(x)
    now = int(np.searchsorted(x, place, side="right"))
    likely = _log_likelihood(before, after, now)[1:count]
    likely = np.where(np.diff(x) > 0.0, likely, -np.inf)  # k rows before the step, k from 1
    if not np.isfinite(likely).any():
        return place, place
    share = np.exp(likely - likely.max())
    order = np.argsort(-share, kind="stable")
    held = order[: 1 + int(np.searchsorted(np.cumsum(share[order]), _SURE * share.sum()))] + 1
    return float(min(x[held.min() - 1], place)), float(max(x[held.max()], place))


def _log_likelihood(before: np.ndarray, after: np.ndarray, now: int) -> np.ndarray:
    """(R + 1,) of k rows before the step, up to a constant; the noise by the rows with `now` before it."""
    numbers = before.shape[1]
    squares = np.sum(before**2, axis=1), np.sum(after**2, axis=1)
    median = np.median(np.where(np.arange(len(before)) < now, *squares))
    variance = max(median / special.chdtri(numbers, 0.5), 1e-12 * float(np.max(squares)), 1e-300)
    laws = [-0.5 * (_TAIL_FREEDOM + numbers) * np.log1p(s / (_TAIL_FREEDOM * variance)) for s in squares]
    return np.concatenate([[0.0], np.cumsum(laws[0] - laws[1])])
