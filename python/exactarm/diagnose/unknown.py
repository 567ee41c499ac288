"""Unknown functions: "something else" as candidates, smooth functions of one or two signals that move one
axis or the device.

The measurement moves by d g(s), d (N, m) the response to a unit movement along a direction (a turn of axis j,
the device's axes), s a signal. g is a Gaussian process with a Matern kernel (smoothness 5/2), in the basis of
Solin and Sarkka (2020) on [-L, L], s scaled to [-1, 1]:

    g(s) = sum_i b_i sin(w_i (s + L)) / sqrt(L),   w_i = pi i / (2 L),
                                                   b_i ~ N(0, amplitude^2 S(w_i) / sum_j S(w_j))
    S(w) proportional to (5 / l^2 + w^2)^-3,   lengths l of 0.2, 0.5 and 1.2 of the signal's range.

An axis may turn by a wave of any order over its own angle, where the library has no such effect: too fast for
the functions above, each order a function of its own,

    g(q) = a sin(o q) + b cos(o q),   a, b ~ N(0, amplitude^2)

and so by a wave whose size changes with another signal s: beside one of the model, or in its place where s
is a speed

    g(q, s) = s (a sin(o q) + b cos(o q))

Functions of two signals: products of few of them, and of axes that turn by half a turn or more, products of
waves once and twice a turn, with sizes that fall as orders to the power of -0.75: what an arm does goes with
them, and the smooth functions of a turn are too slow for it. Of an axis's angle and its approach, or the
direction in which it moves: one function, with the other sign from the other side. A signal of few values has
a level at each of them, all alike likely:

    g(s) = b_s - mean of b,   b_s ~ N(0, amplitude^2)

What stands behind an axis may tilt across it, both ways, by the load of an axis. A device that follows the
time is no function here: it wanders, slowly or fast, and what its rows share is one law of noise
(noise/wandering.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from exactarm.diagnose.signal import TRACKER, Direction, Quantity, Signal, Structure

# What is measured of a unit movement (N, m), or (N, m, f) of movements (N, f) where their rate counts
Pattern = np.ndarray | Callable[[np.ndarray], np.ndarray]
LENGTHS = (0.4, 1.0, 2.4)  # 0.2, 0.5 and 1.2 of the range [-1, 1]
_TERMS, _TERMS_OF_TWO = 15, 4
_HALF_WIDTH = 1.3  # L: at the ends of the range the basis is still free
AMPLITUDE = 3e-4  # rad of an axis, m of the device: what gears, springs and devices leave
_LEAST_VALUES = 5  # different values of a signal; fewer are levels, not a curve
_BY_SIDE, _TILTED, _WAVE = "by side", "tilted", "wave"
_OF_THE_ARM = (Quantity.ANGLE, Quantity.TRAVEL, Quantity.LOAD, Quantity.APPROACH)  # no device follows them
_FALLING = np.array([1.0, 1.0, 2.0**-0.75, 2.0**-0.75]) / np.sqrt(1.0 + 2.0**-1.5)  # of `_of_a_turn`
_DECIMALS = 9  # of a signal in SI: no device measures a nanoradian; a load of 1e-17 Nm is rounding


@dataclass(frozen=True)
class Wave:
    """Of an order, over the angle of an axis (from 1). by: the side, which changes its sign, or a signal that
    changes its size; among: orders of which the data have chosen this one."""

    axis: int
    order: float
    by: Signal | None = None
    among: int = 1


@dataclass(frozen=True)
class Unknown:
    """Which direction follows which signals; `form`: smooth, wave, of two, by side, tilted, or of
    place."""

    direction: Direction
    signals: tuple[Signal, ...]
    form: str = "smooth"
    order: float | None = None  # of a wave, in waves a turn
    among: int = 1  # orders, of which it was chosen

    @property
    def label(self) -> str:
        return f"{self.direction} by {' and '.join(map(str, self.signals))}"

    @property
    def wave(self) -> Wave | None:
        """None of what is none."""
        if self.order is None or self.direction.axis is None:
            return None
        return Wave(self.direction.axis, self.order, *self.signals[1:], among=self.among)

    @property
    def described(self) -> bool:
        """A turn of an axis by its own angle, load or side, or a tilt by load: what the library's gear
        curves, springs and bearings describe already."""
        first = self.signals[0]
        own = self.direction.turns and first.axis == self.direction.axis and not first.part
        return self.form == _TILTED or own and self.form in ("smooth", _BY_SIDE)

    @property
    def curve_of_axis(self) -> int | None:
        """The axis that it turns as a function of that axis's own angle; None for all others."""
        alone = self.described and self.form == "smooth"
        return self.direction.axis if alone and self.signals[0].quantity == Quantity.ANGLE else None

    @property
    def structure(self) -> Structure:
        """As a technician says it."""
        follows = " and ".join(f"the {signal}" for signal in self.signals)
        waves = "" if self.order is None else f" in {self.order:.4g} waves a turn"
        return Structure(f"{self.direction} follows {follows}{waves}", self.signals)


