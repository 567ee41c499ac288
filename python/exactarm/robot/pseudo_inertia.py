"""Pseudo-inertia of a body: the second moments of its mass, as one symmetric matrix.

    P = int [r; 1] [r; 1]' dm = [[S, h], [h', m]],   S = tr(I) / 2 - I,   h = m c    (Wensing et al. 2018)

P (4, 4) in kg m^2, kg m, kg; I (3, 3) about the frame's origin. A body whose mass is nowhere negative
has P >= 0, and every P > 0 is some body's: positive mass, positive inertia about the centre of mass and
the triangle inequality of its principal moments follow. P is linear in the ten inertial parameters (m,
m c, Ixx, Ixy, Ixz, Iyy, Iyz, Izz).
"""

import numpy as np

from exactarm.robot.robot import Link, Robot

ENTRIES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))  # of the inertia, in the order of the parameters
_ROUNDING = 1e-9  # of the largest second moment: numbers that were written and read again


def _basis() -> np.ndarray:
    """(10, 4, 4) derivative of P by each inertial parameter."""
    basis = np.zeros((10, 4, 4))
    basis[0, 3, 3] = 1.0
    for k in range(3):
        basis[1 + k, k, 3] = basis[1 + k, 3, k] = 1.0
    for k, (i, j) in enumerate(ENTRIES, start=4):
        inertia = np.zeros((3, 3))
        inertia[i, j] = inertia[j, i] = 1.0
        basis[k, :3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    return basis


BASIS = _basis()


def pseudo_inertia(parameters: np.ndarray) -> np.ndarray:
    """(4, 4) of ten inertial parameters."""
    return np.tensordot(parameters, BASIS, axes=1)


def of_body(mass: float, centre: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """(4, 4) of a mass with this centre and covariance (3, 3) m^2 of where it is."""
    P = np.empty((4, 4))
    P[:3, :3] = mass * (spread + np.outer(centre, centre))
    P[:3, 3] = P[3, :3] = mass * centre
    P[3, 3] = mass
    return P


def inertial_parameters(P: np.ndarray) -> np.ndarray:
    """(10,) of a pseudo-inertia: the inverse of `pseudo_inertia`."""
    inertia = np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3]
    return np.array([P[3, 3], *P[:3, 3], *(inertia[i, j] for i, j in ENTRIES)])


def spread_of(link: Link) -> np.ndarray:
    """(3, 3) kg m^2: second moments of a link about its centre of mass; positive for a body."""
    return 0.5 * np.trace(link.inertia) * np.eye(3) - link.inertia


def inconsistencies(robot: Robot) -> tuple[str, ...]:
    """What no body can have, a sentence for each link; points and rods, thin as they are, are bodies."""
    found = []
    for number, link in enumerate(robot.links or (), start=1):
        least, *_, largest = np.linalg.eigvalsh(spread_of(link))
        if link.mass < 0.0:
            found.append(f"link {number} has the mass {link.mass:.3g} kg")
        elif least < -_ROUNDING * abs(largest):
            moments = ", ".join(f"{value:.3g}" for value in np.linalg.eigvalsh(link.inertia))
            found.append(
                f"link {number} has the principal moments of inertia {moments} kg m2: no body has these")
    return tuple(found)
