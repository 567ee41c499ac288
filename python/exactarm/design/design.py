"""Design of measurement poses: the K poses that show the parameters best (thesis 3.2.2).

    1. random poses within joint limits and box; which parameters can they identify at all?
    2. extended DETMAX from a random set: candidates must raise O1, the one that raises O4 most is added, the
       one that O1 misses least is removed (exactarm.design.exchange)
    3. polish: every pose moves a little as long as O1 rises and O4 does not fall (exactarm.design.polish)
    4. validation poses: not designed. A design sits where parameters show most, at the rim; an honest
        judgement
       needs ordinary poses. Of many random sets the one is taken whose poses lie farthest from each other
       and from the identification poses.
Both sets are put into an order of short ways. All scaling: exactarm.identify.observability.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from exactarm.data.split import DEFAULT_SEED
from exactarm.design.exchange import ExchangeOptions, exchange
from exactarm.design.line_of_sight import Station
from exactarm.design.polish import PolishOptions, polish
from exactarm.design.pose_space import Box, PoseSpace
from exactarm.errors import InputError
from exactarm.identify.identifiability import Identifiability, select_identifiable
from exactarm.identify.observability import Observability, column_scale, observability
from exactarm.identify.planned import PlannedModel, row_weights
from exactarm.numerics.factors import svd
from exactarm.robot.robot import Robot

# Steps as they are told, in their order.
CANDIDATES, EXCHANGE, POLISH = "candidate poses", "exchange of poses", "polishing the chosen poses"

POOL = 4000
REFERENCE = 1000  # poses that decide what is identifiable, thesis 3.2.1
VALIDATION_SETS = 300
_STARTS = 20


@dataclass(frozen=True)
class DesignOptions:
    """count, validation: numbers of poses; frames: which of base and tool frame are unknown (planned.FRAMES);
    clearance of the hand from the arm's body in m (None: a tenth of the arm)."""

    count: int = 50
    validation: int = 13
    box: Box = field(default_factory=Box)
    clearance: float | None = None
    station: Station | None = None
    frames: str = "both"
    orientation: bool = False
    seed: int = DEFAULT_SEED
    threads: int = 1
    exchange: ExchangeOptions = field(default_factory=lambda: ExchangeOptions(candidates=100))
    polish: PolishOptions = field(default_factory=PolishOptions)


@dataclass(frozen=True)
class Design:
    """Designed poses q (K, n) and q_validation (V, n) in the controller's angles, and how well they show the
    model.

    start: the random set that the search began with; exchanged: after the exchange; history: O1
    of the best set after each step of the exchange; validation_distance: the smallest distance of a
    validation pose from any other pose (root mean square over the axes, part of each axis' range).
    """

    model: PlannedModel
    space: PoseSpace
    identifiability: Identifiability
    q: np.ndarray
    q_validation: np.ndarray
    observability: Observability
    start: Observability
    exchanged: Observability
    history: np.ndarray
    validation_distance: float

    def observability_of(self, q: np.ndarray) -> Observability:
        """The indices of any other set of poses under the same model and scaling."""
        return _indices(_scaled(self.model, self.identifiability, q))