# What, response (N, m, k), and the sizes (k,) of its coefficients for each length.
Function: TypeAlias = tuple[Unknown, np.ndarray, list[np.ndarray]]


def basis_of(values: np.ndarray, terms: int = _TERMS) -> np.ndarray:
    """(N, terms) basis functions of a signal (N,)."""
    s = _scaled(values)
    w = np.pi * np.arange(1, terms + 1) / (2.0 * _HALF_WIDTH)
    return np.sin(w * (s[:, None] + _HALF_WIDTH)) / np.sqrt(_HALF_WIDTH)


def levels_of(values: np.ndarray) -> np.ndarray:
    """(N, levels) of a signal of few values: at which one a row stands, less their mean."""
    levels = np.unique(values.round(_DECIMALS))
    return (values.round(_DECIMALS)[:, None] == levels) - 1.0 / len(levels)


def sizes_of(length: float, terms: int = _TERMS) -> np.ndarray:
    """(terms,) standard deviations of the coefficients, for a process of unit variance (on the average over
    the range)."""
    w = np.pi * np.arange(1, terms + 1) / (2.0 * _HALF_WIDTH)
    density = (5.0 / length**2 + w**2) ** -3
    return np.sqrt(density / density.sum() * _HALF_WIDTH * 2.0)


def _scaled(values: np.ndarray) -> np.ndarray:
    low, high = float(np.min(values)), float(np.max(values))
    return (2.0 * values - low - high) / max(high - low, 1e-300)


def unknown_functions(signals: dict, directions: dict, tilts: dict,
                      waves: Iterable[Wave]) -> Iterator[Function]:
    """Every unknown function worth trying, one after another: a response is large."""
    counts = {name: len(np.unique(values.round(_DECIMALS))) for name, values in signals.items()}
    curves = {name: values for name, values in signals.items() if counts[name] >= _LEAST_VALUES}
    levels = {name: levels_of(values) for name, values in signals.items()
              # how an axis passes from one direction of its motion to the other, nobody knows
              if 1 < counts[name] < _LEAST_VALUES and name.quantity != Quantity.DIRECTION}
    turns = {along: pattern for along, pattern in directions.items() if not along.of_tracker}
    device = [pattern for along, pattern in directions.items() if along.of_tracker]
    bases = {name: basis_of(values) for name, values in curves.items()} | levels
    smooth = [AMPLITUDE * sizes_of(length) for length in LENGTHS]
    few = AMPLITUDE * sizes_of(LENGTHS[1], _TERMS_OF_TWO)
    lengths = {name: [np.full(basis.shape[1], AMPLITUDE)] if name in levels else smooth
               for name, basis in bases.items()}
    for name, pattern in turns.items():
        for signal, basis in bases.items():
            yield Unknown(name, (signal,)), _moved([pattern], basis), lengths[signal]
        sides = (Signal(quantity, name.axis) for quantity in (Quantity.APPROACH, Quantity.DIRECTION))
        side = next((side for side in sides if side in signals), None)
        place = [signal for signal in curves if signal.places_axis and signal.axis == name.axis]
        if side and place and counts[side] < _LEAST_VALUES:
            basis = bases[place[0]] * signals[side][:, None]
            yield Unknown(name, (place[0], side), _BY_SIDE), _moved([pattern], basis), smooth
    whole = {signal: basis for signal, basis in bases.items()
             if signal.quantity not in _OF_THE_ARM and not signal.of_time}
    for signal, basis in whole.items() if device else ():
        sizes = [np.tile(size, len(device)) for size in lengths[signal]]
        yield Unknown(TRACKER, (signal,)), _moved(device, basis), sizes
    place = [few_of(curves[name]) for name in curves if name.quantity == Quantity.POSITION]
    if device and len(place) == 3:
        yield _of_place(place, device)
    for along, patterns in tilts.items():
        for signal, values in curves.items():
            if signal.quantity == Quantity.LOAD:
                yield Unknown(along, (signal,), _TILTED), _moved(patterns, few_of(values)), [np.tile(few, 2)]
    yield from _of_two(curves, turns, device)
    yield from functions_of_waves(signals, directions, waves)


