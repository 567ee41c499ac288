"""What an effect is asked for: its parameters, and what they change at a station."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np


class DoesNotFit(ValueError):
    """An effect that cannot be one of this arm; the message says why, and what was expected."""


# standard deviations of a value from where it may not be, or from zero where it divides another
CERTAIN = 2.0


@dataclass(frozen=True)
class Parameter:
    """One number of an effect: name with unit, bounds, plausible magnitude (SI); `fixed` ones are not
    estimated.

    `search`: values that a non-linear parameter is tried from (periods, thresholds); empty where the
    effect is linear in it and zero is a good start.
    `prior`: standard deviation of a Gaussian prior around zero that regularises one of many terms; inf =
    none.
    `of_first`: how much it moves the target at that magnitude, beside the effect's first parameter, where
    the magnitude itself would be another for arms of another size; 0 = that is not known.
    """

    name: str
    plausible: float
    lower: float = -np.inf
    upper: float = np.inf
    fixed: bool = False
    search: tuple[float, ...] = ()
    prior: float = np.inf
    of_first: float = 0.0


def sizes_beside_first(parameters: Sequence[Parameter], sizes: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """(k,) plausible sizes of an effect's parameters, `of_first` taken by what the data show; moved (k,): how
    much each moves the target at a size of one."""
    share = np.array([parameter.of_first for parameter in parameters])
    beside = share * sizes[0] * moved[0] / np.maximum(moved, np.finfo(float).tiny)
    return np.where(share > 0.0, beside, sizes)


@dataclass(frozen=True)
class Change:
    """What an effect adds to the signal at its station, on N rows.

    value          (N, c) for the columns `columns` of the signal (joint stations: axis indices from 0)
    by_parameters  (N, c, k) for the effect's k parameters, fixed ones included
    by_signal      name of an upstream signal -> (N, c, m): its derivative with respect to that signal's m
                   columns ("theta", "phi", "torque", "q", "displacement", "measured"; rates are "q_dot",
                       ...).
                   Absent: the change does not depend on it.
    rate           d/dt of all of the above, where the effect knows it and the chain asks (`View.is_fast`):
                   differences between samples do not follow fast waves
    carried        (joint from 1, (N, c, 6)): what more than by_signal["displacement"] a parameter does that
                   moves the whole arm from that joint on (`Effect.carries_from`)
    """

    columns: tuple[int, ...]
    value: np.ndarray
    by_parameters: np.ndarray
    by_signal: Mapping[str, np.ndarray] = field(default_factory=dict)
    carried: tuple[int, np.ndarray] | None = None
    rate: Change | None = None


@dataclass(frozen=True)
class OwnCurve:
    """What an effect does by its axis's position, where a picture of the error does not show it: value and
    standard deviation (N,), SI."""

    title: str
    unit: str
    value: np.ndarray
    deviation: np.ndarray
