"""Values of a robot file that contradict each other: units that a plan or a simulation takes as they are.

    m g r(q) <= drive torque       a drive holds the arm's own links, at any pose within the limits
    m g r(q) / k  small            a gear's spring hardly gives way under them
    J ratio^2 q_ddot_max <= drive torque    a drive turns its own rotor as fast as the file says

Only what is declared is compared. The factors leave room for balancers, which carry most of a large arm, and
for data sheets that mean another moment by the same word.
"""

from collections.abc import Iterator

import numpy as np

from exactarm.errors import InputError
from exactarm.robot.robot import Robot

POSES = 200  # random ones within the limits: the largest moment of six shipped arms to a few per cent
MOST_LOAD = 4.0  # times the drive's torque; the racer's own links ask for a third of it at most
MOST_TURN_RAD = 0.1  # of a spring; a harmonic drive at its rated torque: 1e-3
MOST_ROTOR = 3.0  # times the drive's torque; the racer's: 0.1


def robot_mistakes(robot: Robot) -> tuple[str, ...]:
    """One line for each sort of contradiction, of the axis where it is largest."""
    if not robot.has_geometry:
        return ()
    found = []
    if robot.links is not None and not robot.generic_masses and any(link.mass for link in robot.links):
        found += list(_loads(robot))
    return tuple(found + list(_rotors(robot)))


def _loads(robot: Robot) -> Iterator[str]:
    low, high = (np.array([default if bound is None else bound for bound in bounds]) for bounds, default in (
        ([joint.q_min for joint in robot.joints], -np.pi), ([joint.q_max for joint in robot.joints], np.pi)))
    q = np.random.default_rng(0).uniform(low, np.maximum(low, high), (POSES, robot.axes))
    try:
        moment = np.abs(robot.inverse_dynamics(q)).max(axis=0)
    except InputError:  # what it lacks is said by what needs it
        return
    turning = np.array([joint.type == "revolute" for joint in robot.joints])
    shares = _over(moment, [joint.torque_max for joint in robot.joints]) * turning
    if shares.max() > MOST_LOAD:
        i = int(np.argmax(shares))
        yield (f"axis {i + 1} needs {moment[i]:.3g} Nm to hold the links that the robot file declares, its "
               f"drive gives {robot.joints[i].torque_max:.3g} Nm: are masses, centres of mass, gravity or "
               "torque in another unit (g, mm, mNm)?")
    turns = _over(moment, [joint.spring_linear for joint in robot.joints]) * turning
    if turns.max() > MOST_TURN_RAD:
        i = int(np.argmax(turns))
        yield (f"the spring of axis {i + 1} gives way by {np.degrees(turns[i]):.3g} degrees under the links "
               "that the robot file declares: are springs (kNm/rad), masses or centres of mass in another "
               "unit?")


def _rotors(robot: Robot) -> Iterator[str]:
    own = np.array([(joint.rotor_inertia or 0.0) * (joint.ratio or 0.0) ** 2 * (joint.q_ddot_max or 0.0)
                    for joint in robot.joints])
    shares = _over(own, [joint.torque_max for joint in robot.joints])
    if shares.max() > MOST_ROTOR:
        i = int(np.argmax(shares))
        yield (f"the rotor of axis {i + 1} alone needs {own[i]:.3g} Nm for the acceleration that the robot "
               f"file allows, its drive gives {robot.joints[i].torque_max:.3g} Nm: is rotor_inertia_kg_m2 in "
               "another unit (kg cm², g cm²), or of the output side?")


def _over(values: np.ndarray, limits: list[float | None]) -> np.ndarray:
    """values / limits, 0 where no limit is declared."""
    return np.array([value / limit if limit else 0.0 for value, limit in zip(values, limits)])
