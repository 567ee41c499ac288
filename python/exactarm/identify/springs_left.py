"""Springs that a calibration does not have: would they take most of what it leaves?

    share = 1 - S(J, C) / S(J),     S: square sum of the whitened residual clear of these columns; C: one
                                    column for the spring of every axis

Not estimated, because the arm's masses are a guess: of a generic distribution of masses a load is right in
kind, not in size (robot/generic_masses.py). That springs act it shows, what they are a diagnosis estimates.
Or under another gravity than the robot file's: an arm on a wall or a ceiling whose file has it on the floor
gives way as nothing else does. Springs that are no less than zero count there (Lawson and Hanson 1974).
"""

from collections.abc import Iterator
from copy import copy
from dataclasses import replace
from itertools import product

import numpy as np
import scipy  # scipy.optimize is imported at its first use

from exactarm.effects.joint_compliance import JointCompliance
from exactarm.identify.pose_fit import PoseFit
from exactarm.numerics.orthonormal import orthonormal
from exactarm.rest_load import RestLoad
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.view import View

# of the square sum: as much by chance would take as many columns as half of the numbers
_MOST = 0.5
_HALVED = 0.5  # of the error that springs under the declared gravity leave
_NUMBERS_EACH = 10  # for every column, at least


def springs_not_estimated(fit: PoseFit) -> Iterator[str]:
    """One line where they would."""
    view = fit.prediction.view
    asked = [i for i in _springs_of(view) if view.guessed_load(i)]
    if not _enough(fit, len(asked)):
        return
    numbers, own = _whitened(fit)
    springs = _columns(fit, asked)
    left = lambda basis: float(np.sum((numbers - basis @ (basis.T @ numbers)) ** 2))
    rigid = left(orthonormal(own))
    share = 1.0 - left(orthonormal(np.concatenate([own, springs], axis=1))) / max(rigid, 1e-300)
    if share > _MOST:
        yield (f"springs of {axes_in_words(asked)}, which are not estimated because the robot file declares "
               f"no masses, would take {100 * share:.0f} % of what is left (square sum): `exactarm "
               "diagnose` finds them; with declared masses or measured torques they are estimated here")


def mounted_otherwise(fit: PoseFit) -> Iterator[str]:
    """One line where springs under gravity along another axis of the base would."""
    view, robot = fit.prediction.view, fit.prediction.view.robot
    asked = [i for i in _springs_of(view) if not view.measured_loads[i]]
    size = np.linalg.norm(robot.gravity)
    if not size or not _enough(fit, len(asked)):
        return
    numbers, own = _whitened(fit)
    asked_for = [np.full(int(free.sum()), effect.gives_way and effect.joint is not None)
                 for effect, free in zip(fit.layout.effects, fit.layout.free)]
    estimated = np.concatenate(asked_for)
    numbers = numbers + own[:, estimated] @ fit.layout.values[estimated]  # as of a rigid arm
    basis, base = orthonormal(own[:, ~estimated]), robot.controller.base.rotation
    along = [springs - basis @ (basis.T @ springs)
             for springs in (_columns(fit, asked, size * axis) for axis in base)]
    scale = np.maximum(np.sqrt(sum(np.sum(springs**2, axis=0) for springs in along)), 1e-300)
    clear = numbers - basis @ (basis.T @ numbers)
    left = lambda direction: float(
        scipy.optimize.nnls(np.tensordot(direction, along, axes=1) / scale, clear)[1])
    declared = left(base @ robot.gravity / size)
    directions = [np.array(d) / np.linalg.norm(d) for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)]
    best = min(directions, key=left)
    if left(best) < _HALVED * declared:
        words = ", ".join(f"{size * value + 0.0:.3g}" for value in best)
        share = left(best) / declared
        yield (f"springs under gravity about ({words}) m/s² in the base would leave {share:.2g} of the error "
               "that springs under the declared one leave: is the arm mounted otherwise than gravity_m_s2 of "
               "the robot file says?")


def _springs_of(view: View) -> list[int]:
    """Axes that could have a spring, under loads that are known or guessed."""
    return [i for i, joint in enumerate(view.robot.joints) if view.has_masses and joint.type == "revolute"
            and not (view.guessed_load(i) and joint.spring_linear)]


def _enough(fit: PoseFit, columns: int) -> bool:
    numbers = len(fit.prediction.view.data.session) * len(fit.sigma)
    return columns > 0 and numbers >= fit.layout.size + _NUMBERS_EACH * columns


def _whitened(fit: PoseFit) -> tuple[np.ndarray, np.ndarray]:
    """Residual (R,) and Jacobian (R, P)."""
    components = len(fit.sigma)
    numbers = fit.prediction.residual(components > 3) / fit.sigma
    return numbers.ravel(), _flat(fit, np.asarray(fit.prediction.jacobian))


def _columns(fit: PoseFit, axes: list[int], gravity: np.ndarray | None = None) -> np.ndarray:
    """(R, k) whitened response to the springs of some axes, under another gravity than the robot's."""
    view = fit.prediction.view
    if gravity is not None:
        load = RestLoad.of(replace(view.robot, gravity=gravity), view.data, view.threads,
                           view.signals["flange_load"])
        view = copy(view)
        view.signals = view.signals | {"torque": load.torque(view.q)}
    return np.concatenate([_flat(fit, view.response(JointCompliance.none_of(view.robot, i))[:, :, :1])
                           for i in axes], axis=1)


def _flat(fit: PoseFit, columns: np.ndarray) -> np.ndarray:
    components = len(fit.sigma)
    return (columns[:, :components] / fit.sigma[:, None]).reshape(-1, columns.shape[2])
