"""Pictures of a board on a virtual robot: poses in which the camera sees it, and the pixels of its corners.

The camera is on the flange before a board at rest, or at rest before a board on the flange. Wanted views lie
within a cone about the board's normal, at distances between NEAR_M and FAR_M; joint angles are found for each
from random starts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout
from exactarm.dataset import Dataset
from exactarm.fixture import CameraSetup
from exactarm.kinds import CLOSURES
from exactarm.measurement.board_pictures import Pose, inverse
from exactarm.measurement.camera import Camera
from exactarm.measurement.lens import LENS
from exactarm.measurement.touching import TOUCHES_M, predicted_at, touching
from exactarm.robot import Robot
from exactarm.rotation import exp
from exactarm.simulate.sensors import Sensors

SETUP = CameraSetup(size=(1600, 1200))
TRUE_LENS = (1412.0, 1409.0, 806.0, 594.0, -0.11, 0.09, 4e-4, -3e-4, 0.0)
NEAR_M, FAR_M = 0.35, 0.7
_CONE_RAD = 0.75  # of views about the normal: flatter ones show no corner sharply
_AIM_M = 0.05  # the camera's axis passes the middle of the board by this, at most
_LEAST_SEEN = 0.5  # of the corners
_TRIES, _ROUNDS = 150, 20


@dataclass(frozen=True)
class Views:
    """q (N, n) of each view, and what the camera is."""

    q: np.ndarray
    camera: Camera


def wanted_views(setup: CameraSetup, count: int, random: np.random.Generator) -> Pose:
    """Random poses of the board in the camera's axes: the board's middle before the lens, turned every
    way."""
    middle = 0.5 * setup.square * np.array([setup.columns, setup.rows, 0.0])
    lean = _CONE_RAD * np.sqrt(random.random(count))
    about = random.uniform(0.0, 2.0 * np.pi, count)
    tilt = exp(lean[:, None] * np.stack([np.cos(about), np.sin(about), np.zeros(count)], axis=1))
    roll = exp(random.uniform(-np.pi, np.pi, count)[:, None] * np.array([0.0, 0.0, 1.0]))
    turned = tilt @ roll
    aim = np.concatenate([random.uniform(-_AIM_M, _AIM_M, (count, 2)),
                          random.uniform(NEAR_M, FAR_M, (count, 1))], axis=1)
    return turned, aim - turned @ middle


def joint_angles(robot: Robot, layout: Layout, camera: Camera, shown: Pose, limits: tuple, random,
                 approach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles (K, n) that show the board so, and which of the views they are."""
    (mount, m), (world, w) = camera.frames()
    turned, place = inverse(shown) if camera.setup.on_flange else shown
    rotation = world @ turned @ mount.T
    position = place @ world.T + w - rotation @ m
    start = random.uniform(*limits, approach.shape)
    q, left = touching(robot, layout, start, None, 0.0, approach, position=position, rotation=rotation)
    good = (left < TOUCHES_M) & np.all((q > limits[0]) & (q < limits[1]), axis=1)
    return q[good], np.flatnonzero(good)


def corners_seen(robot: Robot, layout: Layout, camera: Camera, q: np.ndarray,
                 approach: np.ndarray) -> tuple[Dataset, np.ndarray]:
    """One row for each corner of the board in each pose, and whether (N,) it lies in the picture."""
    setup, count = camera.setup, len(q)
    number = np.tile(np.arange(setup.corners), count)
    pose = np.repeat(np.arange(count), setup.corners)
    view = predicted_at(robot, layout, q, None, approach, position=np.zeros((count, 3))).view
    for name in ("target", "target_rotation", "displacement"):
        view.signals[name] = view.signals[name][pose]
    rows = Dataset.of_arrays(
        CLOSURES.name, {"q": q[pose], "approach": approach[pose]}, picture=pose, corner=number,
        contacts={"camera": np.zeros(len(pose), int)}, session=np.full(len(pose), camera.session),
    )
    view = replace(view, data=rows)
    at = np.arange(len(pose))
    pixels, depth = camera.focal * camera.numbers_at(view, at)[0], camera.depth(view, at)
    inside = np.all((pixels > 0.0) & (pixels < np.asarray(setup.size)), axis=1) & (depth > 0.05)
    return replace(rows, pixel=pixels), inside


