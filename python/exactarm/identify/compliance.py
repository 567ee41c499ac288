"""Which axes' springs a calibration estimates: those that carry gravity and have no spring declared."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.dataset import Dataset
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.errors import InputError
from exactarm.robot import Robot

_LEAST_TORQUE_SHARE = 0.05  # of the most loaded axis' torque; below it, compliance moves nothing that a tracker sees


def compliance_layout(robot: Robot, data: Dataset, axes: Sequence[int] | None = None) -> Layout:
    """Linear compliance of the axes asked for (from 1), or of those that the poses of `data` load."""
    carried = {effect.joint for effect in robot.effects if effect.name == JointCompliance.name}
    if axes is None:
        axes = _loaded_axes(robot, data)
    elif robot.links is None and axes:
        raise InputError(f"robot {robot.name}: compliance needs declared link masses", file=robot.file)
    return Layout.of(tuple(JointCompliance.none_of(robot, axis - 1) for axis in axes if axis not in carried))


def _loaded_axes(robot: Robot, data: Dataset) -> list[int]:
    if robot.links is None:
        return []
    torque = predict_poses(robot, Layout.of(()), data, tangents=False).view.torque
    spread = np.std(torque, axis=0)
    loaded = spread > max(_LEAST_TORQUE_SHARE * spread.max(), 1e-9)
    return [i + 1 for i, joint in enumerate(robot.joints) if loaded[i] and not joint.spring_linear]
