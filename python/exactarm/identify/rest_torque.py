"""Torques measured at rest beside the gravity of the links, declared or generic; all measured axes at once.

A drive holds the load, a sensor behind the gear shows it: a column of torques is the one or the other, and
which one gravity tells. Where the torques run against it, they are taken with the opposite sign, and a line
says so.
"""

from dataclasses import replace

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.identify.loads import joint_angles
from exactarm.rest_load import TORQUES, RestLoad
from exactarm.robot.generic_masses import with_generic_masses
from exactarm.robot.robot import Robot

AGAINST = -0.5  # correlation with gravity, from which on a sign is another: friction and noise make none


def beside_gravity(robot: Robot, data: Dataset) -> tuple[float, float] | None:
    """Correlation with the gravity of `robot`, which has masses, and how many times as much as it the torques
    vary; None where nothing was measured or gravity does not vary."""
    load = RestLoad.of(robot, data)
    if robot.links is None or not load.fixed.any():
        return None
    gravity, measured = load.parts(joint_angles(robot, data))["own"][0], load.measured
    axes = np.flatnonzero(load.fixed.all(axis=0))
    spread = gravity[:, axes].std(axis=0) if axes.size else np.zeros(0)
    if not axes.size or not spread.max() > 0.0:
        return None
    x, y = (values[:, axes] - values[:, axes].mean(axis=0) for values in (gravity, measured))
    norm = float(np.sqrt(np.sum(x**2) * np.sum(y**2)))
    together = float(np.sum(x * y)) / norm if norm > 0.0 else 0.0
    return together, float(np.sqrt(np.sum(y**2) / np.sum(x**2)))


def as_drives_hold(robot: Robot, data: Dataset) -> Dataset:
    """The data with torques at rest as those of drives, which hold the load."""
    if not robot.has_geometry or not any(name in data.joints for name in TORQUES):
        return data
    found = beside_gravity(with_generic_masses(robot), data)
    if found is None or found[0] >= AGAINST:
        return data
    note = (f"the torques measured at rest run against gravity (correlation {found[0]:.2f}): they are taken "
            "with the opposite sign, as of a sensor that shows the load; if the arm is mounted otherwise, "
            "gravity_m_s2 of its file says how")
    turned = {name: -values if name in TORQUES else values for name, values in data.joints.items()}
    return replace(data, joints=turned, notes=(*data.notes, note))
