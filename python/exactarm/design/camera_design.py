"""Design of pictures: where to put a board (or a camera), and the poses in which to take pictures of it.

    1. candidate places: points that the target reaches; a board at rest lies level there, face up; a camera
       at rest looks through the point, any way
    2. random poses of the arm that show the board within the limits of distance and tilt, half of its corners
       or more in the picture (exactarm.measurement.board_views), allowed by joints, box and clearance
    3. places one after the other, each time the one that lowers the mean variance of the target's position
       over the work space most, its frames, lens and square integrated out
    4. of the poses of these places, `count` by the same criterion (I-optimality, exactarm.design.exchange)

A picture is one block of information, J'C^{-1}J with C = s^2 I + B S B': s of a corner, S (6, 6) of how the
arm repeats, B (2K, 6) the corners by a motion of the camera. What the flange carries is taken to sit at the
target of the robot file and to look along its z.
"""

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import CameraSetup, Fixture
from exactarm.design.closure_design import (
    ClosureDesignOptions,
    find_places,
    least_variance,
    work_space_weight,
)
from exactarm.design.criterion import information_of
from exactarm.design.design import short_way
from exactarm.design.pose_space import PoseSpace
from exactarm.errors import InputError
from exactarm.identify.closure_fit import Pulls
from exactarm.identify.closures import identifiable_closures
from exactarm.identify.declared import geometry_layout, require_geometry
from exactarm.identify.identifiability import Identifiability
from exactarm.measurement.board_views import (
    LEAST_SEEN,
    VIEWS,
    Views,
    corners_seen,
    joint_angles,
    wanted_views,
)
from exactarm.measurement.camera import Camera
from exactarm.measurement.closures import predict_closures
from exactarm.measurement.pictures import rows_of_pictures
from exactarm.numerics.rotation import exp
from exactarm.robot.controller_frames import at_base
from exactarm.robot.robot import Robot

CANDIDATES = 12  # places that are looked at
_POOL, _LEAST_POSES = 60, 12  # poses of a place: enough, and below which it is hardly seen
_TO_CHOOSE = 2  # times as many poses of a proposed place as it gets: fewer leave nothing to choose
_VIEWS, _ROUNDS = 150, 4
CORNER_PX = 0.1  # standard deviation of a found corner
REPEATS_M, REPEATS_RAD = 5e-5, 5e-5  # standard deviations of how the arm repeats
_RANK = 15  # of a picture: six numbers of the camera's pose, the square, eight of the lens
_PLACED_M = 0.1  # how well frames are known beforehand, m and rad
_LENS_SHARE, _BEND = 0.05, 0.5  # the same of the lens: of the focal length, and of k1, k2, p1, p2
_FACE_DOWN = np.diag([1.0, -1.0, -1.0])  # z of a board points into it


@dataclass(frozen=True)
class CameraDesign:
    """q (K, n) of the controller with session (K,) int; cameras: one a place, in the order of the sessions;
    deviation: expected error of the target over the work space, m, with the drawing alone, with random poses
    that see the board at these places, and with these; q_random, session_random: those random ones."""

    q: np.ndarray
    session: np.ndarray
    cameras: tuple[Camera, ...]
    deviation: tuple[float, float, float]
    q_random: np.ndarray
    session_random: np.ndarray
    identifiability: Identifiability


@dataclass(frozen=True)
class _Place:
    """camera, poses q (K, n), corners of all poses (picture k: pose k), blocks (K, r, P) of `names`."""

    camera: Camera
    q: np.ndarray
    rows: Dataset
    blocks: np.ndarray
    names: tuple[str, ...]


def design_pictures(robot: Robot, setup: CameraSetup, options: ClosureDesignOptions,
                    views: Views = VIEWS) -> CameraDesign:
    """The places and poses. Raises InputError where a given place is not seen in enough poses."""
    require_geometry(robot)
    if setup.size is None or setup.lens is None:
        raise InputError("[camera] of the fixture file: size_px or focal_px missing; expected both for a "
                         "design: they say what is in the picture")
    random = np.random.default_rng(options.seed)
    robot = replace(at_base(robot), effects=())
    space = PoseSpace.of(robot, options.box, options.clearance)
    places = _places(robot, space, setup, options, views, random)
    chosen = _chosen_places(robot, places, options, random)
    return _designed(robot, space, chosen, options, random)


