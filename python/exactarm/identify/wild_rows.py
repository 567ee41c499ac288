"""Wild rows: readings that belong to no arm, found by their distance from the others after a first fit.

A row is wild when its error is more than 8 times the median of all. A few of them spoil least squares: three
of 105 rows that were 5 to 50 mm off made a six-axis arm miss by 0.68 mm, and by 0.05 mm under Huber's loss.
"""

from collections.abc import Callable, Sequence

import numpy as np

# times the median error: the worst of 1,495 tracker rows of a UR10 stands at 5.9, of noise that is normal in
# three directions none of 1e30; effects that a model lacks stay below, for they are everywhere
WILD = 8.0
_MOST_TOGETHER = 3  # samples: a beam that was broken and is back; a swing of the arm has some ten
_MOST_SINGLE = 0.02  # of the rows
_NAMED = 3  # rows in a line
_SEEN_M = 1e-6  # below, it is the arithmetic of exact data


def wild_rows(error: np.ndarray) -> np.ndarray:
    """(N,) bool of errors (N,)."""
    return error > WILD * np.median(error) if error.size else np.zeros(0, bool)


def single_wild_rows(error: np.ndarray, runs: Sequence[np.ndarray]) -> np.ndarray:
    """(N,) bool of errors (N,) in the order of time in each run: at most `_MOST_TOGETHER` wild ones one after
    another, and few of all. What a model lacks stays for longer."""
    wild, single = wild_rows(error), np.zeros(error.size, bool)
    for rows in runs:
        edges = np.flatnonzero(np.diff(np.concatenate([[False], wild[rows], [False]])))
        for first, end in zip(edges[::2], edges[1::2]):
            single[rows[first:end]] = end - first <= _MOST_TOGETHER
    return _few(single)


def wild_rows_line(error: np.ndarray, wild: np.ndarray) -> str:
    """What a result says of wild rows among errors (N,) in m."""
    those = f"{wild.sum()} of {wild.size} rows miss" if wild.sum() > 1 else f"1 of {wild.size} rows misses"
    return (f"{those} by more than {WILD:g} times the median, by up to {1e3 * error[wild].max():.3g} mm: "
            "all were fitted with Huber's loss, which gives such rows less weight")


def single_wild(error: np.ndarray) -> np.ndarray:
    """(N,) bool of finite errors (N,): wild rows, where they are few of all."""
    return _few(wild_rows(error) & (error > _SEEN_M))


def _few(wild: np.ndarray) -> np.ndarray:
    return wild if wild.mean() <= _MOST_SINGLE else np.zeros(wild.size, bool)


def wild_elsewhere_line(error: np.ndarray, place_of: Callable[[int], str],
                        spread: np.ndarray | float = 0.0, which: str = "rows that were not fitted"
                        ) -> str | None:
    """What a result says of wild rows among errors (N,) in m of the rows `which`, which no fit sets apart;
    NaN: left out. place_of: row to words; spread (N,): of each error, m, by what the fit does not know: a
    right row far from those that were fitted may err more than they."""
    known = np.flatnonzero(np.isfinite(error))
    wild = wild_rows(error[known]) & (error[known] > _SEEN_M)
    wild &= error[known] > WILD * np.broadcast_to(spread, error.shape)[known]
    if not wild.any():
        return None
    worst, others = known[wild][np.argsort(-error[known[wild]])], error[known[~wild]]
    places = ", ".join([place_of(int(row)) for row in worst[:_NAMED]] + ["..."] * int(wild.sum() > _NAMED))
    miss, what = ("miss by up to", "wrong readings") if wild.sum() > 1 else ("misses by", "a wrong reading")
    return (f"{places} {miss} {1e3 * error[worst[0]]:.3g} mm, more than {WILD:g} times the median of the "
            f"{known.size} {which}; the others miss by "
            f"{1e3 * np.sqrt(np.mean(others**2)):.3g} mm (RMS): {what}?")


def left_out_line(error: np.ndarray, wild: np.ndarray) -> str:
    """What a result says of single readings among errors (N,) in m that count nowhere."""
    some = "readings jump" if wild.sum() > 1 else "reading jumps"
    return (f"{wild.sum()} of {wild.size} {some} away from the path and back within {_MOST_TOGETHER} "
            f"samples, by up to {1e3 * error[wild].max():.3g} mm: left out")
