"""Compensates a program and executes both, the old and the new one: what the real arm reaches with the new
program is what the controller's own arm would have reached with the old one, or the program is refused by
file and line.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from compensation_cell import identified
from exactarm.chain import Layout, predict_poses
from exactarm.compensate.law import CompensationModel
from exactarm.data.dataset import Dataset
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.effects.payload import Payload
from exactarm.errors import InputError
from exactarm.robot.robot import Placement

from .motion import Arm, matrix

REACHED_M = 1e-6
TURNED = 5e-6  # rad: a micrometre 0.2 m away from the tip


def robot_of(**controller):
    """An arm with other frames than its controller has and springs; nothing that depends on the direction."""
    robot = identified(effects=False, **controller)
    robot = replace(robot, joints=tuple(replace(joint, cw=None, ccw=None) for joint in robot.joints))
    return replace(robot, effects=(JointCompliance(1, (3e-7, 0.0)), JointCompliance(2, (4e-7, 0.0))))


def arm_of(robot) -> Arm:
    return Arm(CompensationModel.of(robot).controller.core)


def true_flange(robot, q, load) -> np.ndarray:
    if load is not None:
        mass, centre = load
        robot = replace(robot, effects=(*robot.effects, Payload(None, (mass, *(mass * np.array(centre))))))
    data = Dataset.of_arrays("poses", {"q": q[None], "approach": np.zeros((1, len(q)))})
    found = predict_poses(replace(robot, base=Placement(), tool=Placement()),
                          Layout.of(robot.effects, estimate=False), data, tangents=False)
    return matrix(found.position[0], np.reshape(found.rotation[0], (3, 3)))


def compensate(folder, robot, files, **options) -> dict[str, bytes]:
    """The new files."""
    for name, content in files.items():
        (folder / name).write_bytes(content)
    result = ea.compensate(robot, [folder / name for name in files], points="calculated", threads=1,
                           **options)
    return {name: result.contents[name] for name in files}


def distance(motion, robot, wanted) -> tuple[float, float]:
    """m and rad between the real tip at a motion's joint angles and a wanted tip."""
    there = true_flange(robot, motion.q, motion.load) @ motion.tool
    turn = there[:3, :3].T @ wanted[:3, :3]
    sine = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return float(np.linalg.norm(there[:3, 3] - wanted[:3, 3])), float(np.linalg.norm(sine))


def same_motions(robot, execute, files, written):
    old, new = execute(files), execute(written)
    assert [motion.kind for motion in old] == [motion.kind for motion in new] and old
    for before, after in zip(old, new):
        assert np.allclose(before.tool, after.tool, atol=1e-12) and before.load == after.load
        missed, turned = distance(after, robot, before.tip)
        uncorrected, _ = distance(before, robot, before.tip)
        said = (f"{before.where}: {1e6 * missed:.3f} um, {turned:.1e} rad; "
                f"uncorrected {1e6 * uncorrected:.0f} um")
        assert missed < REACHED_M and turned < TURNED, said
        assert uncorrected > 50 * REACHED_M, said


def corrected(folder, robot, execute, files, **options):
    same_motions(robot, execute, files, compensate(folder, robot, files, **options))


def refused(folder, robot, files, **options):
    """A message that names a file, a line and a reason."""
    with pytest.raises(InputError) as error:
        compensate(folder, robot, files, **options)
    names = "|".join(map(re.escape, files))
    assert re.search(rf"({names}), line \d+: \w", str(error.value)), str(error.value)