def _places(robot: Robot, space: PoseSpace, setup: CameraSetup, options: ClosureDesignOptions, views: Views,
            random: np.random.Generator) -> list[_Place]:
    centres = options.at or space.target(space.draw(4 * CANDIDATES, random))

    def place_of(centre: np.ndarray, number: int) -> _Place | None:
        return _place(robot, space, _camera(setup, number, centre, views, random), options, views, random)

    return find_places(centres, place_of, options, CANDIDATES,
                       shown=f"{_LEAST_POSES} poses of {_VIEWS * _ROUNDS} tried show the board",
                       expected="before the arm, or wider limits of distance and tilt",
                       enough="seen in enough poses: enlarge --box, --near-mm, --far-mm or --tilt-deg")


def _camera(setup: CameraSetup, session: int, centre: np.ndarray, views: Views,
            random: np.random.Generator) -> Camera:
    """What the flange carries looks along the target's z; a board lies level, a camera looks any way."""
    about = exp(np.array([0.0, 0.0, random.uniform(-np.pi, np.pi)]))
    middle = 0.5 * setup.square * np.array([setup.columns, setup.rows, 0.0])
    if setup.on_flange:
        mount, m = np.eye(3), np.zeros(3)
        world = about @ _FACE_DOWN
        w = centre - world @ middle
    else:
        mount = _FACE_DOWN
        m = -mount @ middle
        world = exp(random.normal(0.0, 1.0, 3)) @ about
        w = centre - 0.5 * (views.near + views.far) * world[:, 2]
    rows = lambda matrix: tuple(tuple(map(float, row)) for row in matrix)
    camera = Camera(None, (), session, 0, setup=setup, mount=rows(mount), world=rows(world),
                    focal=float(setup.lens[0]))
    zero = np.zeros(3)
    return camera.with_values([*zero, *m, *zero, *w, setup.square, *setup.lens])


