"""Time stamps of a run: stretches without a gap, what was lost in between, and the ticks of the clock."""

from __future__ import annotations

import numpy as np

_FIRST_SAMPLES = 400  # as good as all, and quick on a long run
GAP = 1.5  # a step longer than this many typical ones may end a block ...
_LONG = 1.1  # ... and the longest one beyond this, where the clock stays late and none is longer
# ... if the clock stays late by this share of one: median of so many stamps on either side
_LOST, _AROUND = 0.5, 8
_COUNTABLE = 32  # rows: over more the step, as far as it is known, does not tell one sample
_COUNTED = 0.4  # of a step, by which the clock may be later than whole steps say
# of a step; share of the steps: stamps on a grid tell every lost sample by themselves, however many are lost
_OFF_THE_GRID, _GRID = 0.1, 0.99
_LONG_SAMPLES = 10000


def typical_step(time: np.ndarray) -> float:
    """Median sampling interval of one run, s, from its first samples; infinite for a single one."""
    if time.size < 2:
        return np.inf
    steps = np.sort(np.diff(time[:_FIRST_SAMPLES]))  # np.median takes five times as long on so few
    return float(0.5 * (steps[(steps.size - 1) // 2] + steps[steps.size // 2]))


def order_of_sampling(time: np.ndarray) -> np.ndarray:
    """Row indices of one run in the order of its stamps; rows stay as they are where stamps only jitter past
    each other."""
    back = -np.min(np.diff(time), initial=0.0)
    if back == 0.0 or back < typical_step(time):
        return np.arange(time.size)
    return np.argsort(time, kind="stable")


def blocks(time: np.ndarray) -> list[np.ndarray]:
    """Index arrays of the stretches of one run without a gap."""
    if time.size < 2:
        return [np.arange(time.size)]
    step = typical_step(time)
    steps = np.diff(time) / step
    gaps = np.flatnonzero(steps > GAP)
    if gaps.size:
        lost = _lost(time, steps, gaps)
        whole = np.abs(steps - np.maximum(np.round(steps), 1.0)) < _OFF_THE_GRID
        if np.mean(whole) > _GRID:
            lost |= whole[gaps] & whole[np.minimum(gaps + 1, steps.size - 1)]
        gaps = gaps[lost]
    return np.split(np.arange(time.size), np.union1d(gaps, _early_gaps(time, steps, gaps)) + 1)


def _lost(time: np.ndarray, steps: np.ndarray, gaps: np.ndarray) -> np.ndarray:
    """(G,) bool: gaps at which samples were lost, and no stamp was late; steps in typical ones. Of gaps near
    to each other the longest ones, until they say by how much the clock is late behind all of them."""
    lost, step = np.zeros(gaps.size, bool), typical_step(time)
    for places in _near(gaps):
        if gaps[places[-1]] - gaps[places[0]] > _COUNTABLE:
            lost[places] = _lateness(time, gaps[places], gaps[places]) > _LOST * step
            continue
        late = _lateness(time, gaps[places[:1]], gaps[places[-1:]])[0] / step
        for place in places[np.argsort(-steps[gaps[places]], kind="stable")]:
            if late <= _LOST:
                break
            lost[place] = True
            late -= max(round(steps[gaps[place]]) - 1.0, 1.0)
    return lost


def _near(gaps: np.ndarray) -> list[np.ndarray]:
    """Places in `gaps` of those near to each other, together."""
    return np.split(np.arange(gaps.size), np.flatnonzero(np.diff(gaps) > _AROUND) + 1) if gaps.size else []


def _early_gaps(time: np.ndarray, steps: np.ndarray, gaps: np.ndarray) -> np.ndarray:
    """Steps that are no longer than a jittered one, and yet the clock is late behind them and no gap nearby
    says why: the sample behind lost ones came early, or the one before them late. The longest of each place;
    steps in typical ones."""
    long = np.flatnonzero((steps > _LONG) & (steps <= GAP))
    reach = long[:, None] + np.arange(-_AROUND, _AROUND + 1)
    known = np.zeros(steps.size + 2 * _AROUND, bool)
    known[gaps + _AROUND] = True
    long = long[~known[reach + _AROUND].any(axis=1)]
    if not long.size:
        return long
    long = long[_lateness(time, long, long) > _LOST * typical_step(time)]
    places = np.split(long, np.flatnonzero(np.diff(long) > _AROUND) + 1)
    return np.array([place[np.argmax(steps[place])] for place in places if place.size], int)


def _lateness(time: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """By how much the stamps behind each row of `last` are later than those up to its row of `first` say: a
    single late stamp is made up for by the next step, lost samples are not."""
    far = min(2 * _AROUND, time.size - 1)
    # over many steps: their scatter stays small
    step = np.median(time[far:][:_LONG_SAMPLES] - time[:-far][:_LONG_SAMPLES]) / far
    reach = np.arange(_AROUND)
    behind = np.minimum(last[:, None] + 1 + reach, time.size - 1)
    ahead = np.maximum(first[:, None] - reach, 0)
    late = lambda index: np.median(time[index] - step * index, axis=1)
    return late(behind) - late(ahead)


def clocks(time: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rows of the stretches of one run that one even clock has stamped, and at which of its ticks, from 0: it
    has gone on while samples were lost. After a pause, or where nobody can count what was lost, another one
    begins."""
    step, parts = typical_step(time), blocks(time)
    gaps = np.array([rows[-1] for rows in parts[:-1]], int)
    longer = np.diff(time)[gaps] / step - 1.0
    missed = np.zeros(gaps.size, int)  # 0: nobody knows how many
    for places in _near(gaps):
        if longer[places].max() < _AROUND and gaps[places[-1]] - gaps[places[0]] <= _COUNTABLE:
            late = _lateness(time, gaps[places[:1]], gaps[places[-1:]])[0] / step
            if abs(late - round(late)) < _COUNTED and late > places.size - _COUNTED:
                each = np.ones(places.size, int)
                for _ in range(round(late) - places.size):
                    each[np.argmax(longer[places] - each)] += 1
                missed[places] = each
    found = []
    for rows, before in zip(parts, (0, *missed)):
        if before:
            earlier, count = found.pop()
            count = np.concatenate([count, count[-1] + before + 1 + np.arange(rows.size)])
            found.append((np.concatenate([earlier, rows]), count))
        else:
            found.append((rows, np.arange(rows.size)))
    return found


def counted_again(count: np.ndarray, late: np.ndarray) -> np.ndarray:
    """The ticks (R,) of samples that are `late` steps behind those at `count`, with one more or less wherever
    they stay late or early by half of one or more: gaps that stand close together hide each other. `count`
    itself where they do not."""
    if count.size <= 2 * _AROUND:
        return count
    level = np.median(np.lib.stride_tricks.sliding_window_view(late, _AROUND), axis=1)
    jump = np.zeros(count.size - 1)  # behind a sample
    jump[_AROUND - 1 : 1 - _AROUND] = level[_AROUND:] - level[:-_AROUND]
    jump[(jump < 0.0) & (np.diff(count) < 2)] = 0.0
    places = np.flatnonzero(np.abs(jump) > _LOST)
    for near in _near(places):
        place = places[near[np.argmax(np.abs(jump[places[near]]))]]
        count = count + np.where(np.arange(count.size) > place, round(jump[place]), 0)
    return count


def nearest_ticks(count: np.ndarray, late: np.ndarray) -> np.ndarray:
    """The ticks (R,) that samples are nearest to, `late` steps behind those at `count`, as far as each has
    its own: the longest step is not always where samples were lost. `count` itself where none moves."""
    shift = np.round(late).astype(int)
    shift[[0, -1]] = 0
    while np.any(shift):
        held = np.flatnonzero(np.diff(count + shift) < 1)
        if not held.size:
            return count + shift
        shift[held] = shift[held + 1] = 0
    return count
