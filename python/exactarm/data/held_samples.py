"""Held samples: readings that a log repeats until the next one comes.

A log that writes the last reading of every device at its own rate repeats those of slow devices. Fitted as
they stand, the copies are late by up to a period of the device. A quantity is held where its readings stay
the same for the same number of rows each time, whatever the speed, and then change by many of the smallest
steps that they show (a rounded reading that stays the same changes by one). A spline through its new readings
stands for it, at the even times of its own clock. Where what is measured is held, the rows are used in which
the slowest of it is new: those between hold no noise of their own. Angles of the motors are known between.
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from exactarm.data.kinds import kind_of
from exactarm.data.kinds.base import LEAST_SAMPLES, runs_in_time
from exactarm.data.rows import Rows
from exactarm.numerics.signals import by_spline, even_clock
from exactarm.numerics.stamps import typical_step

Data = TypeVar("Data", bound=Rows)

# rows a reading, on average: noise of two rounding steps repeats itself in one row of seven (1.16)
_LEAST_HELD = 1.2
_SAME_LENGTH = 0.9  # of the stretches, within a row of the average; networks delay some
_STANDS = 3.0  # times the median stretch: longer ones are a standstill
_ROUNDING_STEPS = 3.0  # a rounded reading changes by one, at most two, after it has stayed the same
_LEAST_STRETCHES = 20
_EVEN = 1e-6  # of a step: rounding
# rows in which the motors have moved further than in one of them; share of others that may repeat
_LEAST_FROZEN, _REPEATED = 4, 0.01


@dataclass(frozen=True)
class _Held:
    """A quantity that is held: its words, rows a reading, and per run the places where it is new."""

    words: str
    length: float
    fresh: list[np.ndarray]


def without_held(data: Data) -> Data:
    """The rows of a series in which its slowest quantity is new; the same rows where none is held."""
    if data.time is None or kind_of(data.kind).at_rest:
        return data
    runs = runs_in_time(data)
    signals = _signals(data)
    held = {name: found for name, (values, words) in signals.items()
            if (found := _held(values, words, runs)) is not None}
    if not held:
        return data
    measured = [found for name, found in held.items() if name not in _commanded(data)]
    slowest = max(measured, key=lambda found: found.length, default=None)
    picked, times, parts = [], [], {name: [] for name in signals}
    for k, rows in enumerate(runs):
        new = np.arange(rows.size) if slowest is None else slowest.fresh[k]
        new = new[new <= min(found.fresh[k][-1] for found in held.values())]
        time = data.time[rows]
        even = time[new] if slowest is None else _own_clock(time[new], time, slowest)
        for name, (values, _) in signals.items():
            own = held[name].fresh[k] if name in held else np.arange(rows.size)
            at = _own_clock(time[own], time, held[name]) if name in held else time
            column, same = values[rows], name in held and held[name] is slowest or np.isin(even, at).all()
            parts[name].append(column[new] if same else by_spline(at, column[own], even))
        picked.append(rows[new])
        times.append(even)
    kept = replace(data.select(np.concatenate(picked)), time=np.concatenate(times),
                   notes=(*data.notes, _note(held, slowest, data, runs)))
    return _with_signals(kept, {name: np.concatenate(part) for name, part in parts.items()})


def without_frozen(data: Data) -> Data:
    """The rows without those in which a tracker that has lost its target repeats one position, its last or
    0, 0, 0, while the motors move on. What a tracker measures is never twice the same in all its digits."""
    if data.time is None or data.position is None or kind_of(data.kind).at_rest:
        return data
    motors = data.joints[_commanded(data)[0]]
    lost, stretches = np.zeros(len(data), bool), 0
    for rows in runs_in_time(data):
        same = np.all(np.diff(data.position[rows], axis=0) == 0.0, axis=1)
        turned = np.nansum(np.abs(np.diff(motors[rows], axis=0)), axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]])))
        for first, end in zip(edges[::2], edges[1::2]):
            if end - first >= _LEAST_FROZEN and turned[first:end].sum() > np.median(turned):
                lost[rows[first : end + 1]] = True
                stretches += 1
    free = np.mean(np.all(np.diff(data.position[~lost], axis=0) == 0.0, axis=1)) if np.sum(~lost) > 1 else 1.0
    if not stretches or free > _REPEATED:
        return data
    note = (f"x, y, z stay the same while the motors move, in {lost.sum():,} of {len(data):,} rows: left "
            "out, as of a tracker that has lost its target")
    return replace(data.select(~lost), notes=(*data.notes, note))


def _commanded(data: Rows) -> tuple[str, ...]:
    """The quantities that say where the motors are."""
    return ("theta", "theta_dot") if "theta" in data.joints else ("q", "q_dot")


def _signals(data: Rows) -> dict[str, tuple[np.ndarray, str]]:
    """What is sampled, by its name in `data`: (N, k), and words for it."""
    found = {name: (values, f"{name}_i") for name, values in data.joints.items() if name != "approach"}
    if data.position is not None:
        found["position"] = data.position, "x, y, z"
    if data.gyro is not None:
        found["gyro"] = data.gyro, "gyro_x, gyro_y, gyro_z"
    return found


def _with_signals(data: Data, signals: dict[str, np.ndarray]) -> Data:
    whole = {name: values for name, values in signals.items() if name not in data.joints}
    joints = {name: signals.get(name, values) for name, values in data.joints.items()}
    return replace(data, joints=joints, **whole)


def _held(values: np.ndarray, words: str, runs: list[np.ndarray]) -> _Held | None:
    lengths, steps, fresh = [], [], []
    for rows in runs:
        column = values[rows]
        change = np.diff(column, axis=0)
        new = np.append(True, np.any(np.nan_to_num(change) != 0.0, axis=1))
        places = np.flatnonzero(new)
        stretches = np.diff(places)
        fresh.append(np.append(places, rows.size))
        lengths.append(stretches[1:])  # the first may have begun before the run
        steps.append(np.abs(change[places[2:] - 1][stretches[1:] > 1]))
    length, step = np.concatenate(lengths), np.concatenate(steps)
    if not length.size:
        return None
    longest = _STANDS * max(np.median(length), 1.0)
    moving = length[length <= longest]
    mean = float(moving.mean())
    alike = np.abs(moving - mean) < 1.0
    if mean < _LEAST_HELD or len(step) < _LEAST_STRETCHES or alike.mean() < _SAME_LENGTH:
        return None
    smallest = np.nanmin(np.where(step > 0.0, step, np.inf), axis=0)
    in_steps = np.max(np.nan_to_num(step / smallest), axis=1)
    if np.median(in_steps) < _ROUNDING_STEPS:
        return None
    return _Held(words, mean, [_with_standstill(ends, longest, mean) for ends in fresh])


def _with_standstill(ends: np.ndarray, longest: float, length: float) -> np.ndarray:
    """Places where stretches begin, of the ends between them; one that is longer than `longest` rows is read
    anew every `length` of them."""
    each = [np.arange(a, b, round(length)) if b - a > longest else [a] for a, b in zip(ends[:-1], ends[1:])]
    return np.concatenate(each).astype(int)


def _own_clock(stamps: np.ndarray, log: np.ndarray, held: _Held) -> np.ndarray:
    """Times (R,) of readings that came evenly, of which the log, with stamps (N,), knows the row in which it
    saw each first: less than one of its steps late. Where they did not come evenly, their stamps without
    jitter."""
    if stamps.size < LEAST_SAMPLES:
        return stamps
    step = typical_step(log)
    count = np.cumsum(np.append(0.0, np.round(np.diff(stamps) / (held.length * step))))
    even = np.polynomial.Polynomial.fit(count, stamps, 1)(count)
    late = np.max(np.abs(stamps - even))
    if late < _EVEN * step:
        return stamps
    return even if late < step else even_clock(stamps)


def _note(held: dict[str, _Held], slowest: _Held | None, data: Rows, runs: list[np.ndarray]) -> str:
    rate = 1.0 / float(np.median([typical_step(data.time[rows]) for rows in runs]))
    told = " and ".join(f"{found.words} ({_hertz(rate / found.length)})" for found in held.values())
    said = f"a log of {_hertz(rate)} repeats the last reading of {told} until the next"
    if slowest is None:
        return f"{said}: between them they are interpolated"
    rows = sum(places.size for places in slowest.fresh)
    return f"{said}: {rows:,} of {len(data):,} rows are used, those in which {slowest.words} is new"


def _hertz(rate: float) -> str:
    return f"{rate:,.0f} Hz" if rate >= 100.0 else f"{rate:.3g} Hz"