def _place(robot: Robot, space: PoseSpace, camera: Camera, options: ClosureDesignOptions, views: Views,
           random: np.random.Generator) -> _Place | None:
    none, limits = Layout.of(()), (space.lower, space.upper)
    wanted = _TO_CHOOSE * -(-options.count // options.places)
    parts, enough = [], max(_POOL, wanted)
    for _ in range(_ROUNDS):
        shown = wanted_views(camera.setup, _VIEWS, random, views)
        q, _ = joint_angles(robot, none, camera, shown, limits, random, np.zeros((_VIEWS, len(space.lower))))
        q = q[space.allowed(q)] if len(q) else q
        if len(q):
            rows, inside = corners_seen(robot, none, camera, q, np.zeros_like(q))
            parts.append(q[np.bincount(rows.picture, inside, len(q)) / camera.setup.corners > LEAST_SEEN])
        if sum(map(len, parts)) >= enough:
            break
    q = np.concatenate(parts)[:enough] if parts else np.zeros((0, len(space.lower)))
    if len(q) < (_LEAST_POSES if options.at else max(_LEAST_POSES, wanted)):
        return None
    rows, inside = corners_seen(robot, none, camera, q, np.zeros_like(q))
    rows = rows.select(inside)
    layout = Layout.of((camera,)).joined(geometry_layout(robot))
    prediction = predict_closures(robot, layout, rows, threads=options.threads)
    motion = prediction.pictures.turned(camera.own_motion(prediction.view, np.arange(len(rows))))
    blocks = [_block(prediction.jacobian[at, :2].reshape(-1, layout.size), motion[at].reshape(-1, 6),
                     CORNER_PX / camera.focal) for at in rows_of_pictures(rows)]
    return _Place(camera, q, rows, np.stack(blocks), layout.names)


def _block(jacobian: np.ndarray, motion: np.ndarray, sigma: float) -> np.ndarray:
    """(r, P) with the information J'C^{-1}J of one picture; C^{-1} by Woodbury's identity."""
    repeats = np.array([REPEATS_M, REPEATS_M, REPEATS_RAD, REPEATS_M, REPEATS_RAD, REPEATS_RAD])
    shared = motion.T @ jacobian
    middle = np.diag((sigma / repeats) ** 2) + motion.T @ motion
    information = (jacobian.T @ jacobian - shared.T @ np.linalg.solve(middle, shared)) / sigma**2
    scale = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    return np.sqrt(np.maximum(values[-_RANK:], 0.0))[:, None] * vectors[:, -_RANK:].T * scale


def _chosen_places(robot: Robot, places: list[_Place], options: ClosureDesignOptions,
                   random: np.random.Generator) -> list[_Place]:
    """Greedy, by what some random poses of each place tell of the geometry beside its own unknowns."""
    if options.at:
        return places
    geometry = geometry_layout(robot)
    spread = np.array([parameter.plausible for parameter in geometry.parameters])
    weight = work_space_weight(robot, geometry, options, spread)
    each = max(options.count // options.places, 2)
    told = [_of_geometry(place, random.permutation(len(place.q))[:each], spread) for place in places]
    chosen, information = [], np.eye(len(spread))
    for _ in range(options.places):
        left = [k for k in range(len(places)) if k not in chosen]
        variance = [np.trace(np.linalg.solve(information + told[k], weight)) for k in left]
        chosen.append(left[int(np.argmin(variance))])
        information = information + told[chosen[-1]]
    return [places[k] for k in sorted(chosen)]


def _of_geometry(place: _Place, some: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Information about the geometry (last in the layout) with the camera's own unknowns taken out."""
    first = len(place.names) - len(spread)
    scale = np.concatenate([_loose(place.camera)[: first], spread])
    whole = information_of(place.blocks[some] * scale)
    own = whole[:first, :first] + np.eye(first)
    across = whole[first:, :first]
    return whole[first:, first:] - across @ np.linalg.solve(own, across.T)


def _loose(camera: Camera) -> np.ndarray:
    """How well each free parameter of a camera is known beforehand."""
    size = {"px": _LENS_SHARE * camera.focal, "m": _PLACED_M, "rad": _PLACED_M}
    free = [parameter for parameter in camera.parameters() if not parameter.fixed]
    return np.array([size.get(parameter.name.rpartition("_")[2], _BEND) for parameter in free])


def _designed(robot: Robot, space: PoseSpace, places: list[_Place], options: ClosureDesignOptions,
              random: np.random.Generator) -> CameraDesign:
    cameras = tuple(place.camera for place in places)
    rows = _stacked([place.rows for place in places])
    geometry = geometry_layout(robot)
    layout, found = identifiable_closures(robot, Layout.of(cameras), geometry, rows, options.threads)
    known = {name: size for camera in cameras
             for name, size in zip(Layout.of((camera,)).names, _loose(camera))}
    plausible = np.array([known.get(name, parameter.plausible)
                          for name, parameter in zip(layout.names, layout.parameters)])
    pool = np.concatenate([_embedded(place, layout.names) for place in places]) * plausible
    place_of = np.repeat(np.arange(len(places)), [len(place.q) for place in places])
    q = np.concatenate([place.q for place in places])
    if len(q) <= options.count:
        raise InputError(f"--count {options.count}: expected fewer poses than the {len(q)} that were found "
                         "to see the board")
    pull, _ = Pulls.of(geometry, Fixture()).rows(layout)
    of_camera = np.array([name in known for name in layout.names])
    prior = information_of(pull[:, None, :] * plausible) + np.diag(of_camera.astype(float))
    weight = np.zeros((layout.size, layout.size))
    of_arm = layout.only(range(len(cameras), len(layout.effects)))
    weight[np.ix_(~of_camera, ~of_camera)] = work_space_weight(robot, of_arm, options, plausible[~of_camera])
    best, start, deviations = least_variance(pool, prior, weight, options.count, random)
    of_place = [short_way(space, q[best[place_of[best] == k]]) for k in range(len(places))]
    return CameraDesign(
        np.concatenate(of_place), np.repeat(np.arange(1, len(places) + 1), [len(part) for part in of_place]),
        cameras, deviations, q[start], 1 + place_of[start], found)


def _embedded(place: _Place, names: tuple[str, ...]) -> np.ndarray:
    """(K, r, P) blocks of a place in the columns of `names`."""
    out = np.zeros((*place.blocks.shape[:2], len(names)))
    where = {name: k for k, name in enumerate(place.names)}
    for column, name in enumerate(names):
        if name in where:
            out[:, :, column] = place.blocks[:, :, where[name]]
    return out


def _stacked(parts: list[Dataset]) -> Dataset:
    stack = lambda pick: np.concatenate([pick(part) for part in parts])
    return Dataset.of_arrays(
        parts[0].kind, {"q": stack(lambda part: part.joints["q"])}, session=stack(lambda part: part.session),
        picture=stack(lambda part: part.picture), corner=stack(lambda part: part.corner),
        pixel=stack(lambda part: part.pixel),
        contacts={"camera": stack(lambda part: part.contacts["camera"])})
