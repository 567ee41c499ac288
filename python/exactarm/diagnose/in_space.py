"""Where in space the error sits: error vectors of measured positions before and after, in the controller's
base frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.robot.controller_frames import in_base, vectors_in_base
from exactarm.robot.robot import Robot


@dataclass(frozen=True)
class InSpace:
    """position (N, 3) m of the target, before and after (N, 3) m measured minus predicted, all in the
    controller's base frame; arm (n + 2, 3) m: DH frame 0, joints and target at one of the poses. `which`
    names the rows: "validation" or "identification"."""

    which: str
    arm: np.ndarray
    position: np.ndarray
    before: np.ndarray
    after: np.ndarray


def errors_in_space(robot: Robot, first: Layout, last: Layout, data: Dataset, which: str, used: np.ndarray,
                    threads: int = 1) -> InSpace:
    """From predictions of the rows of `data` by two layouts; rows that are not `used` (N,) are left out."""
    before, after = (predict_poses(robot, layout, data, tangents=False, threads=threads)
                     for layout in (first, last))
    turn = after.view.signals["base_rotation"].reshape(-1, 3, 3)
    into_first = lambda vectors: np.einsum("nji,nj->ni", turn, vectors)
    position = into_first(after.view.signals["target"] - after.view.signals["base_position"])
    position, frames = in_base(robot, position), in_base(robot, after.view.frames()[0])
    row = int(np.argmin(np.linalg.norm(position - np.median(position, axis=0), axis=1)))
    arm = np.concatenate([frames[row], position[row : row + 1]])
    errors = (vectors_in_base(robot, into_first(each.residual()))[used] for each in (before, after))
    return InSpace(which, arm, position[used], *errors)
