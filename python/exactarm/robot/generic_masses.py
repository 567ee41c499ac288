"""Generic masses: links of an arm whose file declares none, from its geometry alone.

    tube i between the origins of frames i-1 and i:   mass l_i (L_i + L_{i+1}) / 2, at its middle
    drive of joint i+1, at the origin of frame i:     mass 0.2 L_{i+1} L_1

l_i: length of the tube, L_i: what is left of the arm from joint i on (m), all sliding axes at zero. A beam
whose section falls linearly towards the flange, and drives by the load behind them. Then all is scaled to
the total mass: of that of the whole arm in the robot file (`mass_kg`) what is not its base, else 9 kg/m^3
L_1^3: like arms weigh as the cube of their size (links as published: Puma 560 7, UR10 6, Racer 7-1.4 18; the
geometric mean is 9).
Gravity at axes 2 and 3 of these three arms, as one number times this law: 1 to 15 % RMS off; beside a mass
at the flange, 1 to 8 % (tests/python/test_generic_masses.py). Point masses: no inertia, so good for arms at
rest.
"""

from dataclasses import replace

import numpy as np

from exactarm import _core
from exactarm.robot.robot import Link, Placement, Robot

KG_PER_CUBIC_METRE = 9.0  # of the cube of the arm's length
DRIVE_SHARE = 0.2  # of a drive's mass to that of a tube: 0.1 to 0.3 are alike on the three arms
# of the mass of a whole arm, in its links: its base, which no joint moves, is taken for 10 to 50 %; no
# measurement stands behind it, so it widens the interval
MOVING_SHARE = 0.7
# standard deviation of the logarithm of a load by this law: of kg/m^3 of the three arms (7, 6, 18); where the
# mass of the whole arm is known, 0.25 of the three arms by the mass of their links and 0.2 of the base; and
# what the shape leaves where a torque is known
SPREAD, SPREAD_BY_MASS, SPREAD_OF_SHAPE = 0.6, 0.32, 0.15
# of the first moments of links, standard deviation: 0.26 RMS on the three arms, of what one number and a mass
# at the flange leave
DISTRIBUTION = 0.25
_TWO_SIDED = 1.96  # standard deviations, 95 %


def generic_links(robot: Robot, mass: float | None = None) -> tuple[Link, ...] | None:
    """Links of `mass` kg in all (default: by that of the whole arm, else by its size); None without
    lengths."""
    steps = _steps(robot) if robot.has_geometry else np.zeros((robot.axes, 3))
    length = np.linalg.norm(steps, axis=1)
    left = np.append(np.cumsum(length[::-1])[::-1], 0.0)
    tubes = length * 0.5 * (left[:-1] + left[1:])
    drives = DRIVE_SHARE * left[1:] * left[0]
    total = float(np.sum(tubes + drives))
    if total <= 0.0:
        return None
    wanted = mass or MOVING_SHARE * (robot.mass or 0.0) or KG_PER_CUBIC_METRE * left[0] ** 3
    links = []
    for step, tube, drive in zip(steps, tubes, drives):
        own = tube + drive
        centre = 0.5 * step * (tube / own) if own else np.zeros(3)
        links.append(Link(float(own * wanted / total), centre, np.zeros((3, 3))))
    return tuple(links)


def first_moments(robot: Robot) -> np.ndarray:
    """(n,) kg m: the mass of each link times the distance of its centre from its frame, and what hangs behind
    it times the link's length."""
    mass = np.array([link.mass for link in robot.links])
    centre = np.array([np.linalg.norm(link.centre_of_mass) for link in robot.links])
    length = np.linalg.norm(_steps(robot), axis=1)
    return mass * centre + (np.cumsum(mass[::-1])[::-1] - mass) * length


def with_generic_masses(robot: Robot, mass: float | None = None) -> Robot:
    """The robot with generic links where it declares none; as it is where it has links, or no lengths."""
    if robot.links is not None:
        return robot
    links = generic_links(robot, mass)
    return robot if links is None else replace(robot, links=links, generic_masses=True)


def spread_of_load(robot: Robot, torque_known: bool) -> float:
    """Standard deviation of the logarithm of a generic load."""
    return SPREAD_OF_SHAPE if torque_known else SPREAD_BY_MASS if robot.mass else SPREAD


def with_unknown_load(spread: float, value: float, low: float, high: float,
                      power: int = 1) -> tuple[float, float]:
    """The 95 % interval of a size per Nm (to this power) of a load that is known to `spread`, from that for
    the load as it is taken."""
    doubt = _TWO_SIDED * power * spread
    if value < 0.0:
        low, high = with_unknown_load(spread, -value, -high, -low, power)
        return -high, -low
    if low <= 0.0:
        return low * float(np.exp(doubt)), high * float(np.exp(doubt))
    return (value * float(np.exp(-np.hypot(np.log(value / low), doubt))),
            value * float(np.exp(np.hypot(np.log(high / value), doubt))))


def with_declared_masses(robot: Robot) -> Robot:
    """The robot without links that are generic."""
    return replace(robot, links=None, generic_masses=False) if robot.generic_masses else robot


def _steps(robot: Robot) -> np.ndarray:
    """(n, 3) m: from the origin of frame i to that of frame i-1, seen in frame i."""
    bare = replace(robot, base=Placement(), tool=Placement(), links=None, effects=())
    origins, rotations = (values[0] for values in _core.frame_poses(bare.core, np.zeros((1, robot.axes))))
    return np.einsum("ikj,ik->ij", rotations[1:], origins[:-1] - origins[1:])
