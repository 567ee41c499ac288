"""Curves of all gears together, each under the law of its amplitudes that the data ask for.

A real arm has errors of many orders on every axis. Found one by one, each is judged beside the noise of all
others, and a few single orders stand for a curve. Here, in the linear picture of a fit without any of them,
every axis has one of

    what was found on it,    or a curve under one of its laws (amplitude at an order, fall, number of orders),
                             with or without the single orders that were found beside it

and the choice is the one of greatest evidence (type II maximum likelihood; MacKay 1992), axis by axis until
it stands still. B: columns times the standard deviations of their priors, S: square sum of the residual,
n: independent numbers:

    log p = -n/2 log(1 - r'B (I + B'B)^-1 B'r / S) - 1/2 log det(I + B'B)

A parameter without prior has that of unit information, standard deviation sqrt(n) / |column| (Kass and
Wasserman 1995). A curve pays log(number of laws), and all together must lower the cross-validated error.

The columns stand in the noise of a fit without the curves, which is larger than what they leave: priors that
are lengths (rad) are divided by the ratio s of both, estimated anew after every pass with N numbers of data
and g = tr(B'B (I + B'B)^-1) of them spent (MacKay 1992, eq. 4.8):

    s² = |r - B v|² / (N - g),  v the posterior mean
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from exactarm.diagnose.cross_validation import CrossValidation, folds_of
from exactarm.diagnose.decisions import LEAST_EVIDENCE
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.forms import same_family
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.scan import free_mask, linear_columns, prior_of
from exactarm.effects.base import Effect
from exactarm.numerics.factors import cholesky

_PASSES = 10  # over all axes and the noise that they leave; four or five are enough


@dataclass(frozen=True)
class _Choice:
    """What an axis may have: effects, and for all columns of the axis (k,) the standard deviations of their
    priors, 0 = not there; in_noise (k,) bool: those of unit information, which grow with the noise."""

    effects: tuple[Effect, ...]
    sizes: np.ndarray
    in_noise: np.ndarray

    def beside(self, noise: float) -> np.ndarray:
        """(k,) the sizes where the noise is so many times that of the columns."""
        return np.where(self.in_noise, self.sizes, self.sizes / noise)


def with_curves(problem: Problem, fitted: Fitted, first: int, templates: list[Effect],
                count: float) -> list[Effect] | None:
    """The effects of the layout from the place `first` on, with a curve in place of what it takes in or
    beside it, on every axis that asks for one; None where none does.

    templates: a curve of each axis that has one, of zero size; count: independent numbers of the residual.
    """
    found = fitted.layout.effects[first:]
    places = [place for place, effect in enumerate(found)
              if any(same_family(effect, template) for template in templates)]
    if not places:  # rows that share what an encoder rounds away would look like curves of many axes
        return None
    without = fitted
    for place in reversed(places):
        without = without.without(first + place)
    axes = [_choices(without, template, [found[place] for place in places
                                         if same_family(found[place], template)], count)
            for template in templates]
    picture = _Linear(without, [columns for columns, _ in axes], count)
    chosen, noise = picture.chosen([choices for _, choices in axes])
    if not any(chosen):
        return None
    now = np.concatenate([choices[0].sizes for _, choices in axes])
    then = np.concatenate([choices[k].beside(noise) for (_, choices), k in zip(axes, chosen)])
    parted = CrossValidation.of(without, folds_of(problem.groups(), problem.seed))
    fall = picture.held_out(now, parted) - picture.held_out(then, parted)
    if fall.mean() <= fall.std(ddof=1) / np.sqrt(len(fall)):  # one standard error, as for forms (forms.py)
        return None
    kept = [effect for place, effect in enumerate(found) if place not in places]
    return kept + [effect for (_, choices), k in zip(axes, chosen) for effect in choices[k].effects]


def _choices(without: Fitted, template: Effect, found: list[Effect],
             count: float) -> tuple[np.ndarray, list[_Choice]]:
    """The columns (R, k) of an axis, those of what was found before those of a curve, and its choices: first
    what was found."""
    laws = list(template.laws())
    longest = max(laws, key=lambda law: len(law.values))
    own = [linear_columns(without, effect.with_values(np.where(free_mask(effect), 0.0, effect.values)))
           for effect in found]
    columns = np.concatenate([*own, linear_columns(without, longest)], axis=1)
    width = columns.shape[1] - sum(part.shape[1] for part in own)
    sizes, known = [], []
    for effect, part in zip(found, own):
        prior, beside = prior_of(effect), without.cleared(part)
        length = np.linalg.norm(beside, axis=0)
        unit = np.sqrt(count) / np.maximum(length, 1e-300)
        sizes.append(np.where(np.isfinite(prior), prior, np.where(length > 0.0, unit, 0.0)))
        known.append(np.isfinite(prior))
    in_noise = ~np.concatenate([*known, np.ones(width, bool)])

    def choice(kept: list[bool], law: Effect | None) -> _Choice:
        curve = np.zeros(width)
        if law is not None:
            prior = prior_of(law)
            curve[: len(prior)] = prior
        effects = tuple(effect for effect, keep in zip(found, kept) if keep)
        return _Choice(effects + (() if law is None else (law,)),
                       np.concatenate([*(size * keep for size, keep in zip(sizes, kept)), curve]), in_noise)

    choices = [choice([True] * len(found), None)]
    for law in laws:
        highest = max(order for order, _ in law.orders())
        beyond = [not e.any_curve and max(order for order, _ in e.orders()) > highest for e in found]
        beside = [not (e.any_curve or law.includes(e)) for e in found]
        choices.append(choice(beyond, law))
        if beside != beyond:
            choices.append(choice(beside, law))
    return columns, choices


class _Linear:
    """The columns of all axes beside what is free, and the evidence of any sizes of their priors."""

    def __init__(self, without: Fitted, columns: list[np.ndarray], count: float):
        self.without, self.count = without, count
        ends = np.cumsum([0, *(part.shape[1] for part in columns)])
        self.where = [slice(a, b) for a, b in zip(ends, ends[1:])]
        self.columns = np.concatenate(columns, axis=1)
        absorbed, residual = without.basis.T @ self.columns, without.free_residual
        self.gram = self.columns.T @ self.columns - absorbed.T @ absorbed
        self.onto = self.columns.T @ residual
        self.square = float(residual @ residual)

    def chosen(self, axes: list[list[_Choice]]) -> tuple[list[int], float]:
        """For every axis the place of its choice, 0 where no curve is likelier by enough; and the noise that
        is left beside that of the columns."""
        now, noise = [0] * len(axes), 1.0
        price = [np.log(len(choices) - 1) + LEAST_EVIDENCE for choices in axes]
        for _ in range(_PASSES):
            before, last = list(now), noise
            for axis, choices in enumerate(axes):
                others = [np.zeros(len(c[k].sizes)) if a == axis else c[k].beside(noise)
                          for a, (c, k) in enumerate(zip(axes, now))]
                sizes = [np.zeros(len(choices[0].sizes)), *(choice.beside(noise) for choice in choices)]
                nothing, found, *curves = self._beside(np.concatenate(others), self.where[axis], sizes)
                best = int(np.argmax(curves))
                # A run-out that is not there costs more than a curve of no size: nothing is a rival, too.
                now[axis] = best + 1 if curves[best] - price[axis] > max(nothing, found) else 0
            noise = self._left(np.concatenate([c[k].beside(noise) for c, k in zip(axes, now)]))
            if now == before and abs(noise / last - 1.0) < 0.01:
                break
        return now, noise

    def _left(self, sizes: np.ndarray) -> float:
        """The noise beside that of the columns, behind a fit with these sizes (p,)."""
        on = np.flatnonzero(sizes)
        size = sizes[on]
        system = size[:, None] * self.gram[np.ix_(on, on)] * size
        factor = linalg.cho_factor(np.eye(len(on)) + system, lower=True)
        values = linalg.cho_solve(factor, size * self.onto[on])
        square = self.square - 2.0 * float(values @ (size * self.onto[on])) + float(values @ system @ values)
        spent = float(np.trace(linalg.cho_solve(factor, system)))
        data = np.count_nonzero(self.without.whitened[: self.without.data_numbers]) - self.without.spent
        return float(np.sqrt(square / max(data - spent, 1.0)))

    def _beside(self, others: np.ndarray, where: slice, sizes: list[np.ndarray]) -> list[float]:
        """Log evidence of every choice of sizes (k,) of one axis beside those of the others (p,), which it
        does not count."""
        on = np.flatnonzero(others)
        size = others[on]
        lower = cholesky(np.eye(len(on)) + size[:, None] * self.gram[np.ix_(on, on)] * size)
        cross = linalg.solve_triangular(lower, size[:, None] * self.gram[on, where], lower=True)
        taken = linalg.solve_triangular(lower, size * self.onto[on], lower=True)
        gram, onto = self.gram[where, where] - cross.T @ cross, self.onto[where] - cross.T @ taken
        square = self.square - float(taken @ taken)
        return [self._evidence(gram, onto, square, size) for size in sizes]

    def _evidence(self, gram: np.ndarray, onto: np.ndarray, square: float, sizes: np.ndarray) -> float:
        on = np.flatnonzero(sizes)
        size = sizes[on]
        lower = cholesky(np.eye(len(on)) + size[:, None] * gram[np.ix_(on, on)] * size)
        taken = linalg.solve_triangular(lower, size * onto[on], lower=True)
        left = max(square - float(taken @ taken), 1e-12 * square)
        return float(-np.log(np.diag(lower)).sum() - 0.5 * self.count * np.log(left / self.square))

    def held_out(self, sizes: np.ndarray, parted: CrossValidation) -> np.ndarray:
        """(folds,) square sums by cross-validation with sizes (p,)."""
        on = np.flatnonzero(sizes)
        return parted.squares(self.columns[:, on], sizes[on])
