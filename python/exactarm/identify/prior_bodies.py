"""Bodies that a motion is read against: what identified links are drawn to where the motion says nothing.

A declared link is taken as it is, but nowhere thinner than a fiftieth of the arm's mean link: a point
or a rod has no neighbourhood of bodies. One that is declared without an inertia has that of a bar about
its centre of mass: what a file leaves out is not zero. A link without declared mass is a bar from the
frame before to its own, masses in proportion to lengths; how heavy all of them are together is left to
the data (`_scaled` in consistent.py).
"""

import numpy as np

from exactarm.robot.mdh_frames import behind_axis
from exactarm.robot.pseudo_inertia import of_body, spread_of
from exactarm.robot.robot import Robot

_THICKNESS = 0.1  # of the mean length: standard deviation about a bar's axis, of a bar 0.35 lengths wide
_THINNEST = 0.02  # the same of a declared link: thinner than the links of arms are
_SHORTEST_M = 0.1  # mean length that an arm without any is given
_MEAN_MASS_KG = 5.0  # of the bars, before they are scaled


def declares_bodies(robot: Robot) -> bool:
    """Whether the robot file says how heavy the links are."""
    links = robot.links or ()
    return all(link.mass >= 0.0 for link in links) and any(link.mass > 0.0 for link in links)


def prior_bodies(robot: Robot) -> np.ndarray:
    """(n, 4, 4) pseudo-inertias in the links' frames, of a robot with masses or without."""
    before = [_frame_before(joint) for joint in robot.joints]
    lengths = np.array([np.linalg.norm(point) for point in before])
    mean = lengths.mean() or _SHORTEST_M
    masses = (lengths + mean) / (lengths + mean).mean() * _MEAN_MASS_KG
    thin = (_THICKNESS * mean) ** 2
    declared = declares_bodies(robot)
    total = sum(link.mass for link in robot.links) if declared else masses.sum()
    bodies = []
    for index, point in enumerate(before):
        link = robot.links[index] if declared else None
        spread, centre = np.outer(point, point) / 12.0 + thin * np.eye(3), 0.5 * point
        mass = masses[index] / masses.sum() * total
        if link is not None and link.mass > 0.0:
            mass, centre = link.mass, link.centre_of_mass
            if link.inertia.any():
                values, vectors = np.linalg.eigh(spread_of(link) / link.mass)
                spread = (vectors * np.maximum(values, (_THINNEST * mean) ** 2)) @ vectors.T
        bodies.append(of_body(mass, centre, spread))
    return np.array(bodies)


def _frame_before(joint) -> np.ndarray:
    """(3,) origin of frame i-1 in frame i, at zero."""
    frame = behind_axis(joint)
    return -frame.rotation.T @ frame.position
