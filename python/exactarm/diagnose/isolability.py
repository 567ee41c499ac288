"""Isolability: which causes a planned set of poses could tell, and which it would confuse, before anything is
measured.

With whitened columns C_a of cause a (at its plausible sizes s_a, declared parameters projected out), the
response to cause a has the expected length

    seen(a)     = sqrt(sum_k s_ak^2 |c_ak|^2)                                       standard deviations of the
                noise
    apart(a, b) = min over b's grid of sqrt(sum_k s_ak^2 c_ak' V^-1 c_ak),   V = I + 9 C_b S_b^2 C_b'

that is, of what b cannot imitate at sizes of three times its plausible ones. The poses show cause a when
seen(a) stands out of the noise, and tell it from b when apart(a, b) does. Forms of one cause
on one axis are not held against each other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from exactarm.chain import predict_poses
from exactarm.data.dataset import Dataset
from exactarm.diagnose.decisions import WIDE
from exactarm.diagnose.evidence import Picture
from exactarm.diagnose.joint_fit import candidates_for
from exactarm.diagnose.pose_problem import PoseProblem
from exactarm.diagnose.vocabulary import Vocabulary, vocabulary_of
from exactarm.effects.base import Effect
from exactarm.identify.declared import carried_layout
from exactarm.identify.drawing import FREE
from exactarm.identify.pose_fit import PoseFit
from exactarm.noise.estimate import normal_noise
from exactarm.robot.robot import Robot


@dataclass(frozen=True)
class Isolability:
    """titles and joints (L,) of the causes; seen (L,) and apart (L, L) in standard deviations of a reading,
    apart[a, a] infinite."""

    effects: tuple[Effect, ...]
    seen: np.ndarray
    apart: np.ndarray

    @property
    def titles(self) -> tuple[str, ...]:
        return tuple(effect.title for effect in self.effects)

    @property
    def nearest(self) -> np.ndarray:
        """(L,) which other cause imitates each best."""
        return np.argmin(self.apart, axis=1)

    @property
    def least(self) -> np.ndarray:
        """(L,) distance from that."""
        return np.min(self.apart, axis=1)


class _Planned(PoseProblem):
    """Poses that nobody has measured: nothing says yet how far the arm is from its drawing."""

    @cached_property
    def calibrated(self) -> PoseFit:
        return replace(super().calibrated, drawn=FREE)


def isolability(robot: Robot, poses: Dataset, noise_m: float, seed: int, threads: int = 1) -> Isolability:
    """Of measuring `poses` (angles, and the direction of approach where it is planned) with a noise of
    noise_m a coordinate."""
    exact = predict_poses(robot, carried_layout(robot, poses), poses, tangents=False,
                          threads=threads).position
    position = exact + np.random.default_rng(seed).normal(0.0, noise_m, exact.shape)
    data = replace(poses, position=position, rotation=None, identification=None)
    problem = _Planned(robot, data, data.select(np.zeros(len(data), bool)), threads, seed)
    fitted = problem.fit(problem.declared())
    effects = [effect for effect in candidates_for(problem, fitted) if not effect.excludes_rows()]
    vocabulary = vocabulary_of(fitted, effects, [])
    noise = replace(normal_noise(fitted.residual), sigma=np.full(fitted.residual.shape[1], noise_m))
    return _of(Picture.of(vocabulary, fitted.residual, fitted.jacobian, noise))


def _of(picture: Picture) -> Isolability:
    vocabulary: Vocabulary = picture.vocabulary
    names, which = vocabulary.labels
    order = list(dict.fromkeys(which))  # as the library lists them
    first = [int(np.flatnonzero(which == label)[0]) for label in order]
    one_each = [vocabulary.blocks[i] for i in first]
    owner = np.repeat(np.arange(len(order)), [block.columns for block in one_each])
    signals = np.concatenate([np.arange(block.where.start, block.where.stop) for block in one_each])
    sizes = np.concatenate([block.size for block in one_each])
    products = picture.between(slice(None), signals) * sizes
    squares = products[signals, np.arange(len(signals))] * sizes
    seen = np.bincount(owner, squares, len(order))
    apart = np.tile(seen[:, None], len(order))
    for place, label in enumerate(order):
        for index in np.flatnonzero(which == label):
            block = vocabulary.blocks[index]
            size = WIDE * block.size
            gram = size[:, None] * picture.between(block.where, block.where) * size
            left = np.maximum(squares - _imitated(gram, size[:, None] * products[block.where]), 0.0)
            apart[:, place] = np.minimum(apart[:, place], np.bincount(owner, left, len(order)))
    effects = tuple(vocabulary.blocks[i].effect for i in first)
    cause = [(effect.family or effect.label, effect.joint) for effect in effects]
    apart[np.array([[one == other for other in cause] for one in cause])] = np.inf
    return Isolability(effects, np.sqrt(seen), np.sqrt(apart))


def _imitated(gram: np.ndarray, onto: np.ndarray) -> np.ndarray:
    """(p,) square length of signals that coefficients of unit variance of columns account for: products of
    the columns with each other (k, k) and with the signals (k, p)."""
    return np.einsum("kp,kp->p", onto, np.linalg.solve(np.eye(len(gram)) + gram, onto))
