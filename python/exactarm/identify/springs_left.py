"""Springs that a calibration does not have: would they take most of what it leaves?

    share = 1 - S(J, C) / S(J),     S: square sum of the whitened residual clear of these columns; C: one
                                    column for the spring of every axis

Not estimated, because the arm's masses are a guess: of a generic distribution of masses a load is right in
kind, not in size (robot/generic_masses.py). That springs act it shows, what they are a diagnosis estimates.
Or under another gravity than the robot file's: an arm on a wall or a ceiling whose file has it on the floor
gives way as nothing else does, but an arm of few axes, which may have a run-out instead. Springs that are no
less than zero count there (Lawson and Hanson 1974).
"""

from collections.abc import Iterator
from copy import copy
from dataclasses import replace
from itertools import product

import numpy as np
import scipy  # scipy.optimize is imported at its first use

from exactarm.chain.spring import declared_deflection
from exactarm.effects.base import Effect
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.identify.pose_fit import PoseFit
from exactarm.numerics.orthonormal import orthonormal
from exactarm.rest_load import RestLoad
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.station import Station
from exactarm.view import View

# of the square sum: as much by chance would take as many columns as half of the numbers
_MOST = 0.5
# of the error that springs under the declared gravity leave; chosen, not derived: a question that comes often
# is not read
_HALVED = 0.5
_CERTAIN = 20.0  # nats by which a run-out has to be less likely, 1 in 5e8: what is left is not noise alone
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
    """One line where springs under another gravity would, of an arm that is rigid but for them."""
    view = fit.prediction.view
    asked = [i for i in _springs_of(view) if not view.measured_loads[i]]
    gravity, size = view.robot.gravity, np.linalg.norm(view.robot.gravity)
    if not size or not _enough(fit, len(asked)):
        return
    estimated = np.concatenate([np.full(int(free.sum()), _is_spring_of(effect, asked))
                                for effect, free in zip(fit.layout.effects, fit.layout.free)])
    numbers, own = _whitened(fit)
    rigid = numbers + _given_way(fit, asked)
    along = [_columns(fit, asked, size * axis) for axis in np.eye(3)]
    tried = [np.array(d) / np.linalg.norm(d) for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)]
    free = own[:, ~estimated]
    found, best = min((left, k) for k, left in enumerate(_left(free, along, rigid, tried)))
    (declared,) = _left(free, along, rigid, [gravity / size])
    # an arm of few axes turns under such a gravity as by the run-out of one of them
    turned = min(_left(np.column_stack([free, wave]), along, rigid, [gravity / size])[0]
                 for wave in _run_outs(fit))
    if found < _HALVED * declared and rigid.size * np.log(turned / max(found, 1e-300)) > _CERTAIN:
        words = ", ".join(f"{size * value + 0.0:.3g}" for value in tried[best])
        yield (f"springs under gravity_m_s2 = [{words}], or nearly so, would leave {found / declared:.2g} of "
               "the error that springs under the gravity of the robot file leave: is the arm mounted "
               "otherwise?")


def _left(free: np.ndarray, along: list[np.ndarray], rigid: np.ndarray,
          directions: list[np.ndarray]) -> list[float]:
    """Lengths of what free columns (R, b), and springs no less than zero under gravity along each direction,
    leave of numbers (R,)."""
    basis = orthonormal(free)
    beside = lambda columns: columns - basis @ (basis.T @ columns)
    numbers, along = beside(rigid), [beside(springs) for springs in along]
    scale = np.maximum(np.sqrt(sum(np.sum(springs**2, axis=0) for springs in along)), 1e-300)
    return [float(scipy.optimize.nnls(np.tensordot(direction, along, axes=1) / scale, numbers)[1])
            for direction in directions]


def _run_outs(fit: PoseFit) -> Iterator[np.ndarray]:
    """(R, 2) whitened, of every axis: a wave once a turn."""
    view = fit.prediction.view
    waves = np.stack([np.cos(view.q), np.sin(view.q)], axis=2)
    for i in range(view.axes):
        yield _flat(fit, view.transfers[Station.GEAR]((i,), waves[:, i : i + 1]))


def _is_spring_of(effect: Effect, axes: list[int]) -> bool:
    return (effect.gives_way and effect.station is Station.SPRING and effect.joint is not None
            and effect.index in axes)


def _given_way(fit: PoseFit, axes: list[int]) -> np.ndarray:
    """(R,) whitened: what the springs of these axes, declared, carried and estimated, do to the target."""
    view = fit.prediction.view
    turned = [((i,), declared_deflection(view.robot, view.torque)[0][:, i : i + 1]) for i in axes]
    turned += [(change.columns, change.value) for effect in fit.layout.effects if _is_spring_of(effect, axes)
               for change in (effect.change(view),)]
    return sum(_flat(fit, view.transfers[Station.SPRING](columns, angle[:, :, None]))[:, 0]
               for columns, angle in turned)


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
