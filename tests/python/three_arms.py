"""Arms with published masses, for tests: two that ship, and a Puma 560.

Puma 560: Corke and Armstrong-Helouvry 1994; its first link, whose weight no joint carries, is a guess.
"""

from __future__ import annotations

import numpy as np

from exactarm.robot.robot import Joint, Link, Robot
from exactarm.robot_file import load_robot

_FRAMES = ((0.6718, 0.0, np.pi / 2), (0.0, 0.4318, 0.0), (0.15005, 0.0203, -np.pi / 2),
           (0.4318, 0.0, np.pi / 2), (0.0, 0.0, -np.pi / 2), (0.06, 0.0, 0.0))
_LINKS = ((13.0, (0.0, -0.3, 0.04)), (17.4, (-0.3638, 0.006, 0.2275)), (4.8, (-0.0203, -0.0141, 0.07)),
          (0.82, (0.0, 0.019, 0.0)), (0.34, (0.0, 0.0, 0.0)), (0.09, (0.0, 0.0, 0.032)))


def puma() -> Robot:
    joints = tuple(Joint(d=d, a=a, alpha=alpha, q_min=-2.2, q_max=2.2) for d, a, alpha in _FRAMES)
    links = tuple(Link(mass, np.array(centre), np.zeros((3, 3))) for mass, centre in _LINKS)
    return Robot("puma", joints, links)


def three_arms() -> list[Robot]:
    return [load_robot("ur10"), load_robot("racer-7-1.4"), puma()]
