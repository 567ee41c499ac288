"""Identification of the dynamics from motion data: base inertial parameters, rotors, friction.

1. one filter on both sides (chain/motion_record), 2. base parameters by QR, 3. of these, those that the
motion excites (pivoted QR of the weighted, scaled regressor), 4. how sharply dry friction turns over at a
reversal,
5. iterated weighted least squares, 6. intervals for correlated samples, 7. links that are bodies
(consistent.py),
8. the torque error before and after, on the rows that were fitted and on those that were not, and without
step 7. Swevers et al. 1997; Gautier 1991; Atkeson, An and Hollerbach 1986.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from exactarm.chain import (
    Layout,
    MotionRecord,
    motion_clear_of_reversals,
    motion_record,
    predict_motion,
    reversals_left_out,
)
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import MOTION
from exactarm.data.kinds.motion import TORQUES
from exactarm.data.split import DEFAULT_SEED
from exactarm.effects.declared_friction import DeclaredFriction
from exactarm.effects.declared_rotor import DeclaredRotor
from exactarm.effects.held_friction import HeldFriction
from exactarm.effects.link_inertia import LinkInertia
from exactarm.errors import InputError
from exactarm.identify.base_parameters import BaseParameters, base_parameters
from exactarm.identify.consistent import consistent_fit
from exactarm.identify.declared import carried_layout, require_geometry, with_estimates
from exactarm.identify.friction_width import dry_friction
from exactarm.identify.identifiability import Dropped
from exactarm.identify.motion_fit import MotionFit, fit_motion
from exactarm.identify.prior_bodies import declares_bodies
from exactarm.identify.session_payloads import EstimatedPayload, payload_layout_of_motion, session_payloads
from exactarm.rest_load import declared_constants
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot.generic_masses import with_declared_masses
from exactarm.robot.robot import Link, Robot
from exactarm.view import SIGN_WIDTH_RAD_S, SLIDES_RAD

_WORST_CONDITION = 1e3  # of scaled columns: a parameter behind it would carry noise, not mass
_BOOKKEEPING_MASS_KG = 5.0  # of links without a declared mass: no motion tells how a group is shared out

# Steps as they are told, in their order.
EXCITED, FITTING = "parameters that the motion shows", "inertias, friction, rotors"
CONSISTENT = "masses that a body can have"


@dataclass(frozen=True)
class DynamicsOptions:
    """share: of the rows, for fitting, where the data do not say; inertial: masses, not friction alone."""

    bandwidth_hz: float | None = None
    share: float = 0.7
    inertial: bool = True
    seed: int = DEFAULT_SEED
    threads: int = 1


@dataclass(frozen=True)
class DynamicsIdentification:
    """records and residuals (N', m) Nm before and after, by "identification" and "validation"; unconstrained:
    those after without the condition that links are physical bodies (the same where no inertia was
    estimated)."""

    robot: Robot
    fit: MotionFit
    base: BaseParameters
    dropped: tuple[Dropped, ...]
    records: dict[str, MotionRecord]
    before: dict[str, np.ndarray]
    after: dict[str, np.ndarray]
    unconstrained: dict[str, np.ndarray]
    identification: np.ndarray
    inertial: bool
    declared_bodies: bool
    warnings: tuple[str, ...]
    payloads: tuple[EstimatedPayload, ...] = ()  # of each session, where some were not weighed


def identify_dynamics(robot: Robot, data: Dataset, options: DynamicsOptions = DynamicsOptions(),
                      progress: Callable[[str], None] = lambda text: None) -> DynamicsIdentification:
    """Identifies on one part of `data`, judges on the rest; raises InputError where these do not suffice."""
    require_geometry(robot)
    identification = data.split(options.seed, options.share)
    start = with_links(robot) if options.inertial else with_declared_masses(robot)
    records = {}
    for name, rows in (("identification", identification), ("validation", ~identification)):
        if np.any(rows):
            part = data.select(rows)
            record = motion_record(robot, part, options.bandwidth_hz)
            records[name] = motion_clear_of_reversals(start, record, part, options.threads)
    train = records["identification"]
    axes = train.measured_axes
    carried = carried_layout(robot, data, MOTION.name)
    progress(EXCITED)
    base = base_parameters(robot)
    layout = friction_layout(start, train)
    if options.inertial:
        layout = layout.joined(inertial_layout(start, base))
    held = carried.joined(payload_layout_of_motion(train.data, options.inertial))
    layout, unexcited = excited_layout(start, layout.joined(held), train, options.threads)
    require_enough(layout, train)
    dry = dry_friction(start, layout, train, options.threads)
    records = {name: replace(record, dry=dry if record is train else dry.elsewhere())
               for name, record in records.items()}
    before = {name: predict_motion(robot, carried, record, tangents=False).residual()[record.keep][:, axes]
              for name, record in records.items()}
    progress(FITTING)
    fit = fit_motion(start, layout, records["identification"], threads=options.threads)
    unconstrained = {name: fit.residual(record, options.threads) for name, record in records.items()}
    after, unsettled = unconstrained, ""
    if options.inertial:
        progress(CONSISTENT)
        fit, unsettled = consistent_fit(start, robot, fit, records["identification"], options.threads)
        after = {name: fit.residual(record, options.threads) for name, record in records.items()}
    dropped = tuple(_structurally(base)) * options.inertial + unexcited
    return DynamicsIdentification(
        robot=with_estimates(fit.robot, fit.layout, fit.intervals), fit=fit, base=base, dropped=dropped,
        records=records, before=before, after=after, unconstrained=unconstrained,
        identification=identification, inertial=options.inertial, declared_bodies=declares_bodies(robot),
        warnings=(*_warnings(fit, data, unsettled), *reversals_left_out(records.values())),
        payloads=session_payloads(data, fit.layout, fit.intervals))


def with_links(robot: Robot) -> Robot:
    """The robot with masses in its tables: its own, else equal ones at the frames' origins."""
    if robot.links is not None and not robot.generic_masses:
        return robot
    link = Link(_BOOKKEEPING_MASS_KG, np.zeros(3), np.zeros((3, 3)))
    return replace(robot, links=(link,) * robot.axes, generic_masses=False)


def friction_layout(robot: Robot, record: MotionRecord) -> Layout:
    """Of the axes that report a torque: Coulomb and viscous friction where they move, what friction holds
    where they stand still."""
    rate = np.max(np.abs(record.theta_dot / robot.controller_ratios), axis=0)
    moving = [DeclaredFriction.of(robot, i) for i in record.measured_axes if rate[i] > SIGN_WIDTH_RAD_S]
    return Layout.of((*moving, *(HeldFriction.of(robot, i) for i in axes_at_rest(robot, record))))


def axes_at_rest(robot: Robot, record: MotionRecord) -> np.ndarray:
    """Axes (from 0) that report a torque and whose gear never slides: any torque may be held there."""
    way = np.ptp(record.theta / robot.ratios, axis=0)
    return record.measured_axes[way[record.measured_axes] < SLIDES_RAD]


def inertial_layout(robot: Robot, base: BaseParameters) -> Layout:
    """Base parameters of the links, and the rotor inertias that are no part of them."""
    rotors = tuple(DeclaredRotor.of(robot, i) for i in base.rotors)
    return Layout.of((LinkInertia.of(robot, base.links), *rotors))


def inertia_was_estimated(robot: Robot) -> bool:
    """Whether the file has an interval on record for an inertial parameter: an estimate is no declaration,
    and held it would keep what another cause had lent it."""
    if robot.links is None:
        return False
    bounds = [robot.intervals.get(name, (0.0, 0.0))
              for name in inertial_layout(robot, base_parameters(robot)).names]
    return any(low < high for low, high in bounds)


def excited_layout(robot: Robot, layout: Layout, record: MotionRecord,
                   threads: int = 1) -> tuple[Layout, tuple[Dropped, ...]]:
    """The layout without the parameters that this motion cannot tell from others."""
    axes = record.measured_axes
    prediction = predict_motion(robot, layout, record, threads=threads)
    scale = np.sqrt(np.mean(record.torque[record.keep][:, axes] ** 2, axis=0))
    columns = prediction.jacobian[record.keep][:, axes] / np.maximum(scale, 1e-12)[:, None]
    columns = columns.reshape(-1, layout.size)
    size = np.linalg.norm(columns, axis=0)
    still = size <= 1e-9 * size.max()
    dropped = [Dropped(layout.names[k], "this motion does not excite it") for k in np.flatnonzero(still)]
    moving = np.flatnonzero(~still)
    triangle = np.linalg.qr(columns[:, moving] / size[moving], mode="r")
    upper, order = linalg.qr(triangle, mode="r", pivoting=True)
    diagonal = np.abs(np.diag(upper))
    weak = np.sort(moving[order[diagonal < diagonal[0] / _WORST_CONDITION]])
    why = "this motion cannot tell it from the others"
    dropped += [Dropped(layout.names[k], why) for k in weak]
    return layout.without({entry.name for entry in dropped}), tuple(dropped)


def require_enough(layout: Layout, record: MotionRecord) -> None:
    numbers = int(record.keep.sum()) * len(record.measured_axes)
    if numbers <= 2 * layout.size:
        raise InputError(
            f"{numbers} numbers at {record.bandwidth_hz or 0:.3g} Hz bandwidth for {layout.size} parameters: "
            "expected a longer motion")


def _structurally(base: BaseParameters):
    for column in base.without_effect:
        yield Dropped(base.names[column], "no motion of this robot shows it")
    for column in base.dropped:
        bearers = base.bearers(column)
        yield Dropped(base.names[column], f"only its sum with {', '.join(bearers)} can be told")


def _warnings(fit: MotionFit, data: Dataset, unsettled: str):
    if unsettled:
        yield f"the links are possible bodies, but not the best ones: {unsettled}"
    if not fit.fit.converged:
        yield f"the fit did not converge ({fit.fit.reason}): check the data for gross errors"
    if fit.uncertainty.freedom < 2 * fit.layout.size:
        yield (f"the samples are worth {fit.uncertainty.effective.sum():.0f} independent numbers for "
               f"{fit.layout.size} parameters: measure longer")
    for name, bound, asked, spread in zip(fit.layout.names, fit.fit.at_bound, *fit.fit.unbounded):
        if bound and asked < -fit.fit.half_width(spread):
            yield (f"{name} lies at its bound, 0: the data ask for a negative one, so something else in them "
                   "acts as it does")
        elif bound:
            yield f"{name} lies at its bound, 0: this motion does not tell it from none"
    yield from currents_as_torques(fit.robot, data)


def currents_as_torques(robot: Robot, data: Dataset) -> Iterator[str]:
    """One line on axes whose torque is known by a current alone, without a constant that makes Nm of it."""
    told = {name: ~np.isnan(values).all(axis=0) for name, values in data.joints.items() if name in TORQUES}
    if "current" not in told:
        return
    alone = told["current"] & ~np.any([told[name] for name in told if name != "current"], axis=0)
    constants = declared_constants(robot)
    if without := [i for i in range(robot.axes) if alone[i] and np.isnan(constants[i])]:
        yield (f"no torque constant of {axes_in_words(without)} is declared: the currents were taken at "
               "1 Nm/A, and what they tell scales with it")
