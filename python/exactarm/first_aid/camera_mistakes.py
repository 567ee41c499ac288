"""Usual mistakes in pictures of a board, each tried: would the arm fit without it?

Every picture shows where the camera stood before the board (exactarm.measurement.board_pictures). A mistake
of pictures (mirrored pixels, another board, camera and board exchanged) is undone, and what is left of
T_i M = W C_i is compared, T_i by the robot file. Mistakes of the arm are looked for as in poses, with the
places that the pictures show in place of a tracker's. Nothing is corrected.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from exactarm.chain import predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import CameraSetup
from exactarm.data.kinds import POSES
from exactarm.errors import InputError
from exactarm.first_aid.pose_mistakes import LEAST_ROWS, pose_mistakes
from exactarm.first_aid.suspicion import FALL, Suspicion, in_order
from exactarm.identify.declared import carried_layout
from exactarm.measurement.board_pictures import inverse, two_frames
from exactarm.measurement.camera import board_poses
from exactarm.robot.robot import Placement, Robot

OTHER_FOCAL = np.log(1.15)  # from where on a focal length is another one and no rough value


def camera_mistakes(robot: Robot, data: Dataset) -> list[Suspicion]:
    """The mistakes that explain the pictures of the first session with a camera better, best first."""
    setup = data.fixture.camera
    if setup is None or data.pixel is None:
        return []
    rows = data.select(data.contacts["camera"] >= 0)
    rows = rows.select(rows.session == rows.session[0])
    found: list[Suspicion] = []
    try:
        now, poses = _misfit(robot, setup, rows), pictures_as_poses(setup, rows)
    except InputError:  # refused, and may be right after one of the changes
        now, poses = robot.reach, rows.select(np.zeros(0, int))
    for words, other, changed in _candidates(setup, rows):
        try:
            fall = now / max(_misfit(robot, other, changed), 1e-9)
        except InputError:  # such a board shows too few corners
            continue
        if fall >= FALL:
            found.append(Suspicion(words, fall))
    if not found and len(poses) >= LEAST_ROWS:
        found = pose_mistakes(robot, poses, carried_layout(robot, poses))
    return in_order(found)


def pictures_as_poses(setup: CameraSetup, data: Dataset) -> Dataset:
    """One row a picture: the place of what the flange carries in the frame of what stands."""
    _, shown, first = board_poses(setup, data, np.arange(len(data)))
    place = (inverse(shown) if setup.on_flange else shown)[1]
    none = {"contacts": {}, "pixel": None, "picture": None, "corner": None}
    return replace(data.select(first), kind=POSES.name, kinds=(POSES.name,), position=place, **none)


def _misfit(robot: Robot, setup: CameraSetup, data: Dataset) -> float:
    """RMS (m) that the best mounting and board leave of the pictures' places."""
    _, shown, first = board_poses(setup, data, np.arange(len(data)))
    pictures = replace(data.select(first), contacts={})
    bare = replace(robot, base=Placement(), tool=Placement())
    flange = predict_poses(bare, carried_layout(robot, pictures), pictures, tangents=False)
    return two_frames((flange.rotation, flange.position), inverse(shown) if setup.on_flange else shown)[2]


def _candidates(setup: CameraSetup, data: Dataset) -> Iterator[tuple[str, CameraSetup, Dataset]]:
    """What would have been meant, and the fixture and data that it means."""
    height = data.pixel[:, 1].max() if setup.size is None else setup.size[1] - 1.0
    mirrored = np.stack([data.pixel[:, 0], height - data.pixel[:, 1]], axis=1)
    yield ("mirrored pictures (u and v exchanged, or one of them counted from the other end)", setup,
           replace(data, pixel=mirrored))
    other = "stand" if setup.on_flange else "flange"
    yield f'[camera] on = "{other}" in the fixture file', replace(setup, on_flange=not setup.on_flange), data
    if setup.columns != setup.rows:
        yield (f"squares = [{setup.rows}, {setup.columns}] in the fixture file",
               replace(setup, columns=setup.rows, rows=setup.columns), data)
    if data.corner.min() >= 1:
        yield "corners numbered from 0", setup, replace(data, corner=data.corner - 1)
    if setup.lens is not None:
        yield from _other_lens(setup, setup.lens[0], data)


def _other_lens(setup: CameraSetup, focal: float,
                data: Dataset) -> Iterator[tuple[str, CameraSetup, Dataset]]:
    """The focal length that the pictures show by themselves, where the declared one is far from it."""
    unknown = replace(setup, lens=None)
    try:
        shown = float(board_poses(unknown, data, np.arange(len(data)))[0][0])
    except InputError:  # no picture shows it
        return
    if abs(np.log(shown / focal)) > OTHER_FOCAL:
        yield f"focal_px of some {shown:.3g} in place of {focal:.4g} in the fixture file", unknown, data
