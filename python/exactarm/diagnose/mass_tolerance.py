"""What the masses of a drawing may be off by, and which causes are more than that.

Declared links are held in a motion. Their base parameters p (base_parameters.py) are uncertain all the same:

    mass m_i           MASS m_i
    first moment       MASS m_i (|c_ik| + r_i)
    inertia            2 MASS m_i (|c_i|^2 + r_i^2)          c_i centre of mass, r_i radius of gyration

and a kept parameter by the root of its own square and of those that it bears. T (R, b): whitened response to
one standard deviation of each, V = I + T T'. A cause with columns C, cleared of what the free parameters
absorb, has beside them the gain r'V^-1 C (C'V^-1 C)^-1 C'V^-1 r of the square sum r'V^-1 r: of its evidence
stays what masses inside their tolerance could not do as well.

MASS is a plausible size, no measurement: castings are within some per cent of their nominal weight, and
cables, grease, covers and screws are in few drawings.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from exactarm import _core
from exactarm.diagnose.problem import Fitted
from exactarm.diagnose.scan import linear_columns
from exactarm.effects.base import Effect
from exactarm.effects.link_inertia import LinkInertia
from exactarm.identify.base_parameters import base_parameters
from exactarm.robot import Robot

MASS = 0.03  # relative, standard deviation


def mass_tolerance(robot: Robot) -> tuple[LinkInertia, np.ndarray]:
    """The base parameters of the declared links, and the standard deviation (b,) of each."""
    base = base_parameters(robot)
    links = np.abs(np.array(_core.inertial_parameters(robot.core))).reshape(-1, 10)
    mass = np.maximum(links[:, 0], 1e-12)
    centre = links[:, 1:4] / mass[:, None]
    gyration = np.maximum(links[:, [4, 7, 9]].sum(axis=1) / (2.0 * mass) - np.sum(centre**2, axis=1), 0.0)
    first = MASS * mass[:, None] * (centre + np.sqrt(gyration)[:, None])
    second = 2.0 * MASS * mass * (np.sum(centre**2, axis=1) + gyration)
    sizes = np.column_stack([MASS * mass, first, np.tile(second[:, None], 6)]).ravel()
    sizes = np.concatenate([sizes, np.zeros(robot.axes)])
    own = sizes[base.kept] ** 2 + base.K**2 @ sizes[base.dropped] ** 2
    kept = [place for place, column in enumerate(base.kept) if column < base.link_columns]
    return LinkInertia.of(robot, base.links), np.sqrt(own[kept])


def probability_beside(without: Fitted, effect: Effect, evidence: float, tolerance: np.ndarray,
                       count: float) -> float:
    """That an effect is there, if all that else could be is masses inside their tolerance.

    without: the fit without the effect, which has `evidence` there; tolerance (N, m, b): response to one
    standard deviation of each base parameter; count: independent numbers.
    """
    basis, residual = without.basis, without.free_residual
    clear = lambda columns: columns - basis @ (basis.T @ columns)
    t = clear(without.whiten(tolerance))
    c = clear(linear_columns(without, effect))
    c = c / np.maximum(np.linalg.norm(c, axis=0), 1e-300)
    inner = np.linalg.cholesky(np.eye(t.shape[1]) + t.T @ t)
    onto = lambda x: np.linalg.solve(inner, t.T @ x)

    def fall(square: float, y: np.ndarray, h: np.ndarray) -> float:
        gain = float(y @ np.linalg.pinv(h, rcond=1e-8, hermitian=True) @ y)
        return 0.5 * count * float(np.log(square / max(square - gain, 1e-12 * square)))

    alone = fall(float(residual @ residual), c.T @ residual, c.T @ c)
    tr, tc = onto(residual), onto(c)
    beside = fall(float(residual @ residual - tr @ tr), c.T @ residual - tc.T @ tr, c.T @ c - tc.T @ tc)
    return float(special.expit(evidence - max(alone - beside, 0.0)))
