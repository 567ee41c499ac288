"""Which axes' springs a calibration estimates: those that carry a load that is known, and have no spring
declared."""

from collections.abc import Sequence

import numpy as np

from exactarm import _core
from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.effects.joint_compliance import JointCompliance, RelativeCompliance
from exactarm.errors import InputError
from exactarm.rest_load import RestLoad
from exactarm.robot.robot import Robot

# of the most loaded axis' torque; below it, compliance moves nothing that a tracker sees
_LEAST_TORQUE_SHARE = 0.05


def compliance_layout(robot: Robot, data: Dataset, axes: Sequence[int] | None = None) -> Layout:
    """Linear compliance of the axes asked for (from 1), or of those that the poses of `data` load."""
    carried = {effect.joint for effect in robot.effects if effect.name == JointCompliance.name}
    if axes is None:
        axes = _loaded_axes(robot, data)
    elif robot.links is None and axes:
        raise InputError(f"robot {robot.name}: compliance needs link masses, or lengths to guess them by",
                         file=robot.file)
    return Layout.of(tuple(_spring(robot, data, axis - 1) for axis in axes if axis not in carried))


def _spring(robot: Robot, data: Dataset, index: int) -> JointCompliance:
    """That of axis `index` (from 0): of a guessed load with what makes up for wrongly distributed masses."""
    load = RestLoad.of(robot, data)
    if not robot.generic_masses or load.fixed[:, index].all():
        return JointCompliance.none_of(robot, index)
    return RelativeCompliance.none_of(robot, index, own_free=load.payload_varies)


def _loaded_axes(robot: Robot, data: Dataset) -> list[int]:
    view = predict_poses(robot, Layout.of(()), data, tangents=False).view
    known = np.array([not view.guessed_load(i) for i in range(robot.axes)]) | view.rest_load.payload_varies
    spread = np.std(view.torque, axis=0)
    # friction and noise are torques too, of axes that nothing loads
    if view.measured_loads.any() and view.has_masses:
        spread = np.minimum(spread, np.std(_core.gravity_torque(view.robot.core, view.q, 1), axis=0))
    loaded = known & (spread > max(_LEAST_TORQUE_SHARE * spread.max(), 1e-9))
    return [i + 1 for i, joint in enumerate(robot.joints) if loaded[i] and not joint.spring_linear]
