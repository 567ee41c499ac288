"""Which parameters a set of measurements can identify, which it cannot, and which collide with which.

J (R, P): stacked identification Jacobian (thesis (3.9)), columns scaled to unit length. Two views of it:

    SVD   singular values of all columns; as many vanish as there are collisions
    QR    columns in an order of preference; a column whose part orthogonal to the kept ones vanishes is
          dropped, and its coefficients in the kept ones say with which parameters it collides

Order of preference: the frames of the sessions (every measurement needs them, E8), then geometry axis by
axis, joint offsets, gear ratios, effects; so of two colliding parameters the one nearer to the base stays.
With the noise known, a parameter whose standard deviation exceeds its plausible magnitude is dropped too: its
estimate would be noise (the weakest direction first, in it the parameter that comes last in the order). What
collided with that one alone is then told without it: of two axes 0.02 degrees off parallel, d of both and the
zero of the second collide, and the noise hides the second d.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from exactarm.effects.parameter_id import Group, ParameterId
from exactarm.identify.collision import Arm, hardly_differ, move_alike, no_effect
from exactarm.identify.observability import Observability, column_scale, observability
from exactarm.numerics.factors import lstsq, svd
from exactarm.robot.robot import Robot

RANK_TOLERANCE = 1e-6  # part of a unit column outside the kept ones: URDF files print pi to six digits
_NO_EFFECT = 1e-12  # length of a column (per plausible magnitude) beside the longest
_PARTICIPATES = 1e-3  # a coefficient beside the largest of its collision
_STILL = 1e-3
_WEAK_SHARE = 0.3  # the same in a direction that is weak but not empty


@dataclass(frozen=True)
class Dropped:
    """A parameter that is not estimated: why in one sentence, and with which others it collides."""

    name: ParameterId
    why: str
    collides_with: tuple[ParameterId, ...] = ()
    exact: bool = True  # False: told apart in principle, but not at this noise


@dataclass(frozen=True)
class Identifiability:
    """What can be identified.

    names            all P parameters
    kept             (P,) bool
    dropped          the others, with reasons
    singular_values  (P,) of all columns scaled to unit length, falling
    condition        of the kept columns scaled to unit length
    observability    O1..O5 of the kept columns (scaling: exactarm.identify.observability)
    sigma_parameter  (P,) standard deviations at the given noise, NaN where dropped; None without a noise
    """

    names: tuple[ParameterId, ...]
    kept: np.ndarray
    dropped: tuple[Dropped, ...]
    singular_values: np.ndarray
    condition: float
    observability: Observability
    sigma_parameter: np.ndarray | None = None

    @cached_property
    def identifiable(self) -> tuple[ParameterId, ...]:
        return tuple(name for name, keep in zip(self.names, self.kept) if keep)

    @cached_property
    def dropped_names(self) -> tuple[ParameterId, ...]:
        return tuple(entry.name for entry in self.dropped)


def select_identifiable(jacobian: np.ndarray, names: Sequence[ParameterId], *, keep_first: int = 0,
                        poses: int | None = None, weights: np.ndarray | None = None,
                        sigma: float | None = None, plausible: Sequence[float] | None = None,
                        robot: Robot | None = None, still: Sequence[int] = ()) -> Identifiability:
    """Identifiable parameters of `jacobian` (R, P).

    keep_first: the first so many columns come first in the order of preference, as they stand. poses: K of
    the observability indices (default R / 3). weights (R,): 1 / standard deviation of each row, up to a
    factor. sigma: standard deviation of a weighted row; together with `plausible` (P,) it drops what the
    noise hides. robot: its geometry gives the reasons, as do the axes (from 1) that stand `still` in all
    poses.
    """
    jacobian, names = np.asarray(jacobian, float), tuple(names)
    arm = None if robot is None else Arm(robot, tuple(still))
    weighted = jacobian if weights is None else np.asarray(weights, float)[:, None] * jacobian
    triangle = np.linalg.qr(weighted, mode="r") if len(weighted) else np.zeros((0, len(names)))
    size = np.ones(len(names)) if plausible is None else np.asarray(plausible, float)
    length = np.linalg.norm(triangle, axis=0)
    seen = length * size > _NO_EFFECT * np.max(length * size, initial=0.0)
    unit = triangle / np.where(seen, length, 1.0)
    order = [j for j in preference(names, keep_first) if seen[j]]
    kept, exact = _ordered_qr(unit, order)
    dropped = [Dropped(names[j], no_effect(names[j]), (), True) for j in np.flatnonzero(~seen)]
    deviations = None
    if sigma is not None:
        kept, hidden, deviations = _above_noise(unit, length, kept, sigma, plausible, len(names))
        while exact and hidden:  # what collides with a hidden one alone is told without it
            without = [j for j in order if j not in {k for k, *_ in hidden}]
            again, collide = _ordered_qr(unit, without)
            if len(collide) == len(exact):
                break
            exact = collide
            kept, more, deviations = _above_noise(unit, length, again, sigma, plausible, len(names))
            hidden += more
        for j, partners, deviation in hidden:
            others = tuple(names[k] for k in partners)
            why = hardly_differ(names[j], others, arm, deviation, size[j])
            dropped.append(Dropped(names[j], why, others, False))
    for j, partners in exact:
        others = tuple(names[k] for k in partners)
        dropped.append(Dropped(names[j], move_alike(names[j], others, arm), others, True))
    mask = np.zeros(len(names), bool)
    mask[kept] = True
    scaled = (jacobian * column_scale(names, plausible))[:, mask]
    kept_values = svd(unit[:, mask], compute_uv=False)
    indices = observability(svd(scaled, compute_uv=False), poses or max(len(jacobian) // 3, 1))
    rank = {name: place for place, name in enumerate(names)}
    return Identifiability(
        names, mask, tuple(sorted(dropped, key=lambda entry: rank[entry.name])),
        _all_singular_values(unit, len(names)),
        float(kept_values[0] / kept_values[-1]) if kept_values.size and kept_values[-1] > 0.0 else np.inf,
        indices, deviations)


def still_axes(q: np.ndarray) -> tuple[int, ...]:
    """Axes (from 1) that move by less than a milliradian (millimetre) over all poses q (N, n)."""
    return tuple(int(i) + 1 for i in np.flatnonzero(np.ptp(q, axis=0) < _STILL))


def preference(names: Sequence[ParameterId], keep_first: int = 0) -> list[int]:
    """Column indices from the one to keep most to the one to drop first."""
    rest = range(keep_first, len(names))

    def rank(j: int) -> tuple[int, int, int]:
        p = names[j]
        by_axis = p.axis if p.group in (Group.GEOMETRY, Group.OFFSET, Group.RATIO) else 0
        return int(p.group), by_axis, j

    return [*range(keep_first), *sorted(rest, key=rank)]


def _ordered_qr(unit: np.ndarray, order: list[int]) -> tuple[list[int], list[tuple[int, list[int]]]]:
    """Kept columns, and each dropped one with those kept columns of which it is a combination."""
    basis = np.zeros((unit.shape[0], 0))
    kept: list[int] = []
    dropped = []
    for j in order:
        rest = unit[:, j] - basis @ (basis.T @ unit[:, j])
        rest -= basis @ (basis.T @ rest)  # once more: rounding leaves a trace of the basis
        left = np.linalg.norm(rest)
        if left > RANK_TOLERANCE:
            basis = np.column_stack([basis, rest / left])
            kept.append(j)
        else:
            share = lstsq(unit[:, kept], unit[:, j], rcond=None)[0]
            dropped.append((j, _participants(share, kept, _PARTICIPATES)))
    return kept, dropped


def _participants(share: np.ndarray, columns: list[int], least: float) -> list[int]:
    """The columns with a coefficient worth naming, the largest first."""
    size = np.abs(share)
    named = [i for i in np.argsort(-np.round(size, 9), kind="stable")
             if size[i] > least * size.max(initial=0.0)]
    return [columns[i] for i in named]


def _above_noise(unit, length, kept, sigma, plausible, count):
    """Drops, one by one, what the noise hides: kept, [(dropped, partners, deviation)], deviations (P,)."""
    size = np.full(count, np.inf) if plausible is None else np.asarray(plausible, float)
    kept, hidden = list(kept), []
    deviations = np.full(count, np.nan)
    while kept:
        _, values, directions = svd(unit[:, kept], full_matrices=False)
        if len(values) < len(kept):
            break
        spread = sigma * np.linalg.norm(directions.T / values, axis=1) / length[kept]
        excess = spread / size[kept]
        if not np.any(excess > 1.0):
            deviations[kept] = spread
            break
        place, partners = _weakest(unit, length, kept, size, excess)
        hidden.append((kept[place], [kept[i] for i in partners], float(spread[place])))
        del kept[place]
    return kept, hidden, deviations


def _weakest(unit, length, kept, size, excess) -> tuple[int, list[int]]:
    """Of the weakest direction (in plausible magnitudes) the last hidden parameter, and its partners."""
    finite = np.where(np.isfinite(size[kept]), size[kept], 1.0)
    direction = np.abs(svd(unit[:, kept] * (length[kept] * finite), full_matrices=False)[2][-1])
    part = direction > _WEAK_SHARE * direction.max()
    hidden = excess > 1.0
    candidates = np.flatnonzero(part & hidden) if np.any(part & hidden) else np.flatnonzero(hidden)
    place = int(candidates[-1])
    return place, [int(i) for i in np.argsort(-direction, kind="stable") if part[i] and i != place]


def _all_singular_values(unit: np.ndarray, count: int) -> np.ndarray:
    values = svd(unit, compute_uv=False) if unit.size else np.zeros(0)
    return np.concatenate([values, np.zeros(count - len(values))])
