"""Pictures of a board on a virtual robot: poses in which the camera sees it, and the pixels of its corners.

The camera is on the flange before a board at rest, or at rest before a board on the flange, in random views
(exactarm.measurement.board_views).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import CameraSetup
from exactarm.data.kinds import CLOSURES
from exactarm.measurement.board_views import LEAST_SEEN, VIEWS, corners_seen, joint_angles, wanted_views
from exactarm.measurement.camera import Camera
from exactarm.measurement.lens import LENS
from exactarm.numerics.rotation import exp
from exactarm.robot.robot import Robot
from exactarm.simulate.sensors import Sensors

SETUP = CameraSetup(size=(1600, 1200))
TRUE_LENS = (1412.0, 1409.0, 806.0, 594.0, -0.11, 0.09, 4e-4, -3e-4, 0.0)
_TRIES, _ROUNDS = 150, 20


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
            keep = np.flatnonzero(share > LEAST_SEEN)[: count - found]
            rows = rows.select(inside & np.isin(rows.picture, keep))
            number = found + np.searchsorted(keep, rows.picture)
            parts.append(replace(rows, picture=number))
            found += len(keep)
        if found >= count:
            return _noisy(parts, camera, sensors, random)
        if attempt > 3 and not found:
            return None
    return None


def pictures_at(robot: Robot, layout: Layout, camera: Camera, q: np.ndarray, sensors: Sensors,
                random: np.random.Generator) -> Dataset:
    """Corners in pictures taken at q (K, n)."""
    rows, inside = corners_seen(robot, layout, camera, q, np.zeros_like(q))
    return _noisy([rows.select(inside)], camera, sensors, random)


def _camera(session: int, middle: np.ndarray, random: np.random.Generator, setup: CameraSetup) -> Camera:
    """Some centimetres beside the target, looking its way (on the flange); the board lies nearly level."""
    carried = (exp(random.normal(0.0, 0.15, 3)), random.normal(0.0, 0.05, 3))
    size = setup.square * np.array([setup.columns, setup.rows, 0.0])
    if setup.on_flange:  # face up: z of the board, which points into it, goes down
        turn = exp(random.normal(0.0, 0.1, 3)) @ exp(np.array([np.pi, 0.0, 0.0]))
        stands = turn, middle - turn @ (0.5 * size)
    else:
        turn = exp(random.normal(0.0, 1.0, 3))
        stands = turn, middle - 0.5 * (VIEWS.near + VIEWS.far) * turn[:, 2]
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