def design_poses(robot: Robot, options: DesignOptions = DesignOptions(),
                 progress: Callable[[str], None] = lambda text: None) -> Design:
    """Designs the poses. Raises InputError where `count` poses are too few for the parameters."""
    progress(CANDIDATES)
    rng = np.random.default_rng(options.seed)
    space = PoseSpace.of(robot, options.box, options.clearance, options.station)
    candidates = space.draw(POOL, rng)
    model = PlannedModel.of(robot, candidates[:REFERENCE], options.frames, options.orientation)
    blocks = model.blocks(candidates, options.threads)
    identifiability = reference_identifiability(model, blocks[:REFERENCE], options.count)
    _require_enough(options.count, blocks.shape[1], identifiability)
    pool = blocks[:, :, identifiability.kept] * _scale(model, identifiability)
    progress(EXCHANGE)
    start = _regular_start(pool, options.count, rng)
    exchanged = exchange(pool, start, rng, options.exchange)

    def blocks_at(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _scaled(model, identifiability, q, options.threads), space.allowed(q)

    progress(POLISH)
    keep, add = options.exchange.keep, options.exchange.add
    q = polish(candidates[exchanged.chosen], space.lower, space.upper, blocks_at, keep, add, rng,
               options.polish)
    q_validation, distance = spread_poses(space, q, options.validation, rng)
    parameters = int(identifiability.kept.sum())
    return Design(model, space, identifiability, short_way(space, q), short_way(space, q_validation),
                  _indices(blocks_at(q)[0]), _indices(pool[start]), _indices(pool[exchanged.chosen]),
                  np.exp(exchanged.history / (2 * parameters)) / np.sqrt(options.count), distance)


def reference_identifiability(model: PlannedModel, blocks: np.ndarray,
                              count: int | None = None) -> Identifiability:
    """What random poses with the Jacobian `blocks` (N, r, P) identify, with the noise of `count` poses."""
    poses = len(blocks)
    return select_identifiable(blocks.reshape(-1, blocks.shape[-1]), model.names,
                               keep_first=model.frame_count, poses=poses,
                               weights=np.tile(row_weights(model.orientation), poses),
                               sigma=float(np.sqrt(poses / (count or poses))),
                               plausible=model.plausible, robot=model.robot)


def spread_poses(space: PoseSpace, taken: np.ndarray, count: int,
                 rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """(count, n) random poses apart from each other and from `taken` (K, n), and their smallest distance."""
    if count == 0:
        return np.zeros((0, taken.shape[1])), float("inf")
    draws = space.draw(VALIDATION_SETS * count, rng)
    sets = ((draws - space.lower) / (space.upper - space.lower)).reshape(VALIDATION_SETS, count, -1)
    others = (taken - space.lower) / (space.upper - space.lower)
    to_taken = np.sqrt(np.mean((sets[:, :, None] - others[None, None]) ** 2, axis=-1)).min(axis=(1, 2))
    among = np.sqrt(np.mean((sets[:, :, None] - sets[:, None, :]) ** 2, axis=-1)) + 2.0 * np.eye(count)
    distance = np.minimum(to_taken, among.min(axis=(1, 2)))
    best = int(np.argmax(distance))
    return draws.reshape(VALIDATION_SETS, count, -1)[best], float(distance[best])


def short_way(space: PoseSpace, q: np.ndarray) -> np.ndarray:
    """The same poses, each followed by the nearest of those left (by the axis that has farthest to go)."""
    if len(q) == 0:
        return q
    speed = np.array([joint.q_dot_max or 1.0 for joint in space.robot.joints])
    time = np.max(np.abs(q[:, None] - q[None]) / speed, axis=-1)
    order, left = [0], set(range(1, len(q)))
    while left:
        order.append(min(left, key=lambda k: (time[order[-1], k], k)))
        left.remove(order[-1])
    return q[order]


def _scale(model: PlannedModel, identifiability: Identifiability) -> np.ndarray:
    return column_scale(model.names, model.plausible)[identifiability.kept]


def _scaled(model: PlannedModel, identifiability: Identifiability, q: np.ndarray,
            threads: int = 1) -> np.ndarray:
    return model.blocks(q, threads)[:, :, identifiability.kept] * _scale(model, identifiability)


def _indices(blocks: np.ndarray) -> Observability:
    values = svd(blocks.reshape(-1, blocks.shape[-1]), compute_uv=False)
    return observability(values, len(blocks))


def _require_enough(count: int, rows: int, identifiability: Identifiability) -> None:
    parameters = len(identifiability.identifiable)
    if count * rows <= parameters:  # as `calibrate` has it: what has no redundancy shows no error
        raise InputError(
            f"--count {count}: {count * rows} numbers for {parameters} parameters, expected at least "
            f"{parameters // rows + 1} poses")


def _regular_start(pool: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """The first random set that identifies all parameters: with barely enough poses not every set does."""
    for _ in range(_STARTS):
        start = rng.choice(len(pool), count, replace=False)
        if _indices(pool[start]).O1 > 0.0:
            break
    return start
