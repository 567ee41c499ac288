"""Checks the declared model against a set of poses: what they identify, and what the model lacks.

Beside the parameters that the model has, the columns of the d and beta that its frames do not have are looked
at (a Hayati frame has no d, the others have no beta). One that the poses would show though no declared
parameter imitates it is a gap: a way in which the arm can be wrong that the model cannot express. For the
others it is said which declared parameters stand for them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout
from exactarm.identify.identifiability import Dropped, Identifiability, select_identifiable
from exactarm.robot.robot import Robot


@dataclass(frozen=True)
class ModelCheck:
    """identifiability of the declared parameters; absent: the d of Hayati frames and what stands for them;
    gaps: parameters that the model does not have, although these poses would show them."""

    identifiability: Identifiability
    absent: tuple[Dropped, ...]
    gaps: tuple[Dropped, ...]


def check_model(robot: Robot, layout: Layout, blocks_of: Callable[[Layout], np.ndarray], *, keep_first: int,
                weights: np.ndarray, still: tuple[int, ...] = ()) -> ModelCheck:
    """`blocks_of(layout)` gives the Jacobian (N, r, P) of the poses; weights (r,): 1 / standard deviation of
    a row; still: axes (from 1) that do not move in them."""
    full = with_all_columns(layout, robot)
    blocks = blocks_of(full)
    rows = blocks.reshape(-1, full.size)
    each = np.tile(weights, len(blocks))
    plausible = np.array([parameter.plausible for parameter in full.parameters])
    place = {name: j for j, name in enumerate(full.names)}
    declared = [place[name] for name in layout.names]

    def select(columns: list[int], first: int) -> Identifiability:
        names = [full.names[j] for j in columns]
        return select_identifiable(
            rows[:, columns], names, keep_first=first, poses=len(blocks), weights=each, sigma=1.0,
            plausible=plausible[columns], robot=robot, still=still)

    result = select(declared, keep_first)
    kept = [place[name] for name in result.identifiable]
    spare = [place[name] for name in full.names if name not in set(layout.names)]
    beside = select(kept + spare, len(kept))
    absent = tuple(entry for entry in beside.dropped if entry.name.symbol == "d")
    why = "{} would show in these poses, and no parameter of the model stands for it"
    gaps = tuple(Dropped(name, why.format(name)) for name in beside.identifiable if place[name] in spare)
    return ModelCheck(result, absent, gaps)


def with_all_columns(layout: Layout, robot: Robot) -> Layout:
    """The layout with d, a, alpha and beta of every frame free."""
    effects, free = [], []
    for effect, mask in zip(layout.effects, layout.free):
        whole = effect.with_all_columns(robot)
        effects.append(whole)
        free.append(mask if whole is effect else np.ones(len(whole.values), bool))
    return replace(layout, effects=tuple(effects), free=tuple(free))
