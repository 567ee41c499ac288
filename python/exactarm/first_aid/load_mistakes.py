"""Torques measured at rest that cannot be the load: of another sign, in another unit, currents without a
constant.

Against the gravity of the links, declared or generic, with slope b and correlation r of all measured axes
together: wrong sign where r < -0.5; another unit where |b| is 30 times too small or large (3 with declared
masses: friction and payload come on top). It never corrects: what is said is said, and the torque is used
as it stands.
"""

from collections.abc import Iterator

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.effects.payload import HEAVY
from exactarm.first_aid.suspicion import Suspicion
from exactarm.identify.loads import joint_angles
from exactarm.rest_load import RestLoad
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot.generic_masses import with_generic_masses
from exactarm.robot.robot import Robot

AGAINST = -0.5  # correlation with gravity, from which on a sign is wrong: friction and noise make none
OFF_DECLARED, OFF_GENERIC = 3.0, 30.0  # times gravity's size: generic masses are right to a factor of five
FAR_M = 2.0  # of a payload's centre from the flange: mm as m are a thousand times too much


def too_heavy(robot: Robot, mass: float) -> str:
    """Why a payload of `mass` kg is none of this arm's; empty where it may be."""
    own = robot.mass or sum(link.mass for link in robot.links or ())
    return (f"{mass:g} kg, the arm itself weighs {own:.3g} kg: is it in g or lb?"
            if 0.0 < HEAVY * own < mass else "")


def payload_mistakes(robot: Robot, data: Dataset) -> Iterator[Suspicion]:
    if data.payload is None:
        return
    mass, centre = data.payload
    if heavy := too_heavy(robot, float(mass.max(initial=0.0))):
        yield Suspicion(f"payload_kg is up to {heavy} It is used as it stands")
    away = float(np.linalg.norm(centre - data.flange.position, axis=1).max(initial=0.0))
    if away > FAR_M:
        yield Suspicion(f"the payload's centre lies {away:g} m from the flange: is it in mm? It is used as "
                        "it stands")


def load_mistakes(robot: Robot, data: Dataset) -> Iterator[Suspicion]:
    yield from payload_mistakes(robot, data)
    if "current" in data.joints:
        given = ~np.isnan(data.joints["current"]).all(axis=0)
        without = np.flatnonzero(given & np.array([joint.torque_constant is None for joint in robot.joints]))
        if without.size:
            yield Suspicion(f"currents of {axes_in_words(without)} are no load: the robot file declares no "
                            "torque_constant_Nm_A there")
    guessed = with_generic_masses(robot)
    load = RestLoad.of(guessed, data)
    if guessed.links is None or not load.fixed.any():
        return
    gravity, measured = load.parts(joint_angles(guessed, data))["own"][0], load.measured
    axes = np.flatnonzero(load.fixed.all(axis=0))
    spread = gravity[:, axes].std(axis=0) if axes.size else np.zeros(0)
    if not axes.size or not spread.max() > 0.0:
        return
    x, y = (values[:, axes] - values[:, axes].mean(axis=0) for values in (gravity, measured))
    norm = float(np.sqrt(np.sum(x**2) * np.sum(y**2)))
    together = float(np.sum(x * y)) / norm if norm > 0.0 else 0.0
    size = float(np.sqrt(np.sum(y**2) / np.sum(x**2)))
    most = OFF_GENERIC if guessed.generic_masses else OFF_DECLARED
    if together < AGAINST:
        yield Suspicion(
            f"the torques measured at rest run against gravity (correlation {together:.2f}): is their sign "
            "that of the load? They are used as they stand")
    if not 1.0 / most < size < most:
        unit = "is it Nm, on the output side of the gear?"
        yield Suspicion(f"the torques measured at rest vary {size:.2g} times as much as gravity does: {unit} "
                        "They are used as they stand")
