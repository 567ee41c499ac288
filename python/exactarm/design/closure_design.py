"""Design of closures: where to put a fixture of two seats, and in which poses to touch them.

    1. candidate places: points that the target reaches with many orientations, two seats `apart` in a random
        level direction
    2. random poses that touch the seats of each candidate (exactarm.measurement.touching), within the joint
        limits
    3. places one after the other, each time the one whose poses lower the mean variance of the target's
        position most,
       over random poses of the work space
    4. of the poses of the places chosen, `count` by the same criterion (exactarm.design.exchange)

The variance is that with contacts, tool and all deviations unknown, the seats' distance known, and the
drawing as prior (exactarm.identify.closure_fit). Places may be given instead. The target is that of the robot
file.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import Distance, Fixture
from exactarm.data.split import DEFAULT_SEED
from exactarm.design.criterion import Criterion, information_of
from exactarm.design.design import short_way
from exactarm.design.exchange import ExchangeOptions, exchange
from exactarm.design.pose_space import Box, PoseSpace
from exactarm.errors import ComputationError, InputError
from exactarm.identify.closure_fit import Pulls
from exactarm.identify.closures import identifiable_closures
from exactarm.identify.declared import geometry_layout, require_geometry
from exactarm.identify.identifiability import Identifiability
from exactarm.identify.planned import SIGMA_POSITION_M, pose_data
from exactarm.measurement.closures import predict_closures
from exactarm.measurement.contact import Contact
from exactarm.measurement.contacts import Socket
from exactarm.measurement.target import Target
from exactarm.measurement.touching import TOUCHES_M, rows_at, target_at, touching
from exactarm.robot.controller_frames import at_base
from exactarm.robot.robot import Robot

P = TypeVar("P")

CANDIDATES = 24  # places that are looked at
_POOL = 40  # poses that touch a seat of a candidate, at most
_LEAST_POSES = 6  # of each seat; below, a place is hardly reached
_STARTS = 600  # random poses from which the touching ones of a seat are sought
_NEAR_M = 0.35
_PLACED_M = 0.1  # how well seats and tool are known beforehand
LEAST_FALL = 1e-3  # of the mean variance, relative, in the steps that an exchange waits for
_WORK_SPACE = 500  # poses over which the target's position is to be known


@dataclass(frozen=True)
class ClosureDesignOptions:
    """places, count (poses in all); apart: the seats' distance, m; at: centres (3,) m of given places,
    instead of proposals."""

    places: int = 3
    count: int = 60
    apart: float = 0.05
    at: tuple[tuple[float, float, float], ...] = ()
    box: Box = Box()
    clearance: float | None = None
    seed: int = DEFAULT_SEED
    threads: int = 1


@dataclass(frozen=True)
class ClosureDesign:
    """q (K, n) of the controller with session and socket (K,) int; seats: (session, socket) -> centre (3,) m
    in the base frame; deviation: expected error of the target over the work space, m, with the drawing alone,
    with random poses of the same places, and with these."""

    q: np.ndarray
    session: np.ndarray
    socket: np.ndarray
    seats: dict[tuple[int, int], np.ndarray]
    deviation: tuple[float, float, float]
    identifiability: Identifiability
    space: PoseSpace


@dataclass(frozen=True)
class _Place:
    """Two seats, and poses (K, n) that touch each."""

    seats: tuple[np.ndarray, np.ndarray]
    poses: tuple[np.ndarray, np.ndarray]


def design_closures(robot: Robot, options: ClosureDesignOptions = ClosureDesignOptions()) -> ClosureDesign:
    """The places and poses. Raises InputError where a given place is out of reach or poses are too few."""
    require_geometry(robot)
    random = np.random.default_rng(options.seed)
    robot = replace(at_base(robot), effects=())
    space = PoseSpace.of(robot, options.box, options.clearance)
    places = _places(robot, space, options, random)
    model = _Model(robot, places, options)
    chosen = list(range(len(places))) if options.at else model.choose_places(random)
    return model.design(space, chosen, random)


def _places(robot: Robot, space: PoseSpace, options: ClosureDesignOptions,
            random: np.random.Generator) -> list[_Place]:
    centres = options.at or space.target(space.draw(4 * CANDIDATES, random))
    return find_places(
        centres, lambda centre, _: _place(robot, space, centre, options.apart, random), options, CANDIDATES,
        shown=f"{_LEAST_POSES} of {_STARTS} random poses reach either seat", expected="well inside the reach",
        enough="reached in enough poses: enlarge --box")


def find_places(centres: Iterable[Sequence[float]], place_of: Callable[[np.ndarray, int], P | None],
                options: ClosureDesignOptions, most: int, *, shown: str, expected: str,
                enough: str) -> list[P]:
    """Places at the centres (3,): all of those that `options.at` gives, else the first `most` that serve.

    place_of(centre, number of the place from 1): None where it does not serve. Raises InputError where a
    given one does not, and ComputationError where too few others do; shown, expected, enough: their words."""
    found, tried = [], 0
    for tried, centre in enumerate(centres, 1):
        place = place_of(np.asarray(centre, float), len(found) + 1)
        if place is not None:
            found.append(place)
        elif options.at:
            raise InputError(f"--at, place {tried}: fewer than {shown} at "
                             f"({', '.join(f'{x:g}' for x in centre)}) m; expected a place {expected}")
        if not options.at and len(found) == most:
            break
    if not options.at and len(found) < options.places:
        raise ComputationError(f"only {len(found)} of {tried} random places are {enough}")
    return found


def _place(robot: Robot, space: PoseSpace, centre: np.ndarray, apart: float,
           random: np.random.Generator) -> _Place | None:
    angle = random.uniform(0.0, 2.0 * np.pi)
    half = 0.5 * apart * np.array([np.cos(angle), np.sin(angle), 0.0])
    seats = (centre - half, centre + half)
    poses = tuple(_poses(robot, space, seat, random) for seat in seats)
    return _Place(seats, poses) if min(map(len, poses)) >= _LEAST_POSES else None


def _poses(robot: Robot, space: PoseSpace, seat: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Up to `_POOL` allowed poses that touch a seat."""
    none = Layout.of(())
    q = random.uniform(space.lower, space.upper, (_STARTS, len(space.lower)))
    q = q[np.linalg.norm(target_at(robot, none, q) - seat, axis=1) < _NEAR_M][: 2 * _POOL]
    if not len(q):
        return q
    q, left = touching(robot, none, q, Socket(None, tuple(float(x) for x in seat), 1, 0))
    q = q[left < TOUCHES_M]
    return q[space.allowed(q)][:_POOL]