def measured_pictures(
    robot: Robot, layout: Layout, session: int, middle: np.ndarray, count: int, limits: tuple,
    sensors: Sensors, random: np.random.Generator, setup: CameraSetup = SETUP,
) -> Dataset | None:
    """Corners in `count` pictures, with the board (or the camera) near `middle`; None where the arm cannot
    look at it."""
    camera = _camera(session, middle, random, setup)
    parts, found = [], 0
    for attempt in range(_ROUNDS):
        shown = wanted_views(setup, _TRIES, random)
        approach = random.choice([-1.0, 1.0], (_TRIES, len(limits[0])))
        q, good = joint_angles(robot, layout, camera, shown, limits, random, approach)
        if len(q):
            rows, inside = corners_seen(robot, layout, camera, q, approach[good])
            share = np.bincount(rows.picture, inside, len(q)) / setup.corners
            keep = np.flatnonzero(share > _LEAST_SEEN)[: count - found]
            rows = rows.select(inside & np.isin(rows.picture, keep))
            number = found + np.searchsorted(keep, rows.picture)
            parts.append(replace(rows, picture=number))
            found += len(keep)
        if found >= count:
            return _noisy(parts, camera, sensors, random)
        if attempt > 3 and not found:
            return None
    return None


def _camera(session: int, middle: np.ndarray, random: np.random.Generator, setup: CameraSetup) -> Camera:
    """Some centimetres beside the target, looking its way (on the flange); the board lies nearly level."""
    carried = (exp(random.normal(0.0, 0.15, 3)), random.normal(0.0, 0.05, 3))
    size = setup.square * np.array([setup.columns, setup.rows, 0.0])
    if setup.on_flange:  # face up: z of the board, which points into it, goes down
        turn = exp(random.normal(0.0, 0.1, 3)) @ exp(np.array([np.pi, 0.0, 0.0]))
        stands = turn, middle - turn @ (0.5 * size)
    else:
        turn = exp(random.normal(0.0, 1.0, 3))
        stands = turn, middle - 0.5 * (NEAR_M + FAR_M) * turn[:, 2]
    rows = lambda matrix: tuple(tuple(map(float, row)) for row in matrix)
    camera = Camera(None, (), session, 0, setup=setup, mount=rows(carried[0]), world=rows(stands[0]),
                    focal=TRUE_LENS[0])
    zero = np.zeros(3)
    square = setup.square + random.normal(0.0, setup.sigma)
    lens = np.asarray(setup.lens if setup.lens_given else TRUE_LENS, float)
    assert len(lens) == len(LENS)
    return camera.with_values([*zero, *carried[1], *zero, *stands[1], square, *lens])


def _noisy(parts: list[Dataset], camera: Camera, sensors: Sensors, random: np.random.Generator) -> Dataset:
    stack = lambda pick: np.concatenate([pick(part) for part in parts])
    pixels = stack(lambda part: part.pixel)
    pixels = pixels + random.normal(0.0, camera.focal * sensors.orientation_rad, pixels.shape)
    wrong = random.random(len(pixels)) < sensors.wrong_rows
    pixels += wrong[:, None] * random.normal(0.0, 0.01 * camera.focal, pixels.shape)
    return Dataset.of_arrays(
        CLOSURES.name, {name: stack(lambda part, name=name: part.joints[name]) for name in ("q", "approach")},
        pixel=pixels, picture=stack(lambda part: part.picture), corner=stack(lambda part: part.corner),
        session=stack(lambda part: part.session), contacts={"camera": np.zeros(len(pixels), int)},
    )
