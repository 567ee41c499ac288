"""In which direction an axis moves, and how its gear passes from one direction's table to the other's at a
reversal.

The model has a gear table for each direction of motion and none for what lies between (thesis 3.1.2, 4.1).
The convention here, the same for plans, virtual robots and measured motions:
    d(t) = d_0 + sum_k 2 d_k C((t - t_k) / T),   Xi = (1 - d) / 2 Xi_cw + (1 + d) / 2 Xi_ccw,
                                                 T = TRANSITION_S
t_k: the reversals, d_k = +-1 the direction behind them. C is the integral of a B-spline of degree 5 on (-1/2,
1/2): half of the passage lies before the reversal, half behind, it has five continuous derivatives, and no
motor angle jumps.

    A reversal is a turning point that the axis leaves by more than LEAST_TURN_RAD: less is rest, with its
        jitter.
    It lies midway between the instants at which the axis is half of that away from it; so a rest is halved.
    At rest the direction is that of the last motion, before the first motion that of the coming one.
    An axis that never moves has the direction 0: the mean of both tables.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
import scipy  # scipy.interpolate is imported at its first use

from exactarm.data.rows import LEAST_TURN_RAD

TRANSITION_S = 0.05  # what a passage asks of the motor stays below about 50 Hz
_DEGREE = 5


def direction_of_motion(time: np.ndarray, angle: np.ndarray, passage_s: float | None = None,
                        late_s: float = 0.0, rested: float = 0.5) -> np.ndarray:
    """(N, n) in [-1, 1] for angles (N, n) rad at `time` (N,) s, rising; the sign is that of the angle's
    motion.

    passage_s: how long each passage takes, where it is not TRANSITION_S; late_s: how far its middle lies
    behind the instant at which this share of the rest at the reversal is over.
    """
    passage_s = TRANSITION_S if passage_s is None else passage_s
    direction = np.zeros(angle.shape)
    for i, column in enumerate(angle.T):
        first, turns = rests(time, column)
        direction[:, i] = first
        for turn, rest, after in turns:
            share = (time - turn - (rested - 0.5) * rest - late_s) / passage_s
            passing, passed = np.searchsorted(share, (-0.5, 0.5))  # few of the samples
            direction[passing:passed, i] += 2.0 * after * _passed(share[passing:passed])
            direction[passed:, i] += 2.0 * after
    return np.clip(direction, -1.0, 1.0)


def reversals(time: np.ndarray, angle: np.ndarray) -> tuple[float, list[tuple[float, float]]]:
    """First direction of angle (N,), 0: none, and (instant, direction behind it) of every reversal."""
    first, found = rests(time, angle)
    return first, [(instant, after) for instant, _, after in found]


def rests(time: np.ndarray, angle: np.ndarray) -> tuple[float, list[tuple[float, float, float]]]:
    """The same with how long the axis rests about the instant (s), 0 where it turns back at once."""
    moves = np.sign(np.diff(angle))
    moving = np.flatnonzero(moves)
    if not moving.size:
        return 0.0, []
    changes = np.flatnonzero(np.diff(moves[moving]))
    extremes = np.concatenate([[0], moving[changes + 1], [len(angle) - 1]])
    first, side, turns, low, high = 0.0, 0.0, [], 0, 0
    for k in extremes:
        low, high = (k if angle[k] < angle[low] else low), (k if angle[k] > angle[high] else high)
        if side >= 0.0 and angle[high] - angle[k] > LEAST_TURN_RAD:
            after, extreme = -1.0, high
        elif side <= 0.0 and angle[k] - angle[low] > LEAST_TURN_RAD:
            after, extreme = 1.0, low
        else:
            continue
        if side:
            turns.append((extreme, after))
        else:
            first = after
        side, low, high = after, k, k
    marks = [0, *(k for k, _ in turns), len(angle) - 1]
    return first, [(*_rest(time, angle, *marks[j : j + 3], after), after)
                   for j, (_, after) in enumerate(turns)]


def eased(values: np.ndarray, step: float) -> np.ndarray:
    """(N, c) values folded with the passage's kernel at equal steps: jumps become smooth, constants stay."""
    half = int(np.ceil(0.5 * TRANSITION_S / step))
    edges = step * (np.arange(-half, half + 2) - 0.5) / TRANSITION_S
    kernel = np.diff(_passed(edges))
    padded = np.pad(values, ((half, half), (0, 0)), mode="edge")
    return np.column_stack([np.convolve(column, kernel, mode="valid") for column in padded.T])


def _passed(s: np.ndarray) -> np.ndarray:
    """C(s): 0 before the passage, 1 behind it."""
    step = _step()
    return (step(np.clip(s, -0.5, 0.5)) - step(-0.5)) / (step(0.5) - step(-0.5))


@cache
def _step() -> Callable[[np.ndarray | float], np.ndarray]:
    spline = scipy.interpolate.BSpline
    kernel = spline.basis_element(np.linspace(-0.5, 0.5, _DEGREE + 2), extrapolate=False)
    return spline.construct_fast(kernel.t, kernel.c, kernel.k).antiderivative()


def _rest(time: np.ndarray, angle: np.ndarray, start: int, k: int, end: int,
          after: float) -> tuple[float, float]:
    """Middle of the stay near the extreme at sample k, between the neighbouring turning points `start` and
    `end`, and how long of it the axis rests.

    Coarse samples widen the stay to two of them. About a turning point the root of the distance is nearly
    straight in time; so what twice the stay at one root is longer than the stay at twice this root is rest.
    """
    root = np.sqrt(np.maximum(after * (angle[start : end + 1] - angle[k]), 0.0))
    here = k - start
    wanted = max(0.5 * LEAST_TURN_RAD, 2.0 * np.max(root[max(here - 1, 0) : here + 2] ** 2))
    most = min(np.max(root[: here + 1]), np.max(root[here:]))
    level = min(np.sqrt(wanted), most)

    def crossings(level: float) -> list[float]:
        before = np.flatnonzero(root[: here + 1] >= level)[-1]
        behind = here + np.flatnonzero(root[here:] >= level)[0]
        found = []
        for outside, inside in ((before, before + 1), (behind, behind - 1)):
            share = (level - root[inside]) / (root[outside] - root[inside])
            found.append(time[start + inside] + share * (time[start + outside] - time[start + inside]))
        return found

    stay = crossings(level)
    wider = crossings(2.0 * level) if 2.0 * level <= most else None
    rest = 0.0 if wider is None else max(2.0 * (stay[1] - stay[0]) - (wider[1] - wider[0]), 0.0)
    return float(np.mean(stay)), float(rest)
