"""Planned measurements: the identification Jacobian of poses that have not been measured yet.

The parameters are those that a calibration estimates (geometry, joint offsets, gear ratios, joint compliance,
and base and tool frame of one set-up). Gear ripple and the deflection of declared springs turn a joint by
less than a milliradian or so; no column notices, so they are left out of the planning.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES
from exactarm.effects.frames import Frames
from exactarm.effects.parameter_id import Group
from exactarm.identify.compliance import compliance_layout
from exactarm.identify.declared import geometry_layout, require_geometry
from exactarm.robot.robot import Placement, Robot

FRAMES = ("both", "base", "tool", "none")
SIGMA_POSITION_M = 1e-4  # of a good camera system or an ordinary tracker (thesis 3.2.1)
SIGMA_ORIENTATION_RAD = 8.7e-4  # 0.05 degrees, same place


@dataclass(frozen=True)
class PlannedModel:
    """Robot and layout whose Jacobian is planned with; the first `frame_count` parameters are the frames'."""

    robot: Robot
    layout: Layout
    orientation: bool
    frame_count: int

    @staticmethod
    def of(robot: Robot, q: np.ndarray, frames: str = "both", orientation: bool = False) -> PlannedModel:
        """The model to plan for; q (N, n): poses that tell the loaded joints; frames: which are unknown."""
        require_geometry(robot)
        placed = Frames.of(1, Placement(), robot.tool, orientation)
        unknown = tuple(name for name in placed.names if frames == "both" or name.startswith(frames))
        layout = Layout.of((placed,)).without({f"session_1.{name}"
                                               for name in placed.names if name not in unknown})
        layout = layout.joined(geometry_layout(robot)).joined(compliance_layout(robot, pose_data(q)))
        joints = tuple(
            replace(joint, cw=None, ccw=None, spring_linear=None, spring_cubic=0.0) for joint in robot.joints)
        loaded = any(name.group is Group.EFFECT for name in layout.names)
        plain = replace(robot, joints=joints, effects=(), base=Placement(),
                        links=robot.links if loaded else None)
        return PlannedModel(plain, layout, orientation, len(unknown))

    @property
    def names(self) -> tuple[str, ...]:
        return self.layout.names

    @property
    def plausible(self) -> np.ndarray:
        return np.array([parameter.plausible for parameter in self.layout.parameters])

    def blocks(self, q: np.ndarray, threads: int = 1) -> np.ndarray:
        """(N, 3 or 6, P) Jacobian of each pose: m, and rad of the orientation."""
        return pose_blocks(self.robot, self.layout, pose_data(q), self.orientation, threads)


def pose_blocks(robot: Robot, layout: Layout, data: Dataset, orientation: bool,
                threads: int = 1) -> np.ndarray:
    """(N, 3 or 6, P) Jacobian of each row of `data`: position, and orientation where it is asked for."""
    jacobian = predict_poses(robot, layout, data, threads=threads).jacobian
    return jacobian if orientation else jacobian[:, :3]


def row_weights(orientation: bool, sigma_position: float = SIGMA_POSITION_M) -> np.ndarray:
    """(3,) or (6,) 1 / standard deviation of the numbers of one pose."""
    sigmas = [sigma_position] * 3 + ([SIGMA_ORIENTATION_RAD] * 3 if orientation else [])
    return 1.0 / np.array(sigmas)


def pose_data(q: np.ndarray) -> Dataset:
    """Poses that nobody has measured."""
    return Dataset.of_arrays(POSES.name, {"q": q})


def controller_angles(robot: Robot, data: Dataset) -> np.ndarray:
    """(N, n) joint angles as the controller reports them, from motor angles where there are only those."""
    q = np.full((len(data), robot.axes), np.nan)
    if "q" in data.joints:
        q[:] = data.joints["q"]
    if "theta" in data.joints:
        q = np.where(np.isnan(q), data.joints["theta"] / robot.controller_ratios + robot.controller_offsets,
                     q)
    return q
