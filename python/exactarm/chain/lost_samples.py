"""Samples that a logger lost, or that are not to be fitted: short gaps in a run are filled, long ones cut it.

A low-pass over samples one after another takes a gap for a jump. Where a gap is short beside the shortest
period that counts, a cubic spline through its neighbours stands for what is missing; a longer one makes two
runs of one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from exactarm.numerics.signals import by_spline
from exactarm.numerics.stamps import blocks, typical_step

# of the shortest period that counts, or that a low-pass leaves: gaps so long carry nothing of it
FILLED_PERIODS = 0.25


@dataclass(frozen=True)
class Filled:
    """A stretch without a gap: time (G,), the nearest row (G,) of the run, which of the samples are rows
    (G,), and its signals (G, ...)."""

    time: np.ndarray
    row: np.ndarray
    given: np.ndarray
    signals: tuple[np.ndarray, ...]


def without_gaps(time: np.ndarray, signals: Sequence[np.ndarray], longest_s: float) -> list[Filled]:
    """The stretches of one run (time (R,), signals (R, ...)), gaps of up to `longest_s` filled."""
    parts = blocks(time)
    if len(parts) == 1:
        return [Filled(time, parts[0], np.ones(time.size, bool), tuple(signals))]
    step, stretches = typical_step(time), [[parts[0]]]
    for part in parts[1:]:
        if time[part[0]] - time[stretches[-1][-1][-1]] > longest_s:
            stretches.append([])
        stretches[-1].append(part)
    return [_filled(time, signals, stretch, step) for stretch in stretches]


def _filled(time: np.ndarray, signals: Sequence[np.ndarray], parts: list[np.ndarray], step: float) -> Filled:
    rows = np.concatenate(parts)
    own = time[rows]
    if len(parts) == 1:
        return Filled(own, rows, np.ones(rows.size, bool), tuple(signal[rows] for signal in signals))
    whole = _times(time, parts, step)
    place = np.searchsorted(own, whole).clip(1, own.size - 1)
    place -= whole - own[place - 1] < own[place] - whole
    given = np.zeros(whole.size, bool)
    given[np.searchsorted(whole, own)] = True
    return Filled(whole, rows[place], given, tuple(by_spline(own, signal[rows], whole) for signal in signals))


def _times(time: np.ndarray, parts: list[np.ndarray], step: float) -> np.ndarray:
    """Those of the parts, and of the samples that are missing between them."""
    own = [time[part] for part in parts]
    gaps = [(before[-1], after[0]) for before, after in zip(own[:-1], own[1:])]
    missing = [np.linspace(a, b, max(2, round((b - a) / step) + 1))[1:-1] for a, b in gaps]
    return np.sort(np.concatenate([*own, *missing]))


def between_gaps(time: np.ndarray, *signals: np.ndarray) -> tuple[np.ndarray, ...]:
    """Time and signals (R, ...) of one run with straight lines over its gaps, however long: for what smooths
    neighbours and looks at the whole run."""
    parts = blocks(time)
    if len(parts) == 1:
        return time, *signals
    whole = _times(time, parts, typical_step(time))
    line = lambda values: np.interp(whole, time, values)
    return whole, *(np.apply_along_axis(line, 0, signal) for signal in signals)
