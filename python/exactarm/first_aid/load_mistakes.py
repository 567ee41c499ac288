"""Torques measured at rest that cannot be the load: in another unit, currents without a constant; payloads
that no arm carries.

Another unit where the torques vary 30 times less or more than the gravity of the links (3 times with declared
masses: friction and payload come on top). It never corrects: what is said is said, and the torque is used as
it stands. Their sign is told by identify/rest_torque.py.
"""

from collections.abc import Iterator

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.effects.payload import HEAVY
from exactarm.first_aid.suspicion import Suspicion
from exactarm.identify.rest_torque import beside_gravity
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot.generic_masses import with_generic_masses
from exactarm.robot.robot import Robot

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
    found = beside_gravity(guessed, data)
    if found is None:
        return
    size, most = found[1], OFF_GENERIC if guessed.generic_masses else OFF_DECLARED
    if not 1.0 / most < size < most:
        unit = "is it Nm, on the output side of the gear?"
        yield Suspicion(f"the torques measured at rest vary {size:.2g} times as much as gravity does: {unit} "
                        "They are used as they stand")
