"""Layout: which parameters of which effects are free, and where each stands in the parameter vector."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from exactarm.effects.base import Effect, Parameter
from exactarm.effects.parameter_id import ParameterId
from exactarm.robot.robot import Robot


@dataclass(frozen=True)
class Layout:
    """Effects in the chain's order with, for each, the mask (k,) of its free parameters.

    The parameter vector stacks the free values, effect by effect.
    """

    effects: tuple[Effect, ...]
    free: tuple[np.ndarray, ...]

    @staticmethod
    def of(effects: tuple[Effect, ...], estimate: bool = True) -> Layout:
        """All parameters free except those that call themselves fixed (none unless `estimate`)."""
        masks = [np.array([estimate and not p.fixed for p in effect.parameters()], bool)
                 for effect in effects]
        return Layout(tuple(effects), tuple(masks))

    def joined(self, other: Layout) -> Layout:
        return Layout(self.effects + other.effects, self.free + other.free)

    def only(self, places: Iterable[int]) -> Layout:
        """The effects at these places, with what is free of them."""
        kept = list(places)
        return Layout(tuple(self.effects[k] for k in kept), tuple(self.free[k] for k in kept))

    @property
    def held(self) -> Layout:
        """The same effects with nothing free."""
        return Layout(self.effects, tuple(np.zeros_like(mask) for mask in self.free))

    def baked(self, robot: Robot, declared: bool = False) -> Robot:
        """The robot with those effects in its tables that live there; declared: of its own model."""
        for effect in self.effects:
            if effect.declared or not declared:
                robot = effect.bake(robot)
        return robot

    def without(self, names: set[str]) -> Layout:
        """The same with the named parameters held at their present values."""
        masks = []
        for effect, mask in zip(self.effects, self.free):
            masks.append(mask & np.array([effect.parameter_label(p) not in names
                                          for p in effect.parameters()], bool))
        return Layout(self.effects, tuple(masks))

    @cached_property
    def size(self) -> int:
        return int(sum(mask.sum() for mask in self.free))

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Where each effect's free parameters stand in the vector."""
        ends = np.cumsum([0] + [int(mask.sum()) for mask in self.free])
        return tuple(slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:]))

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The free parameters, in the vector's order."""
        return tuple(p for e, mask in zip(self.effects, self.free) for p, keep in zip(e.parameters(), mask)
                     if keep)

    @cached_property
    def names(self) -> tuple[ParameterId, ...]:
        """Unique labels of the free parameters, with units, and what they are."""
        return tuple(e.parameter_id(p) for e, mask in zip(self.effects, self.free)
                     for p, keep in zip(e.parameters(), mask) if keep)

    @cached_property
    def prior(self) -> np.ndarray:
        """(P,) standard deviation of each free parameter's Gaussian prior around zero; inf = none."""
        return np.array([p.prior for p in self.parameters])

    def carries_from(self, joint: int) -> np.ndarray:
        """(P,) bool: see `Effect.carries_from`."""
        parts = [effect.carries_from(joint)[mask] for effect, mask in zip(self.effects, self.free)]
        return np.concatenate(parts) if parts else np.zeros(0, bool)

    @property
    def values(self) -> np.ndarray:
        """The free values as one vector."""
        parts = [np.asarray(e.values, float)[mask] for e, mask in zip(self.effects, self.free)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def at(self, values: np.ndarray) -> Layout:
        """The same layout with the free parameters at `values`."""
        effects = []
        for effect, mask, where in zip(self.effects, self.free, self.slices):
            if mask.any():
                new = np.asarray(effect.values, float).copy()
                new[mask] = values[where]
                effect = effect.with_values(new)
            effects.append(effect)
        return Layout(tuple(effects), self.free)
