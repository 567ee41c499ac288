"""Views of a flat board: random poses of it before a camera, the joint angles that show it so, its corners.

The camera is on the flange before a board at rest, or at rest before a board on the flange. Wanted views lie
within a cone about the board's normal, at distances between two limits; joint angles are found for each from
random starts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import CameraSetup
from exactarm.data.kinds import CLOSURES
from exactarm.measurement.board_pictures import Pose, inverse
from exactarm.measurement.camera import Camera
from exactarm.measurement.touching import TOUCHES_M, predicted_at, touching
from exactarm.numerics.rotation import exp
from exactarm.robot.robot import Robot

_AIM_M = 0.05  # the camera's axis passes the middle of the board by this, at most
LEAST_SEEN = 0.5  # of the corners


@dataclass(frozen=True)
class Views:
    """near, far: distance of the board's middle, m; lean: of the view from the board's normal, at most, rad:
    flatter ones show no corner sharply."""

    near: float = 0.35
    far: float = 0.7
    lean: float = 0.75


VIEWS = Views()


def wanted_views(setup: CameraSetup, count: int, random: np.random.Generator, limits: Views = VIEWS) -> Pose:
    """Random poses of the board in the camera's axes: the board's middle before the lens, turned every
    way."""
    middle = 0.5 * setup.square * np.array([setup.columns, setup.rows, 0.0])
    lean = limits.lean * np.sqrt(random.random(count))
    about = random.uniform(0.0, 2.0 * np.pi, count)
    tilt = exp(lean[:, None] * np.stack([np.cos(about), np.sin(about), np.zeros(count)], axis=1))
    roll = exp(random.uniform(-np.pi, np.pi, count)[:, None] * np.array([0.0, 0.0, 1.0]))
    turned = tilt @ roll
    aim = np.concatenate([random.uniform(-_AIM_M, _AIM_M, (count, 2)),
                          random.uniform(limits.near, limits.far, (count, 1))], axis=1)
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
