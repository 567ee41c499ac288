"""Vocabulary of a diagnosis: every cause that could be missing, as a block of columns with a prior on its
size.

A block is an effect of the library at one point of the grid of its non-linear parameters, or an unknown
function of one or two signals that moves one axis or the device. Its coefficients b (k,) have the prior

    b ~ N(0, s^2 diag(size)^2),   s in SCALES with the weights of a log-normal law of standard deviation ln 3,

size the plausible magnitude of each parameter. Prior probability of a block as the next cause:

    named     0.8 / (names x axes of the name x points of its grid)
    unknown   0.2 / (number of unknown functions x lengths), a tenth of it where the library has named forms
              of the same function
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from exactarm.diagnose.scan import free_mask, grid
from exactarm.diagnose.unknown import Function, Unknown
from exactarm.effects.base import Effect
from exactarm.effects.change import sizes_beside_first

# prior probability that a cause is none of the library's: one cause in five was, over the first sets of
# others
UNKNOWN_MASS = 0.2
DESCRIBED = 0.1  # odds of a function that the library has named forms for, beside one that it has none for
# RMS at the target of one thing that gives way, at its plausible size: about what the declared spring of axis
# 2 of the reference robot does under its own weight (0.9 mrad, tests/python/test_undecided.py). Stiffness
# grows with the load that an arm is built for, so that a size per Nm falls with it.
_MOST_GIVEN_M, _TINY = 1e-3, 1e-300
SCALES = np.array([0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0])  # times plausible; the largest cost 5 and 9 nats
SCALE_WEIGHTS = np.exp(-0.5 * (np.log(SCALES) / np.log(3.0)) ** 2)
SCALE_WEIGHTS = SCALE_WEIGHTS / SCALE_WEIGHTS.sum()


@dataclass(frozen=True)
class Block:
    """Columns `where` of the vocabulary's matrix, the prior of their coefficients, and what they stand for.

    effect: with its linear parameters at zero (None: an unknown function); label: the cause, whatever the
    grid point; free (k,): which of the effect's parameters the columns belong to; positive (k,): coefficients
    that cannot fall below zero.
    """

    label: str
    effect: Effect | None
    unknown: Unknown | None
    where: slice
    size: np.ndarray
    positive: np.ndarray
    log_prior: float
    repeatable: bool

    @property
    def columns(self) -> int:
        return self.where.stop - self.where.start

    @property
    def free(self) -> np.ndarray:
        return free_mask(self.effect)

    def is_form_of(self, effect: Effect) -> bool:
        """Whether it stands for the same cause as an effect: one of them has every term of the other."""
        if self.effect is not None:
            return self.effect.includes(effect) or effect.includes(self.effect)
        return effect.any_curve and self.unknown.curve_of_axis == effect.joint


@dataclass(frozen=True)
class Vocabulary:
    """blocks, and parts (N, m, k) side by side: the responses of the measurement to a unit of every
    coefficient, not whitened. A block lies in one part."""

    blocks: tuple[Block, ...]
    parts: tuple[np.ndarray, ...]

    @cached_property
    def _starts(self) -> np.ndarray:
        return np.cumsum([0, *(part.shape[2] for part in self.parts)])

    @property
    def width(self) -> int:
        """p: columns of all parts."""
        return int(self._starts[-1])

    def response(self, where: slice) -> np.ndarray:
        """(N, m, k) of the columns of a block."""
        part = int(np.searchsorted(self._starts, where.start, side="right")) - 1
        start = self._starts[part]
        return self.parts[part][:, :, where.start - start : where.stop - start]

    def strips(self, least: int) -> Iterator[tuple[slice, np.ndarray]]:
        """Columns and responses (N, m, k) of neighbouring parts together, k at least this."""
        first = 0
        for last, stop in enumerate(self._starts[1:], start=1):
            if stop - self._starts[first] >= least or last == len(self.parts):
                yield slice(self._starts[first], stop), np.concatenate(self.parts[first:last], axis=2)
                first = last

    @cached_property
    def labels(self) -> tuple[tuple[str, ...], np.ndarray]:
        """The different labels, and for each block (G,) which one it has."""
        names, which = np.unique([block.label for block in self.blocks], return_inverse=True)
        return tuple(str(name) for name in names), which

    @cached_property
    def repeatable(self) -> frozenset[str]:
        return frozenset(block.label for block in self.blocks if block.repeatable)

    @cached_property
    def unknown(self) -> frozenset[str]:
        """Labels of the unknown functions."""
        return frozenset(block.label for block in self.blocks if block.unknown is not None)

    @cached_property
    def _forms(self) -> dict[int, frozenset[int]]:
        return {}

    def forms_of(self, index: int) -> frozenset[int]:
        """The blocks (itself too) that stand for the same cause as one block: no set holds two of them."""
        if index not in self._forms:
            own, same = self.blocks[index], {index}
            if own.effect is not None:
                same |= {i for i, block in enumerate(self.blocks) if block.is_form_of(own.effect)}
            elif own.unknown.curve_of_axis is not None:
                same |= {i for i, block in enumerate(self.blocks)
                         if block.effect is not None and own.is_form_of(block.effect)}
            self._forms[index] = frozenset(same)
        return self._forms[index]

    def richer_than(self, index: int) -> list[int]:
        """The named forms of the same cause that have every term of a block, and more of them."""
        own = self.blocks[index]
        return [i for i in self.forms_of(index)
                if self.blocks[i].effect is not None and self.blocks[i].columns > own.columns]

    @cached_property
    def _wholes(self) -> dict[int, tuple[int, ...]]:
        return {}

    def wholes_of(self, index: int) -> tuple[int, ...]:
        """The named causes that do what several like a block do together."""
        own = self.blocks[index].effect
        if index not in self._wholes:
            self._wholes[index] = tuple(i for i, block in enumerate(self.blocks)
                                        if own is not None and block.effect is not None
                                        and block.effect.sums(own))
        return self._wholes[index]

    def not_in(self, form: int, indices: Sequence[int]) -> list[int]:
        """Places in `indices` of the blocks that may act beside a form: neither forms nor parts of it."""
        same, effect = self.forms_of(form), self.blocks[form].effect
        part = lambda i: self.blocks[i].effect is not None and effect.sums(self.blocks[i].effect)
        return [k for k, i in enumerate(indices) if i not in same and not part(i)]

    def without(self, refused: tuple[Block, ...]) -> Vocabulary:
        """Without causes at these grid points, whatever their prior."""
        gone = {(block.label, block.effect.values) for block in refused}
        kept = (b for b in self.blocks if b.effect is None or (b.label, b.effect.values) not in gone)
        return replace(self, blocks=tuple(kept))

    def joined(self, other: Vocabulary) -> Vocabulary:
        """With the causes of another one, together as probable as one name of this."""
        names = {block.effect.name for block in self.blocks if block.effect is not None}
        start, lower = self.width, np.log(max(len(names), 1))
        moved = [replace(block, where=slice(block.where.start + start, block.where.stop + start),
                         log_prior=block.log_prior - lower)
                 for block in other.blocks]
        return Vocabulary((*self.blocks, *moved), self.parts + other.parts)

    def beside(self, effects: list[Effect]) -> Vocabulary:
        """Without the causes that these effects stand for already."""
        taken = {effect.label for effect in effects if not effect.repeatable}
        kept = [block for block in self.blocks if block.label not in taken
                and not any(block.is_form_of(effect) for effect in effects)]
        place, blocks, parts, at = {}, [], [], 0
        for block in kept:
            if block.where.start not in place:
                place[block.where.start] = slice(at, at + block.columns)
                parts.append(self.response(block.where))
                at += block.columns
            blocks.append(replace(block, where=place[block.where.start]))
        return Vocabulary(tuple(blocks), tuple(parts))


def vocabulary_of(fitted, effects: list[Effect],
                  functions: list[Function]) -> Vocabulary:
    """All candidate `effects` at every point of their grids, and unknown functions."""
    points = [(effect, point) for effect in effects for point in grid(effect)
              if point.keep(fitted.view) is None]
    counts = Counter(point.label for _, point in points)
    axes = defaultdict(set)
    for _, point in points:
        axes[point.name].add(point.label)
    blocks, parts, at = [], [], 0
    responses = fitted.responses_of([point for _, point in points])
    for (_, point), response in zip(points, responses):
        mask = free_mask(point)
        response = response[:, :, mask]
        parameters = [p for p, free in zip(point.parameters(), mask) if free]
        visible = [np.any(response[:, :, k]) for k in range(response.shape[2])]
        if not any(visible):
            continue
        share = (1.0 - UNKNOWN_MASS) / (len(axes) * len(axes[point.name]) * counts[point.label])
        size = np.array([min(p.plausible, p.prior) for p in parameters])
        if point.gives_way and not any(np.isfinite(p.prior) for p in parameters):
            moved = np.maximum(_moved(response), _TINY)
            size = sizes_beside_first(parameters, np.minimum(size, _MOST_GIVEN_M / moved), moved)
        positive = np.array([p.lower == 0.0 for p in parameters])
        where = _same_columns(blocks, parts, point.label, response) or slice(at, at + response.shape[2])
        blocks.append(Block(point.label, point, None, where, size, positive, np.log(share) + point.log_odds,
                            point.repeatable))
        if where.start == at:
            parts.append(response)
            at = where.stop
    number = sum(len(sizes) for _, _, sizes in functions)
    for unknown, response, sizes in functions:
        where = slice(at, at + response.shape[2])
        for size in sizes:
            blocks.append(Block(unknown.label, None, unknown, where, size, np.zeros(len(size), bool),
                                np.log(UNKNOWN_MASS / number * (DESCRIBED if unknown.described else 1.0)),
                                False))
        parts.append(response)
        at = where.stop
    return Vocabulary(tuple(blocks), tuple(parts))


def _moved(response: np.ndarray) -> np.ndarray:
    """(k,) RMS of what the position is moved by a unit of each parameter, m, of a response (N, m, k)."""
    return np.sqrt(np.mean(np.sum(response[:, :3] ** 2, axis=1), axis=0))


def _same_columns(blocks: list[Block], parts: list, label: str, response: np.ndarray) -> slice | None:
    """Where the columns of the block before stand, if those of a further one are the same (a form that
    differs in its prior alone)."""
    same = blocks and blocks[-1].label == label and np.array_equal(parts[-1], response)
    return blocks[-1].where if same else None


def emptied(effect: Effect) -> Effect:
    """The effect with its linear parameters at zero, its non-linear ones where they are."""
    return effect.with_values(np.where(free_mask(effect), 0.0, effect.values))


def at_values(block: Block, scale: int, values: np.ndarray) -> Effect:
    """The effect of a named block with its coefficients at `values`, inside their bounds, drawn to zero as
    the `scale`-th of `SCALES` says; searched values are known now."""
    effect = block.effect.drawn_wider(float(SCALES[scale]))
    found = np.asarray(effect.values, float).copy()
    found[block.free] = values
    found = [float(np.clip(v, p.lower, p.upper)) for v, p in zip(found, effect.parameters())]
    return effect.with_values(found)