def functions_of_waves(signals: dict, directions: dict, waves: Iterable[Wave]) -> Iterator[Function]:
    """Those among `unknown_functions` that are waves."""
    turns = {along: pattern for along, pattern in directions.items() if along.turns}
    for one in waves:
        order, by = one.order, one.by
        along = next((name for name in turns if name.axis == one.axis), None)
        place = next((signal for signal in signals if signal.places_axis and signal.axis == one.axis), None)
        if along is None or place is None or by is not None and by not in signals:
            continue
        unknown = Unknown(along, (place,) if by is None else (place, by), _WAVE, order, one.among)
        turned = order * signals[place]
        wave = np.stack([np.sin(turned), np.cos(turned)], axis=1)
        if by is not None:
            wave *= _factor(by, signals[by])[:, None]
        yield unknown, _moved([turns[along]], wave), [np.full(2, AMPLITUDE)]


def _factor(by: Signal, values: np.ndarray) -> np.ndarray:
    """(N,) of a wave that changes with a signal: its sign by the side, its size with a speed, either way, or
    with another signal from the middle of its range on: beside a wave of the same order."""
    if by.quantity == Quantity.APPROACH:
        return values
    if by.quantity == Quantity.SPEED:
        return np.abs(values) / max(float(np.max(np.abs(values))), 1e-300)
    return _scaled(values)


def _moved(patterns: Sequence[Pattern], basis: np.ndarray) -> np.ndarray:
    """(N, m, k) of every pattern times the functions (N, f), one pattern after the other."""
    if callable(patterns[0]):
        return np.concatenate([pattern(basis) for pattern in patterns], axis=2)
    product = np.stack(patterns, axis=2)[:, :, :, None] * basis[:, None, None, :]
    return product.reshape(*product.shape[:2], -1)


def few_of(values: np.ndarray) -> np.ndarray:
    """(N, 4) the first basis functions of a signal, for products."""
    return basis_of(values, _TERMS_OF_TWO)


def _of_place(place: list[np.ndarray], device: list[np.ndarray]) -> Function:
    """The device's axes as functions of where the target is: products of three."""
    product = np.einsum("ni,nj,nk->nijk", *place).reshape(len(place[0]), -1)
    size = sizes_of(LENGTHS[1], _TERMS_OF_TWO)
    sizes = AMPLITUDE * np.einsum("i,j,k->ijk", size, size, size).ravel()
    return (Unknown(TRACKER, (Signal(Quantity.PLACE),), "of place"), _moved(device, product),
            [np.tile(sizes, len(device))])


def _of_two(curves: dict, turns: dict, device: list) -> Iterator[Function]:
    """Products of functions of the angles of two axes, which move one axis, or the device's axes; of waves,
    one axis: no device turns with the arm."""
    size = sizes_of(LENGTHS[1], _TERMS_OF_TWO)
    moved = {direction: [pattern]
             for direction, pattern in turns.items()} | ({TRACKER: device} if device else {})
    yield from _products({name: (few_of(values), size) for name, values in curves.items()
                          if name.places_axis}, moved)
    yield from _products({name: (_of_a_turn(values), _FALLING) for name, values in curves.items()
                          if name.quantity == Quantity.ANGLE and np.ptp(values) >= np.pi},
                         {direction: [pattern] for direction, pattern in turns.items()})


def _products(factors: dict, moved: dict) -> Iterator[Function]:
    """Of functions (N, k) of two signals, with the sizes (k,) of their coefficients."""
    names = list(factors)
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            (own, size), (beside, its) = factors[one], factors[other]
            product = (own[:, :, None] * beside[:, None, :]).reshape(len(own), -1)
            for direction, patterns in moved.items():
                yield (Unknown(direction, (one, other), "of two"), _moved(patterns, product),
                       [np.tile(AMPLITUDE * np.outer(size, its).ravel(), len(patterns))])


def _of_a_turn(values: np.ndarray) -> np.ndarray:
    """(N, 4) waves once and twice a turn of an axis: what an arm does goes with them."""
    return np.stack([turned(k * values) for k in (1, 2) for turned in (np.cos, np.sin)], axis=1)
