"""A six-axis robot with everything declared, for tests: the geometry of a small industrial arm, round numbers
elsewhere."""

from __future__ import annotations

import numpy as np

from exactarm.numerics.rotation import exp
from exactarm.robot.robot import Joint, Link, Placement, Robot

_FRAMES = (  # d, a, alpha, beta, q_offset
    (0.43, 0.15, np.pi / 2, None, 0.0),
    (0.0, 0.59, 0.0, None, np.pi / 2),
    (0.0, 0.13, np.pi / 2, 0.0, np.pi / 2),
    (0.684, 0.0, -np.pi / 2, None, 0.0),
    (0.0, 0.0, np.pi / 2, None, 0.0),
    (0.1, 0.0, 0.0, None, 0.0),
)
_RATIO = (84.0, 82.0, 69.0, -51.0, 46.0, 50.0)
_ROTOR = (1.2e-3, 1.2e-3, 6e-4, 1.2e-4, 1e-4, 6e-5)
_COULOMB = (35.0, 40.0, 25.0, 6.0, 5.0, 3.0)
_VISCOUS = (18.0, 22.0, 12.0, 2.5, 2.0, 1.2)
_SPRING = (3e5, 2.5e5, 1.2e5, 2.5e4, 2e4, 1.2e4)
_LINKS = (  # mass, centre of mass, central inertia (diagonal)
    (76.0, (-0.12, -0.07, -0.05), (1.4, 1.8, 1.8)),
    (22.0, (-0.32, 0.0, 0.13), (0.1, 0.87, 0.86)),
    (23.0, (-0.07, -0.01, -0.02), (0.21, 0.22, 0.29)),
    (12.0, (0.0, 0.39, 0.0), (0.8, 0.03, 0.78)),
    (3.2, (0.005, -0.002, 0.003), (0.007, 0.006, 0.004)),
    (0.5, (0.0, 0.001, -0.008), (0.0004, 0.0004, 0.0005)),
)


def six_axis(springs: bool = False, placed: bool = True) -> Robot:
    """The robot; `springs`: with its joint springs declared; `placed`: with base and tool away from the
    origin."""
    joints = []
    for i, (d, a, alpha, beta, q_offset) in enumerate(_FRAMES):
        joints.append(
            Joint(
                d=d, a=a, alpha=alpha, beta=beta, q_offset=q_offset, ratio=_RATIO[i], rotor_inertia=_ROTOR[i],
                coulomb=_COULOMB[i], viscous=_VISCOUS[i], spring_linear=_SPRING[i] if springs else None,
                q_min=-2.0, q_max=2.0, q_dot_max=4.0, q_ddot_max=15.0,
            )
        )
    links = tuple(Link(mass, np.array(centre), np.diag(inertia)) for mass, centre, inertia in _LINKS)
    base = Placement(exp(np.array([0.02, -0.03, 0.7])), np.array([0.4, -1.1, 0.3])) if placed else Placement()
    tool = Placement(np.eye(3), np.array([0.02, 0.05, 0.12])) if placed else Placement()
    return Robot("six axis", tuple(joints), links, base=base, tool=tool)