@dataclass(frozen=True, eq=False)
class MeanVariance(Criterion):
    """-log tr(M^-1 W): W (m, m) is the mean J'J of what is to be known (I-optimality; Atkinson, Donev and
    Tobias 2007, 10.6)."""

    weight: np.ndarray

    def values(self, information: np.ndarray) -> np.ndarray:
        weight = np.broadcast_to(self.weight, information.shape)
        return -np.log(np.trace(np.linalg.solve(information, weight), axis1=-2, axis2=-1))

    def gains(self, information: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        return self._changes(information, blocks, 1.0)

    def losses(self, information: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        return self._changes(information, blocks, -1.0)

    def _changes(self, information: np.ndarray, blocks: np.ndarray, sign: float) -> np.ndarray:
        """By (M + s B'B)^-1 = M^-1 - M^-1 B' (s I + B M^-1 B')^-1 B M^-1; the prior keeps M regular whatever
        is removed."""
        inverse = np.linalg.inv(information)
        taken = blocks @ inverse
        middle = sign * np.eye(blocks.shape[1]) + taken @ np.swapaxes(blocks, -1, -2)
        less = np.trace(np.linalg.solve(middle, taken @ self.weight @ np.swapaxes(taken, -1, -2)), axis1=-2,
                        axis2=-1)
        before = np.trace(inverse @ self.weight)
        return np.log(before) - np.log(before - less)


def work_space_weight(robot: Robot, layout: Layout, options: ClosureDesignOptions,
                      plausible: np.ndarray) -> np.ndarray:
    """Mean J'J of the target over the work space, by geometry alone: contacts and tool are the fixture's."""
    space = PoseSpace.of(robot, options.box, options.clearance)
    q = space.draw(_WORK_SPACE, np.random.default_rng(options.seed))
    free = tuple(np.zeros_like(mask) if isinstance(effect, (Contact, Target)) else mask
                 for effect, mask in zip(layout.effects, layout.free))
    held = Layout(layout.effects, free)
    data = replace(pose_data(q), contacts=rows_at(q, None).contacts, position=np.zeros((len(q), 3)))
    columns = predict_closures(robot, held, data).jacobian[:, :3]
    where = np.array([name in set(held.names) for name in layout.names])
    full = np.zeros((len(q), 3, layout.size))
    full[:, :, where] = columns * plausible[where]
    return information_of(full) / len(q)


def least_variance(pool: np.ndarray, known: np.ndarray, weight: np.ndarray, count: int,
                   random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, tuple[float, ...]]:
    """Indices (count,) of the blocks of `pool` (C, r, m) with the least mean variance beside what is `known`
    (m, m), random ones to begin with; and the expected error by what is known, with these, with the best."""
    criterion = MeanVariance(weight)
    start = random.choice(len(pool), count, replace=False)
    how = replace(ExchangeOptions(), keep=criterion, add=criterion, threshold=LEAST_FALL)
    best = exchange(pool, start, random, how, known).chosen
    told = (0.0, information_of(pool[start]), information_of(pool[best]))
    return best, start, tuple(expected_error(known + more, weight) for more in told)


def expected_error(information: np.ndarray, weight: np.ndarray) -> float:
    """Root mean square over the work space, m."""
    return float(np.sqrt(np.trace(np.linalg.solve(information, weight))))


class _Model:
    """Information of touches about tool, geometry and the seats of the candidates, in units of the drawing's
    prior."""

    def __init__(self, robot: Robot, places: list[_Place], options: ClosureDesignOptions):
        self.robot, self.places, self.options = robot, places, options
        sessions = range(1, len(places) + 1)
        seats = tuple(Socket(None, tuple(float(x) for x in seat), session, number)
                      for session, place in zip(sessions, places) for number, seat in enumerate(place.seats))
        tool = Target(None, tuple(float(x) for x in robot.tool.position), tuple(sessions), shared=True)
        fixture = Fixture((Distance("socket", (0, 1), options.apart),))
        setup, geometry = Layout.of((*seats, tool)), geometry_layout(robot)
        touched = [(session, number, q) for session, place in zip(sessions, places)
                   for number, q in enumerate(place.poses)]
        self.q = q = np.concatenate([q for _, _, q in touched])
        self.session = np.concatenate([np.full(len(q), session) for session, _, q in touched])
        self.socket = np.concatenate([np.full(len(q), number) for _, number, q in touched])
        rows = rows_at(q, None)
        contacts = rows.contacts | {"socket": self.socket}
        self.data: Dataset = replace(rows, contacts=contacts, session=self.session, fixture=fixture)
        self.layout, self.found = identifiable_closures(robot, setup, geometry, self.data, options.threads)
        blocks = predict_closures(robot, self.layout, self.data,
                                  threads=options.threads).jacobian / SIGMA_POSITION_M
        plausible = np.minimum([parameter.plausible for parameter in self.layout.parameters], _PLACED_M)
        self.blocks = blocks * plausible
        pull, _ = Pulls.of(geometry, fixture).rows(self.layout)
        loose = np.array([name not in set(geometry.names) for name in self.layout.names])
        self.known = information_of(pull[:, None, :] * plausible) + np.diag(loose.astype(float))
        self.weight = work_space_weight(robot, self.layout, options, plausible)

    def choose_places(self, random: np.random.Generator) -> list[int]:
        """Greedy: the place that helps most beside those chosen; each brings the same number of poses."""
        each = max(self.options.count // self.options.places, 2)
        of_place = [information_of(self.blocks[self._some(place, each, random)])
                    for place in range(len(self.places))]
        chosen, information = [], self.known
        for _ in range(self.options.places):
            best = min((p for p in range(len(self.places)) if p not in chosen),
                       key=lambda p: expected_error(information + of_place[p], self.weight))
            chosen.append(best)
            information = information + of_place[best]
        return sorted(chosen)

    def _some(self, place: int, count: int, random: np.random.Generator) -> np.ndarray:
        rows = np.flatnonzero(self.session == place + 1)
        return random.permutation(rows)[:count]

    def design(self, space: PoseSpace, chosen: list[int], random: np.random.Generator) -> ClosureDesign:
        """The poses of the chosen places."""
        rows = np.flatnonzero(np.isin(self.session - 1, chosen))
        if len(rows) <= self.options.count:
            raise InputError(f"--count {self.options.count}: expected fewer poses than the {len(rows)} that "
                             "were found at these places")
        best, _, errors = least_variance(self.blocks[rows], self.known, self.weight, self.options.count,
                                         random)
        picked = rows[best]
        number = {place: k for k, place in enumerate(chosen, 1)}
        order = np.concatenate([
            _in_short_way(space, self.q,
                          picked[(self.session[picked] == place + 1) & (self.socket[picked] == seat)])
            for place in chosen for seat in (0, 1)])
        return ClosureDesign(
            self.q[order], np.array([number[s - 1] for s in self.session[order]]), self.socket[order],
            {(number[place], k): seat for place in chosen for k, seat in enumerate(self.places[place].seats)},
            errors, self.found, space)


def _in_short_way(space: PoseSpace, q: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The rows in an order of short ways."""
    way = short_way(space, q[rows])
    return np.array([rows[np.flatnonzero((q[rows] == pose).all(axis=1))[0]] for pose in way], int)
